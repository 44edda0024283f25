// The navigation on its wires: a hub that plays the emulator and the dynamics, frames through a FIFO, and what
// comes back on CAN.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <thread>

#include "drivers/video/video_sink.h"
#include "protocols/can/messages.h"
#include "rehearsal/navigation/node.h"
#include "tests/drivers/can_support.h"
#include "tests/rehearsal/simulated_sensors.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

const std::string kScenario = test::build_path("scenes/rehearsal/docking.toml");

/// The docking that comes with narpa, by camera alone.
Scenario by_camera_alone() {
    static const Scenario scenario = [] {
        auto s = read_scenario(kScenario);
        EXPECT_TRUE(s) << s.error().text();
        s->navigation.lidars.clear();
        return *std::move(s);
    }();
    return scenario;
}

/// The navigation's messages.
struct Sent {
    std::vector<CanFrame> frames;
    std::vector<NavigationEstimate> estimates;
    std::vector<ActuatorCommand> commands;
    std::vector<double> errors_m;
    Status ended{Ok{}};
};

Sent fly(const std::string& folder, std::int64_t cycles) {
    const Scenario s = by_camera_alone();
    auto model = SceneModel::create(s);
    EXPECT_TRUE(model);
    const Camera& camera = (*model)->scene().cameras[0];
    const std::string fifo = folder + "/nav.y4m";
    ::mkfifo(fifo.c_str(), 0600);
    auto sink =
        open_video_sink(fifo, {camera.width, camera.height, camera.format, camera.period_ns}, WhenFull::wait);
    EXPECT_TRUE(sink);
    const auto hub = open_or_fail("slcan:0", CanRole::hub);

    NodeOptions options;
    options.bus = "slcan:" + std::to_string(hub_port(*hub));
    options.video = {{"nav", fifo}};
    options.lockstep = true;
    options.log = folder + "/log";
    StopFlag stop{false}, ready{false};
    Sent sent;
    std::thread navigation([&] { sent.ended = navigate(s, options, stop, [&] { ready = true; }); });

    MessageDecoder<NavigationEstimate> estimates;
    MessageDecoder<ActuatorCommand> commands;
    const auto listen = [&](std::int64_t t_ns) {
        for (ReceivedFrame received; hub->receive(received);) {
            sent.frames.push_back(received.frame);
            NavigationEstimate e;
            if (estimates.accept(received.frame, t_ns, e) == DecodeStatus::complete) sent.estimates.push_back(e);
            ActuatorCommand c;
            if (commands.accept(received.frame, t_ns, c) == DecodeStatus::complete) sent.commands.push_back(c);
        }
    };
    const auto send = [&](const auto& message) {
        for (const CanFrame& f : encode_classic(message)) hub->send(f);
    };
    EXPECT_TRUE(turn_until(*hub, [&] {
        listen(0);  // lets it onto the bus
        return ready.load();
    }));
    Plant plant{s};
    plant.stand(s.start.position_m + Vec3{0.4, -0.3, 0.3}, {0.01, -0.01, 0.01});
    for (std::int64_t k = 0; k < cycles; ++k) {
        const std::int64_t t_ns = k * s.period_ns();
        send(DynamicsReport{static_cast<std::uint8_t>(k), t_ns, 0, DynamicsPhase::flying});
        send(AttitudeReport{static_cast<std::uint8_t>(k), t_ns, plant.motion.q_world_chaser,
                            plant.motion.chaser_rate_rad_s});
        (*sink)->send(frame(**model, plant, static_cast<std::uint32_t>(k)));
        FrameLedger ledger;
        ledger.frame = static_cast<std::uint32_t>(5 * k);
        ledger.t_exposure_mid_ns = ledger.t_hand_over_ns = t_ns;
        send(ledger);
        hub->send(encode(Heartbeat{t_ns, RunState::lockstep}));
        EXPECT_TRUE(turn_until(*hub, [&] {
            listen(t_ns);
            return sent.commands.size() > static_cast<std::size_t>(k);
        }));
        if (sent.commands.size() != static_cast<std::size_t>(k + 1) ||
            sent.estimates.size() != static_cast<std::size_t>(k + 1))
            break;
        sent.errors_m.push_back(norm(sent.estimates.back().T_chaser_target.t - chaser_target(plant).t));
        plant.fly({sent.commands.back().impulse_n_s, sent.commands.back().angular_impulse_n_m_s}, 1);
    }
    send(DynamicsReport{static_cast<std::uint8_t>(cycles), cycles * s.period_ns(), 0, DynamicsPhase::finished});
    navigation.join();
    return sent;
}

