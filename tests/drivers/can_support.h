/// tests/drivers/can_support.h - waiting for the tests of drivers/can.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <functional>
#include <future>
#include <string>
#include <vector>

#include "base/time.h"
#include "drivers/can/can_bus.h"
#include "tests/support/can_frames.h"

namespace narpa {

/// Repeats `step` until it returns true. The time is bounded only so that a broken bus fails its test instead of
/// hanging it.
inline bool turn_until(CanBus& bus, const std::function<bool()>& step) {
    const std::int64_t until_ns = monotonic_ns() + 120 * kSecond_ns;
    while (!step()) {
        if (monotonic_ns() > until_ns) return false;
        bus.wait(10'000'000);
    }
    return true;
}

/// Waits for one frame.
inline bool next_frame(CanBus& bus, ReceivedFrame& out) {
    return turn_until(bus, [&] { return bus.receive(out); });
}

inline std::unique_ptr<CanBus> open_or_fail(const std::string& spec, CanRole role) {
    auto bus = open_can_bus(spec, role);
    if (!bus) {
        ADD_FAILURE() << bus.error().text();
        return nullptr;
    }
    return std::move(*bus);
}

/// The port and the pty of a hub's description: "slcan: 127.0.0.1:29537 and /dev/pts/3".
inline std::uint16_t hub_port(const CanBus& hub) {
    const std::string text = hub.description();
    return static_cast<std::uint16_t>(std::stoi(text.substr(text.find(':', 6) + 1)));
}
inline std::string hub_pty(const CanBus& hub) {
    const std::string text = hub.description();
    return text.substr(text.rfind(' ') + 1);
}

/// A client of a hub that no other thread serves.
inline std::unique_ptr<CanBus> open_client_of(CanBus& hub) {
    const std::string spec = "slcan:" + std::to_string(hub_port(hub));
    auto client = std::async(std::launch::async, [&] { return open_or_fail(spec, CanRole::client); });
    std::vector<ReceivedFrame> came;  // nobody has said anything yet
    turn_until(hub, [&] {
        for (ReceivedFrame out; hub.receive(out);) came.push_back(out);
        return client.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
    });
    EXPECT_TRUE(came.empty());
    return client.get();
}

/// A group of this process alone, so that tests may run side by side.
inline std::string own_group() {
    const int n = ::getpid();
    return "239.74." + std::to_string(164 + n / 250 % 80) + "." + std::to_string(1 + n % 250);
}

}  // namespace narpa
