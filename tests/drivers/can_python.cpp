// Loop-back with python-can, unmodified, over every bus that needs no kernel support.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "drivers/can/client_hub.h"
#include "drivers/descriptor.h"
#include "protocols/can/messages.h"
#include "tests/drivers/can_support.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"

namespace narpa {
namespace {

struct Outcome {
    std::string out{};
    int status = -1;
};

Outcome finish(FILE* pipe, std::string out) {
    std::array<char, 4096> part;
    while (const std::size_t n = std::fread(part.data(), 1, part.size(), pipe)) out.append(part.data(), n);
    const int status = ::pclose(pipe);
    return {std::move(out), WIFEXITED(status) ? WEXITSTATUS(status) : -1};
}

/// The client sends; every frame comes back to it with the lowest bit of its identifier turned over.
Outcome serve_python(CanBus& bus, const std::string& arguments) {
    const std::string command =
        "/usr/bin/python3 " + test::source_path("tests/drivers/can_python_client.py ") + arguments + " 2>&1";
    FILE* pipe = ::popen(command.c_str(), "r");
    if (pipe == nullptr) return {};
    const int fd = ::fileno(pipe);
    ::fcntl(fd, F_SETFL, O_NONBLOCK);
    std::string out;
    const bool ended = turn_until(bus, [&] {
        ReceivedFrame received;
        while (bus.receive(received)) {
            received.frame.id ^= 1;
            (void)bus.send(received.frame);
        }
        std::array<char, 4096> part;
        const ssize_t n = ::read(fd, part.data(), part.size());
        if (n > 0) out.append(part.data(), static_cast<std::size_t>(n));
        return n == 0;
    });
    if (!ended) out += "(python did not come to an end)";
    ::fcntl(fd, F_SETFL, 0);
    return finish(pipe, std::move(out));
}

bool cannot_run(const Outcome& run) {
    return run.status == 77 || run.status == 127;
}

TEST(PythonCan, SlcanOverTcp) {
    auto hub = open_or_fail("slcan:0", CanRole::hub);
    const Outcome run = serve_python(*hub, "slcan socket://127.0.0.1:" + std::to_string(hub_port(*hub)));
    if (cannot_run(run)) GTEST_SKIP() << "no python-can: " << run.out;
    EXPECT_EQ(run.status, 0) << run.out;
    EXPECT_NE(run.out.find("burst 3000 of 3000"), std::string::npos) << run.out;
    EXPECT_EQ(hub->counters().malformed, 0u);
    EXPECT_EQ(hub->counters().send_drops, 0u);
}

// The program that protocols/can/README.md offers, as it stands there but for the port.
TEST(PythonCan, ReadmeProgramCommandsAPose) {
    if (std::system("/usr/bin/python3 -c 'import can, serial' 2>/dev/null") != 0) GTEST_SKIP() << "no python-can";
    std::string text = test::read_text(test::source_path("protocols/can/README.md"));
    const std::string fence = "```python\n", port = "29537";
    const std::size_t begin = text.find(fence) + fence.size();
    text = text.substr(begin, text.find("```", begin) - begin);
    auto hub = open_or_fail("slcan:0", CanRole::hub);
    text.replace(text.find(port), port.size(), std::to_string(hub_port(*hub)));
    const std::string path = testing::TempDir() + "narpa_readme_" + std::to_string(::getpid()) + ".py";
    std::ofstream(path) << text;

    FILE* pipe = ::popen(("/usr/bin/python3 -P " + path + " 2>&1").c_str(), "r");
    ASSERT_NE(pipe, nullptr);
    PoseDecoder decoder(0x100);
    PoseCommand command;
    EXPECT_TRUE(turn_until(*hub, [&] {
        for (ReceivedFrame received; hub->receive(received);) (void)decoder.accept(received.frame, 0, command);
        return hub->clients()->clients_left() == 1;  // it has ended
    }));
    const Outcome run = finish(pipe, "");
    EXPECT_EQ(run.status, 0) << run.out;
    EXPECT_EQ(decoder.count(PoseStatus::complete), 100u);
    EXPECT_EQ(decoder.count(PoseStatus::partial), 800u);
    EXPECT_EQ(command.t_valid_ns, 990'000'000);
    EXPECT_EQ(command.motion.T_world_body.t, (Vec3{0, 0, -9.01}));
    EXPECT_EQ(command.motion.velocity_m_s, (Vec3{0, 0, 1}));
    std::filesystem::remove(path);
}

TEST(PythonCan, SlcanOverPty) {
    auto hub = open_or_fail("slcan:0", CanRole::hub);
    const Outcome run = serve_python(*hub, "slcan " + hub_pty(*hub));
    if (cannot_run(run)) GTEST_SKIP() << "no python-can: " << run.out;
    EXPECT_EQ(run.status, 0) << run.out;
    EXPECT_NE(run.out.find("burst 3000 of 3000"), std::string::npos) << run.out;
    EXPECT_EQ(hub->counters().malformed, 0u);
}

/// In a network of its own, which has nothing but loopback and the route that python-can needs, so that neither
/// this machine's routes nor other tests matter.
TEST(PythonCan, UdpMulticast) {
    if (std::getenv("NARPA_TEST_OWN_NETWORK") == nullptr) {
        const std::string self = std::filesystem::read_symlink("/proc/self/exe");
        const std::string command =
            std::string(::geteuid() == 0 ? "unshare -n" : "unshare -rn") +
            " sh -c 'ip link set lo up && ip route add 239.74.163.2/32 dev lo src 127.0.0.1 || exit 77; "
            "NARPA_TEST_OWN_NETWORK=1 exec \"$0\" --gtest_filter=PythonCan.UdpMulticast' '" +
            self + "' 2>&1";
        FILE* pipe = ::popen(command.c_str(), "r");
        ASSERT_NE(pipe, nullptr);
        const Outcome run = finish(pipe, "");
        if (run.out.find("unshare:") != std::string::npos || cannot_run(run))
            GTEST_SKIP() << "no network of its own to be had here: " << run.out;
        EXPECT_EQ(run.status, 0) << run.out;
        if (run.out.find("[  SKIPPED ]") != std::string::npos) GTEST_SKIP() << run.out;
        return;
    }
    auto bus = open_or_fail("udp:239.74.163.2", CanRole::hub);
    const Outcome run = serve_python(*bus, "udp_multicast 239.74.163.2");
    if (cannot_run(run)) GTEST_SKIP() << "no python-can: " << run.out;
    EXPECT_EQ(run.status, 0) << run.out;
    EXPECT_EQ(bus->counters().malformed, 0u);
}

}  // namespace
}  // namespace narpa