TEST(NavigationNode, AnswersEachPeriodAndRepeatsItself) {
    const test::TemporaryFolder folder, other;
    const Sent one = fly(folder / "", 3);
    EXPECT_TRUE(one.ended) << one.ended.error().text();
    ASSERT_EQ(one.commands.size(), 3u);
    ASSERT_EQ(one.estimates.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_EQ(one.commands[k].t_ns, static_cast<std::int64_t>(k) * 1'000'000'000);
        EXPECT_EQ(one.estimates[k].t_ns, one.commands[k].t_ns);
        EXPECT_EQ(one.estimates[k].frames, 1);
        EXPECT_EQ(one.commands[k].phase, GuidancePhase::moving);
        EXPECT_LT(one.errors_m[k], 0.05);
    }
    EXPECT_TRUE(std::filesystem::exists(folder / "log/navigation.json"));
    std::ifstream csv(folder / "log/navigation.csv");
    EXPECT_EQ(std::count(std::istreambuf_iterator<char>(csv), {}, '\n'), 4);

    const Sent again = fly(other / "", 3);
    ASSERT_EQ(again.frames.size(), one.frames.size());
    for (std::size_t i = 0; i < one.frames.size(); ++i) EXPECT_TRUE(same(one.frames[i], again.frames[i])) << i;
}

/// How the navigation ends where the emulator leaves so after the first messages of a flight.
std::string end_after(bool lockstep, const std::function<void(std::unique_ptr<CanBus>&)>& leave) {
    const test::TemporaryFolder folder;
    const std::string fifo = folder / "nav.y4m";
    ::mkfifo(fifo.c_str(), 0600);
    auto hub = open_or_fail("slcan:0", CanRole::hub);
    NodeOptions options;
    options.bus = "slcan:" + std::to_string(hub_port(*hub));
    options.video = {{"nav", fifo}};
    options.lockstep = lockstep;
    options.silence_s = 0.5;
    const StopFlag stop{false};
    StopFlag ready{false};
    Status ended{Ok{}};
    std::thread navigation([&] { ended = navigate(by_camera_alone(), options, stop, [&] { ready = true; }); });
    ReceivedFrame received;
    EXPECT_TRUE(turn_until(*hub, [&] {
        static_cast<void>(hub->receive(received));
        return ready.load();
    }));
    const std::int64_t t_start_ns = lockstep ? 0 : kSecond_ns;
    hub->send(encode(Heartbeat{0, lockstep ? RunState::lockstep : RunState::running}));
    for (const CanFrame& f : encode_classic(DynamicsReport{0, t_start_ns, t_start_ns, DynamicsPhase::flying}))
        hub->send(f);
    for (const CanFrame& f : encode_classic(AttitudeReport{0, t_start_ns, {1, 0, 0, 0}, {}})) hub->send(f);
    static_cast<void>(hub->receive(received));  // what waits in the hub goes out
    leave(hub);
    navigation.join();
    EXPECT_FALSE(ended);
    return ended ? "no error" : ended.error().what;
}

TEST(NavigationNode, EndsWithTheEmulator) {
    const auto stops = [](RunState state) {
        return [state](std::unique_ptr<CanBus>& hub) { hub->send(encode(Heartbeat{1'000'000, state})); };
    };
    EXPECT_EQ(end_after(false, stops(RunState::running)), "no heartbeat of the emulator for 0.5 s");
    EXPECT_EQ(end_after(false, stops(RunState::stopping)),
              "the emulator has stopped before the dynamics reported the end");
    EXPECT_EQ(end_after(true, stops(RunState::stopping)),
              "the emulator has stopped, expected a heartbeat of 1.000 s");
    EXPECT_EQ(end_after(true, [](std::unique_ptr<CanBus>& hub) { hub.reset(); }),
              "the connection to the emulator was lost, expected a heartbeat of 1.000 s");
}

TEST(NavigationNode, NamesWhatIsWrongWithItsSources) {
    const StopFlag stop{false};
    NodeOptions options;
    options.bus = "slcan:1";
    options.wait_s = 0;
    const auto what = [&] {
        const Status ended = navigate(by_camera_alone(), options, stop, [] {});
        EXPECT_FALSE(ended);
        return ended ? std::string() : ended.error().what;
    };
    EXPECT_NE(what().find("0 sources for \"nav\""), std::string::npos) << what();
    options.video = {{"left", "x.y4m"}};
    EXPECT_NE(what().find("does not navigate by \"left\""), std::string::npos) << what();
}

TEST(NavigationProgram, EndsWithTheStatusOfWhatIsWrong) {
    const auto status = [](const std::string& arguments) {
        return narpa::test::run_command(test::build_path("bin/narpa-navigation ") + arguments + " 2>&1").status;
    };
    EXPECT_EQ(status("--help"), 0);
    EXPECT_EQ(status("none.toml --can slcan:1"), 2);
    EXPECT_EQ(status(kScenario), 2);
    EXPECT_EQ(status(kScenario + " --can slcan:1 --video nav"), 2);
    EXPECT_EQ(status(kScenario + " --can slcan:1 --video nav=/dev/video99 --lidar top=udp:0"), 3);
}

}  // namespace
}  // namespace narpa::rehearsal
