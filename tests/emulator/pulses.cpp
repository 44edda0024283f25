// Pulses that trigger exposures, and texts that name no line.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "drivers/descriptor.h"
#include "drivers/pulse/pulse_sink.h"
#include "loop_support.h"
#include "protocols/camera_control.h"

namespace narpa::test {
namespace {

constexpr std::int64_t kLatency_ns = 7'000'000, kPeriod_ns = 20'000'000;

class Pulses : public LoopTest {
protected:
    /// Two cameras with the same exposure in trigger mode external; the second one has the shorter latency.
    static std::string triggered(const std::string& mode = "external") {
        const std::string control = "control = {trigger = \"" + mode + "\", latency_s = ";
        const auto camera = [&](const char* latency) {
            return "rate_hz = 50\ndetector = {exposure_s = 0.001}\n" + control + latency + "}\n";
        };
        return small_scene(
            camera("0.007") +
            "[[camera]]\nname = \"second\"\nposition_m = [-10, 0, 0]\nattitude_wxyz = [0.5, -0.5, 0.5, "
            "-0.5]\nresolution = [64, 48]\nfov_horizontal_deg = 40\n" +
            camera("0.003"));
    }
    static RunOptions options(const std::string& trigger) {
        RunOptions o;
        o.bus = "slcan:0";
        o.video = {{"nav", "none"}, {"second", "none"}};
        o.triggers = {trigger};
        return o;
    }
    void expect_refused(const RunOptions& o, const std::string& scene_text, const std::string& what) {
        const auto emulator = Emulator::create(scene(scene_text), o);
        ASSERT_FALSE(emulator) << what;
        EXPECT_NE(emulator.error().text().find(what), std::string::npos) << emulator.error().text();
    }
};

/// Sends datagrams to a port of this machine that was free before.
class Pulser {
public:
    Pulser() : fd_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
        const Descriptor probe(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
        to_.sin_family = AF_INET;
        to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
        socklen_t bytes = sizeof to_;
        EXPECT_EQ(::bind(probe.get(), address(), sizeof to_), 0);
        EXPECT_EQ(::getsockname(probe.get(), address(), &bytes), 0);
    }
    [[nodiscard]] std::string source() const { return "udp:127.0.0.1:" + std::to_string(ntohs(to_.sin_port)); }
    void send(std::size_t bytes) {
        const std::vector<char> content(bytes);
        EXPECT_EQ(::sendto(fd_.get(), content.data(), bytes, 0, address(), sizeof to_),
                  static_cast<ssize_t>(bytes));
    }

private:
    [[nodiscard]] sockaddr* address() { return reinterpret_cast<sockaddr*>(&to_); }
    Descriptor fd_;
    sockaddr_in to_{};
};

/// Each pulse exposes one frame of both cameras, the longer latency after the kernel's stamp to the nanosecond, or
/// is refused, because it came within the period of the last one.
TEST_F(Pulses, OfDatagramsExposeAllCamerasAtOnce) {
    Pulser pulser;
    RunOptions o = options(pulser.source());
    o.log_folder = folder_ / "log";
    auto emulator = Emulator::create(scene(triggered()), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    StopFlag stop{false};
    std::thread running([&] { EXPECT_TRUE((*emulator)->run(stop)); });
    const auto frames_of = [&](std::size_t camera) { return (*emulator)->sensors()[camera]->made(); };
    const std::int64_t give_up_ns = monotonic_ns() + 60 * kSecond_ns;
    std::size_t sent = 0;
    // The next one when the frame of the last one was made; bytes from 0 on are all the same.
    while (sent < 5 && monotonic_ns() < give_up_ns) {
        if ((*emulator)->t_ns() <= 0 || frames_of(0) < sent || frames_of(1) < sent) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            continue;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(25));  // longer than the period
        pulser.send(100 * sent++);
        pulser.send(1);  // within the period, unless this thread has to wait between the two
    }
    while ((frames_of(0) < sent || frames_of(1) < sent) && monotonic_ns() < give_up_ns)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    stop = true;
    running.join();
    ASSERT_EQ((*emulator)->triggers().size(), 1u);
    const std::uint64_t received = (*emulator)->triggers()[0]->counters().received;
    EXPECT_LE(received, 2 * sent);
    const auto nav = read_rows(o.log_folder + "/nav.ledger.csv"),
               second = read_rows(o.log_folder + "/second.ledger.csv");
    for (const CameraSensor* camera : (*emulator)->cameras()) {
        const auto report = camera->report()["control"];
        const auto accepted = report["triggers"].get<std::uint64_t>(),
                   refused = report["triggers_refused"].get<std::uint64_t>();
        EXPECT_EQ(accepted + refused, received);
        EXPECT_GE(accepted, 5u);
        EXPECT_GE(refused, 1u);
        EXPECT_LE(nav.size(), accepted);  // the last one may have been stopped
    }
    const std::size_t frames = std::min(nav.size(), second.size());
    ASSERT_GE(frames, 5u);
    std::int64_t before_ns = -kPeriod_ns;
    for (std::size_t i = 0; i < frames; ++i) {
        const auto ns = [&](const std::string& column) { return std::stoll(nav[i].at(column)); };
        EXPECT_EQ(nav[i].at("trigger"), "external");
        EXPECT_EQ(ns("t_exposure_start_ns"), ns("t_trigger_ns") + kLatency_ns);
        EXPECT_GE(ns("t_trigger_taken_ns"), ns("t_trigger_ns"));
        EXPECT_GE(ns("t_trigger_ns"), before_ns + kPeriod_ns);
        before_ns = ns("t_trigger_ns");
        for (const char* column : {"t_exposure_start_ns", "t_trigger_ns", "t_trigger_taken_ns"})
            EXPECT_EQ(second[i].at(column), nav[i].at(column)) << column;
    }
}

/// Cameras in other modes do not obey them.
TEST_F(Pulses, AreNotForCamerasThatRunFreely) {
    Pulser pulser;
    RunOptions o = options(pulser.source());
    o.duration_s = 0.3;
    o.log_folder = folder_ / "log";
    auto emulator = Emulator::create(scene(triggered("free_running")), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    const StopFlag stop{false};
    for (int i = 0; i < 3; ++i) pulser.send(1);
    ASSERT_TRUE((*emulator)->run(stop));
    EXPECT_EQ((*emulator)->triggers()[0]->counters().received, 3u);
    const auto rows = read_rows(o.log_folder + "/nav.ledger.csv");
    ASSERT_GE(rows.size(), 1u);
    for (const auto& row : rows) {
        EXPECT_EQ(row.at("trigger"), "free_running");
        EXPECT_EQ(row.at("t_trigger_ns"), "0");
    }
}

TEST_F(Pulses, AreRefusedWhereNothingObeysThem) {
    RunOptions o = options("udp:127.0.0.1:0");
    RunOptions one = o;
    one.video.pop_back();
    expect_refused(one, small_scene(), "no camera can be triggered");
    o.bus.clear();
    expect_refused(o, triggered(), "expected a --can BUS beside --trigger");
    RunOptions lockstep = options("udp:127.0.0.1:0");
    lockstep.bus = record(3), lockstep.lockstep = true;
    expect_refused(lockstep, triggered(), "no place in lockstep");
}

TEST(PulseTexts, NameALineOrSayWhatIsExpected) {
    for (const char* spec : {"gpio:", "gpio:17", "gpio:gpiochip0/", "gpio:gpiochip0/x", "gpio:/17",
                             "gpio:gpiochip0/1,up", "gpio:gpiochip0/-1"}) {
        const auto source = open_pulse_source(spec);
        ASSERT_FALSE(source) << spec;
        EXPECT_NE(source.error().what.find("expected gpio:CHIP/LINE[,active_low][,falling]"), std::string::npos)
            << source.error().what;
    }
    EXPECT_NE(
        open_pulse_sink("gpio:gpiochip0/1,falling").error().what.find("expected gpio:CHIP/LINE[,active_low],"),
        std::string::npos);
    EXPECT_NE(open_pulse_source("gpio:nochip/3").error().what.find("cannot open /dev/nochip, line 3: No such file"),
              std::string::npos);
    EXPECT_NE(open_pulse_source("serial:/dev/ttyS0").error().what.find("expected gpio:CHIP/LINE or udp:PORT"),
              std::string::npos);
    EXPECT_NE(open_pulse_source("udp:none").error().what.find("udp:none"), std::string::npos);
    EXPECT_NE(open_pulse_sink("serial:").error().what.find("expected serial:DEVICE"), std::string::npos);
    EXPECT_NE(open_pulse_sink("serial:/dev/null").error().what.find("/dev/null has no line RTS"),
              std::string::npos);
    EXPECT_NE(open_pulse_sink("serial:/dev/no").error().what.find("cannot open /dev/no: No such file"),
              std::string::npos);
}

}  // namespace
}  // namespace narpa::test
