// Latencies: what is counted, and the ways that need no devices.
#include "bench/latency.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <thread>

#include "drivers/descriptor.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

LatencySettings few() {
    LatencySettings s;
    s.count = 20;
    s.pause_ns = 100'000;
    s.format = {64, 48, PixelFormat::grey, 100'000'000};
    return s;
}

TEST(BenchLatency, IsTheTimeOnTheWay) {
    int fds[2];
    ASSERT_EQ(::pipe(fds), 0);
    const Descriptor from(fds[0]), to(fds[1]);
    LatencyEnds ends;
    constexpr auto kWay = std::chrono::milliseconds(3);
    ends.send = [&](std::uint32_t k) {
        std::this_thread::sleep_for(kWay);
        if (k % 10 == 9) return true;  // lost on the way
        return ::write(to.get(), &k, sizeof k) == sizeof k;
    };
    ends.receive = [&](std::int64_t timeout_ns) -> std::optional<std::uint32_t> {
        pollfd fd{from.get(), POLLIN, 0};
        wait_ready({&fd, 1}, timeout_ns);
        std::uint32_t k = 0;
        if (fd.revents == 0 || ::read(from.get(), &k, sizeof k) != sizeof k) return std::nullopt;
        return k;
    };
    LatencySettings s = few();
    s.patience_ns = 1'000'000'000;
    const StopFlag stop{false};
    const auto row = measure_latency(ends, s, stop);
    ASSERT_TRUE(row) << row.error().text();
    EXPECT_EQ(row->latencies_s.size(), 20u);
    EXPECT_EQ(row->lost, 2) << "9 and 19, of 5 to 26";
    for (const double t : row->latencies_s) EXPECT_GE(t, 3e-3);
}

TEST(BenchLatency, OfABusAndOfSinks) {
    const StopFlag stop{false};
    const auto bus = measure_bus("slcan:0", few(), stop);
    ASSERT_TRUE(bus) << bus.error().text();
    ASSERT_EQ(bus->size(), 1u) << "slcan has no CAN FD";
    const test::TemporaryFolder folder;
    for (const char* name : {"fifo", "frames.y4m"}) {
        const auto row = measure_sink(folder / name, few(), stop);
        ASSERT_TRUE(row) << row.error().text();
        EXPECT_EQ(row->latencies_s.size(), 20u);
        EXPECT_EQ(row->lost, 0);
        const auto json = to_json(*row);
        EXPECT_LE(json["p50_s"], json["p99_s"]);
    }
    EXPECT_FALSE(measure_bus("slcan:x", few(), stop));
    EXPECT_FALSE(measure_sink("uvc:x", few(), stop));
}

}  // namespace
}  // namespace narpa
