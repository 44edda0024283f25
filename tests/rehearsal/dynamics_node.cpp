// The dynamics on a bus with a scripted navigation that uses the truth.
#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "base/constants.h"
#include "drivers/can/buses.h"
#include "protocols/can/messages.h"
#include "rehearsal/dynamics/node.h"
#include "tests/drivers/can_support.h"
#include "tests/rehearsal/dynamics_support.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

constexpr std::int64_t kMs = 1'000'000;

/// The other side of the bus: records messages and plays the emulator and the navigation.
class Partner {
public:
    explicit Partner(CanBus& bus, const Scenario& scenario) : bus_(bus), scenario_(scenario) {}

    struct Pose {
        std::uint32_t base_id;
        PoseCommand command;
    };
    std::vector<CanFrame> frames;
    std::vector<DynamicsReport> reports;
    std::vector<AttitudeReport> attitudes;
    std::vector<Pose> poses;
    std::function<void(std::int64_t t_ns)> on_period;  ///< after all messages of a control period

    std::function<void()> on_turn;  ///< now and then

    void listen() {
        for (ReceivedFrame received; bus_.receive(received);) take(received.frame);
        if (on_turn) on_turn();
        bus_.wait(10 * kMs);
    }
    /// What was sent before the dynamics ended may still be on its way.
    void listen_until_quiet() {
        for (int quiet_turns = 0; quiet_turns < 5; ++quiet_turns) {
            const std::size_t before = frames.size();
            listen();
            if (frames.size() > before) quiet_turns = 0;
        }
    }
    void beat(std::int64_t t_ns, RunState state) { bus_.send(encode(Heartbeat{t_ns, state})); }
    /// A clock in real time, which shows this at first.
    void run_clock(std::int64_t from_ns) {
        on_turn = [this, from_ns, begun = std::chrono::steady_clock::now()] {
            const std::chrono::nanoseconds since = std::chrono::steady_clock::now() - begun;
            beat(from_ns + since.count(), RunState::running);
        };
    }
    void command(const ActuatorCommand& c) {
        for (const CanFrame& f : encode(c, bus_.carries_fd())) bus_.send(f);
    }

    /// Where the ports are by the newest pose commands.
    [[nodiscard]] PortState port() const {
        Motion target, chaser;
        for (const Pose& p : poses) (p.base_id == scenario_.target.can_id ? target : chaser) = p.command.motion;
        return port_state(scenario_.target, target, scenario_.chaser, chaser);
    }

    /// Of the chaser by the pose command of this time; -1: there is none.
    [[nodiscard]] double speed_m_s(std::int64_t t_ns) const {
        for (const Pose& p : poses)
            if (p.base_id == scenario_.chaser.can_id && p.command.t_valid_ns == t_ns)
                return norm(p.command.motion.velocity_m_s);
        return -1;
    }

private:
    void take(const CanFrame& frame) {
        frames.push_back(frame);
        DynamicsReport report;
        if (reports_.accept(frame, t_ns_, report) == DecodeStatus::complete) reports.push_back(report);
        AttitudeReport attitude;
        if (attitudes_.accept(frame, t_ns_, attitude) == DecodeStatus::complete) attitudes.push_back(attitude);
        PoseCommand pose;
        if (target_.accept(frame, t_ns_, pose) == DecodeStatus::complete) add(scenario_.target.can_id, pose);
        if (chaser_.accept(frame, t_ns_, pose) == DecodeStatus::complete) add(scenario_.chaser.can_id, pose);
    }
    void add(std::uint32_t id, const PoseCommand& pose) {
        poses.push_back({id, pose});
        t_ns_ = pose.t_valid_ns;
        if (id != scenario_.chaser.can_id || attitudes.empty() || attitudes.back().t_ns != pose.t_valid_ns) return;
        if (on_period) on_period(pose.t_valid_ns);
        if (reports.back().phase == DynamicsPhase::finished) beat(pose.t_valid_ns, RunState::lockstep);
    }

    CanBus& bus_;
    const Scenario& scenario_;
    MessageDecoder<DynamicsReport> reports_;
    MessageDecoder<AttitudeReport> attitudes_;
    PoseDecoder target_{scenario_.target.can_id}, chaser_{scenario_.chaser.can_id};
    std::int64_t t_ns_ = 0;
};

/// The dynamics in a thread of their own, as a client of the bus.
Result<nlohmann::json> fly(const Scenario& scenario, const DynamicsOptions& options, const std::string& bus_name,
                           Partner& partner) {
    Result<nlohmann::json> flown = Error{"not flown"};
    std::atomic<bool> done{false};
    std::thread dynamics([&] {
        const StopFlag stop{false};
        if (const auto bus = open_or_fail(bus_name, CanRole::client))
            flown = run_dynamics(scenario, options, *bus, stop);
        done = true;
    });
    while (!done) partner.listen();
    dynamics.join();
    partner.listen_until_quiet();
    return flown;
}

struct Flown {
    Result<nlohmann::json> document = Error{"not flown"};
    std::vector<CanFrame> frames;
    std::vector<DynamicsReport> reports;
    std::vector<AttitudeReport> attitudes;
    std::vector<Partner::Pose> poses;
    PortState port_at_end;
};

/// `steer`: the command for a control period, where the ports are so.
Flown fly_in_lockstep(const Scenario& scenario, const DynamicsOptions& options, CanBus& hub, const std::string& bus,
                      const std::function<ActuatorCommand(const PortState&)>& steer) {
    Partner partner(hub, scenario);
    partner.on_period = [&](std::int64_t t_ns) {
        ActuatorCommand c = steer(partner.port());
        c.t_ns = t_ns;
        partner.command(c);
    };
    Flown flown;
    flown.document = fly(scenario, options, bus, partner);
    flown.port_at_end = partner.port();
    flown.frames = std::move(partner.frames);
    flown.reports = std::move(partner.reports);
    flown.attitudes = std::move(partner.attitudes);
    flown.poses = std::move(partner.poses);
    return flown;
}
ActuatorCommand rest(const PortState&) {
    return {};
}

/// Holds the port at (12, 0, 0): the chaser's body axes are its port's, half a turn from the target's.
ActuatorCommand hold(const PortState& p) {
    const Vec3 off = p.position_m() - Vec3{12, 0, 0};
    const Vec3 impulse = -10'000.0 * (0.01 * off + 0.25 * p.velocity_m_s);
    const Vec3 turn = 0.05 * p.misalignment_rad() + 0.4 * p.rate_rad_s;
    ActuatorCommand c;
    c.impulse_n_s = {-impulse.x, -impulse.y, impulse.z};
    c.angular_impulse_n_m_s = {-15e3 * turn.x, -31e3 * turn.y, -30e3 * turn.z};
    c.phase = GuidancePhase::holding;
    return c;
}

Scenario dispersed() {
    Scenario s = quiet(orbit_model("two-body"));
    s.orbit.along = {0, 0, 1}, s.orbit.up = {0, 1, 0};
    s.target_motion = {true, {}};
    s.duration_s = 60;
    s.pose_rate_hz = 5;
    s.start.position_m = {12, 0, 0};
    s.start.position_sigma_m = {0.3, 0.3, 0.3};
    s.start.velocity_sigma_m_s = {0.02, 0.02, 0.02};
    s.start.attitude_sigma_deg = {1, 1, 1};
    s.start.rate_sigma_deg_s = {0.02, 0.02, 0.02};
    s.thrusters = {};
    s.attitude_sensor = {};
    return s;
}

DynamicsOptions lockstep(std::uint64_t seed = 1) {
    DynamicsOptions o;
    o.lockstep = true;
    o.seed = seed;
    o.patience_s = 20;
    return o;
}

class DynamicsOnSlcan : public testing::Test {
protected:
    std::unique_ptr<CanBus> hub = open_or_fail("slcan:0", CanRole::hub);
    std::string bus = "slcan:" + std::to_string(hub_port(*hub));
};

std::vector<std::uint8_t> bytes_of(const std::vector<CanFrame>& frames) {
    std::vector<std::uint8_t> bytes;
    for (const CanFrame& f : frames) {
        bytes.push_back(static_cast<std::uint8_t>(f.id)), bytes.push_back(static_cast<std::uint8_t>(f.id >> 8));
        bytes.insert(bytes.end(), f.data.begin(), f.data.begin() + f.size);
    }
    return bytes;
}

TEST_F(DynamicsOnSlcan, ANavigationWithTheTruthHoldsItsStation) {
    const Flown flown = fly_in_lockstep(dispersed(), lockstep(), *hub, bus, hold);
    ASSERT_TRUE(flown.document) << flown.document.error().text();
    EXPECT_EQ((*flown.document)["ending"], "duration");
    EXPECT_EQ((*flown.document)["actuator_commands"]["applied"], 60);
    expect_near(flown.port_at_end.position_m(), {12, 0, 0}, 0.1);
    expect_near(flown.port_at_end.velocity_m_s, {}, 0.02);
    EXPECT_LT(norm(flown.port_at_end.misalignment_rad()) / kRadPerDeg, 0.5);
}

TEST_F(DynamicsOnSlcan, TheSameSeedGivesTheSameBytes) {
    Scenario s = dispersed();
    s.duration_s = 10;
    const Flown a = fly_in_lockstep(s, lockstep(3), *hub, bus, hold),
                b = fly_in_lockstep(s, lockstep(3), *hub, bus, hold);
    const Flown other = fly_in_lockstep(s, lockstep(4), *hub, bus, hold);
    EXPECT_GT(a.frames.size(), 1000u);
    EXPECT_EQ(bytes_of(a.frames), bytes_of(b.frames));
    EXPECT_EQ(*a.document, *b.document);
    EXPECT_NE(bytes_of(a.frames), bytes_of(other.frames));
}

TEST_F(DynamicsOnSlcan, EachPeriodSendsReportThenAttitudeThenPosesChaserLast) {
    Scenario s = quiet(orbit_model("two-body"));
    s.attractor = {"earth", 0x120};
    s.duration_s = 2;
    s.pose_rate_hz = 2;
    const Flown flown = fly_in_lockstep(s, lockstep(), *hub, bus, rest);
    ASSERT_TRUE(flown.document) << flown.document.error().text();
    std::vector<std::uint32_t> order;
    for (const CanFrame& f : flown.frames)
        if (order.empty() || order.back() != (f.id & ~0xFu)) order.push_back(f.id & ~0xFu);
    const std::vector<std::uint32_t> period{kDynamicsBaseId, kAttitudeBaseId, 0x120, 0x110, 0x100};
    const std::vector<std::uint32_t> between{0x120, 0x110, 0x100};
    std::vector<std::uint32_t> expected;
    for (const auto* part : {&period, &between, &period, &between, &period})
        expected.insert(expected.end(), part->begin(), part->end());
    EXPECT_EQ(order, expected);

    ASSERT_EQ(flown.reports.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_EQ(flown.reports[k].t_ns, ns(static_cast<double>(k)));
        EXPECT_EQ(flown.reports[k].t_start_ns, 0);
        EXPECT_EQ(flown.reports[k].counter, k);
        EXPECT_EQ(flown.attitudes[k].t_ns, flown.reports[k].t_ns);
    }
    EXPECT_EQ(flown.reports[2].phase, DynamicsPhase::finished);
    ASSERT_EQ(flown.poses.size(), 10u);
    for (std::size_t i = 0; i < 10; ++i)
        EXPECT_EQ(flown.poses[i].command.t_valid_ns, ns(0.5 * static_cast<double>(i / 2)));
}

TEST_F(DynamicsOnSlcan, ContactIsReportedAtItsInstantWithThePosesOfThatInstant) {
    Scenario s = quiet();
    s.start.position_m = {0.1, 0, 0};
    s.start.velocity_m_s = {-0.0713, 0, 0};
    const Flown flown = fly_in_lockstep(s, lockstep(), *hub, bus, rest);
    ASSERT_TRUE(flown.document) << flown.document.error().text();
    const std::int64_t contact_ns = ns(0.1 / 0.0713);
    const auto reported = std::find_if(flown.reports.begin(), flown.reports.end(),
                                       [](const DynamicsReport& r) { return r.phase == DynamicsPhase::captured; });
    ASSERT_NE(reported, flown.reports.end());
    EXPECT_NEAR(static_cast<double>(reported->t_ns - contact_ns), 0, 2);
    const auto pose = std::find_if(flown.poses.begin(), flown.poses.end(), [&](const Partner::Pose& p) {
        return p.base_id == s.chaser.can_id && p.command.t_valid_ns == reported->t_ns;
    });
    ASSERT_NE(pose, flown.poses.end());
    // The chaser's x axis is the world's -x: it still comes at its speed.
    expect_near(pose->command.motion.velocity_m_s, {-0.0713, 0, 0}, 2e-5);
    // A whole period that is 2 s after it.
    EXPECT_EQ(flown.reports.back().phase, DynamicsPhase::finished);
    EXPECT_EQ(flown.reports.back().t_ns, ns(4));
    EXPECT_EQ((*flown.document)["ending"], "captured");
}

TEST_F(DynamicsOnSlcan, CommandsOfAnotherTimeOrTwiceAreRefusedAndCounted) {
    Scenario s = quiet();
    s.duration_s = 3;
    Partner partner(*hub, s);
    partner.on_period = [&](std::int64_t t_ns) {
        ActuatorCommand c;
        c.impulse_n_s = {100, 0, 0};
        c.t_ns = t_ns + 1;
        partner.command(c);
        c.t_ns = t_ns;
        partner.command(c);
        ++c.counter;
        c.impulse_n_s = {200, 0, 0};
        partner.command(c);
    };
    const auto flown = fly(s, lockstep(), bus, partner);
    ASSERT_TRUE(flown) << flown.error().text();
    EXPECT_EQ((*flown)["actuator_commands"]["applied"], 3);
    EXPECT_GE((*flown)["actuator_commands"]["refused"], 3);
    EXPECT_NEAR((*flown)["impulse_n_s"][0].get<double>(), 300, 1e-9);
}

TEST_F(DynamicsOnSlcan, MissingMessagesAreAnErrorThatNamesThem) {
    const Scenario s = quiet();
    Partner silent(*hub, s);
    DynamicsOptions o = lockstep();
    o.patience_s = 0.2;
    auto flown = fly(s, o, bus, silent);
    ASSERT_FALSE(flown);
    EXPECT_EQ(flown.error().kind, ErrorKind::failed);
    EXPECT_EQ(flown.error().what, "no actuator command for 0.000 s in 0.2 s");

    Partner stops(*hub, s);
    stops.on_period = [&](std::int64_t t_ns) { stops.beat(t_ns, RunState::stopping); };
    flown = fly(s, lockstep(), bus, stops);
    ASSERT_FALSE(flown);
    EXPECT_EQ(flown.error().what, "no actuator command for 0.000 s: the emulator has stopped");

    o.lockstep = false;
    o.wait_s = 0.2;
    flown = fly(s, o, bus, silent);
    ASSERT_FALSE(flown);
    EXPECT_EQ(flown.error().what, "no heartbeat in 0.2 s: is `narpa run` there?");
}

TEST_F(DynamicsOnSlcan, LogsTheTruth) {
    const test::TemporaryFolder folder;
    Scenario s = quiet();
    s.duration_s = 2;
    s.start.velocity_m_s = {-0.5, 0, 0};
    DynamicsOptions o = lockstep();
    o.log_folder = folder / "dynamics";
    const Flown flown = fly_in_lockstep(s, o, *hub, bus, [](const PortState&) {
        ActuatorCommand c;
        c.impulse_n_s = {0, 100, 0};
        c.leg = 2;
        return c;
    });
    ASSERT_TRUE(flown.document) << flown.document.error().text();
    std::ifstream file(o.log_folder + "/truth.csv");
    std::string line;
    std::vector<std::string> lines;
    while (std::getline(file, line)) lines.push_back(line);
    ASSERT_EQ(lines.size(), 1 + 2 * 20 + 1u);
    EXPECT_EQ(lines[0].substr(0, 16), "t_s,x_m,y_m,z_m,");
    EXPECT_EQ(lines[1].substr(0, 15), "0.000000000,60,");
    EXPECT_EQ(lines[2].substr(0, 19), "0.050000000,59.975,");
    EXPECT_NE(lines[2].find(",flying,moving,2,none,0,20,0,0,0,0"), std::string::npos) << lines[2];
}

TEST_F(DynamicsOnSlcan, InRealTimePosesFollowTheEmulatorsClockFromAWholeSecondOn) {
    Scenario s = quiet();
    s.duration_s = 600;
    s.navigation.period_s = 0.2;
    s.pose_rate_hz = 50;
    Partner partner(*hub, s);
    partner.run_clock(3'400 * kMs);
    // Ends the flight once it has sent enough: on a slow machine a command may be too late to be applied.
    int too_old = 0;
    partner.on_period = [&](std::int64_t t_ns) {
        ActuatorCommand c;
        c.t_ns = t_ns - ns(60);
        partner.command(c);
        c.t_ns = t_ns;
        c.impulse_n_s = {0, 10, 0};
        if (++too_old >= 3) c.phase = GuidancePhase::done;
        partner.command(c);
    };
    const auto flown = fly(s, {}, bus, partner);
    ASSERT_TRUE(flown) << flown.error().text();
    EXPECT_EQ((*flown)["ending"], "navigation_done");
    const std::int64_t start_ns = partner.reports.front().t_start_ns;
    EXPECT_EQ(start_ns % ns(1), 0);
    EXPECT_GE(start_ns, ns(4));
    EXPECT_EQ(partner.poses.size() % 20, 2u);  // of two bodies ten times a period, and at the end
    EXPECT_GE(partner.poses.size(), 3 * 20u);
    for (std::size_t i = 0; i < partner.poses.size(); ++i)
        EXPECT_EQ(partner.poses[i].command.t_valid_ns, start_ns + static_cast<std::int64_t>(i / 2) * 20 * kMs);
    EXPECT_EQ(partner.reports.back().phase, DynamicsPhase::finished);
    EXPECT_GE((*flown)["actuator_commands"]["applied"], 1);
    EXPECT_GE((*flown)["actuator_commands"]["refused"], 3);
}

TEST_F(DynamicsOnSlcan, InRealTimeACommandActsFromItsTimeOn) {
    Scenario s = quiet();
    s.duration_s = 600;
    s.navigation.period_s = 1;
    s.pose_rate_hz = 10;
    Partner partner(*hub, s);
    partner.run_clock(0);
    // Sent 850 ms early: a pulse of half a second from between two poses on.
    int periods = 0;
    std::int64_t sent_ns = 0;
    partner.on_period = [&](std::int64_t t_ns) {
        ActuatorCommand c;
        c.t_ns = t_ns + (periods == 0 ? 850 * kMs : 0);
        if (periods == 0) sent_ns = t_ns, c.impulse_n_s = {0, 0.5 * s.thrusters.force_n, 0};
        if (++periods >= 3) c.phase = GuidancePhase::done;
        if (periods != 2) partner.command(c);
    };
    const auto flown = fly(s, {}, bus, partner);
    ASSERT_TRUE(flown) << flown.error().text();
    const auto speed_m_s = [&](std::int64_t after_ms) { return partner.speed_m_s(sent_ns + after_ms * kMs); };
    const double still = speed_m_s(0), full = s.thrusters.force_n / s.chaser.mass_kg;
    EXPECT_NEAR(speed_m_s(800), still, 1e-4) << "long after it has come";
    EXPECT_NEAR(std::abs(speed_m_s(900) - still), 0.05 * full, 1e-4);
    EXPECT_NEAR(std::abs(speed_m_s(1200) - still), 0.35 * full, 1e-4);
    EXPECT_NEAR(std::abs(speed_m_s(1600) - still), 0.5 * full, 1e-4);
}

TEST_F(DynamicsOnSlcan, InRealTimeAllCommandsThatComeEarlyAct) {
    Scenario s = quiet();
    s.duration_s = 600;
    s.navigation.period_s = 1;
    s.pose_rate_hz = 10;
    Partner partner(*hub, s);
    partner.run_clock(0);
    // Both sent at once: a pulse from 750 ms on, ended 200 ms later by a command without one.
    int periods = 0;
    std::int64_t sent_ns = 0;
    partner.on_period = [&](std::int64_t t_ns) {
        ActuatorCommand c;
        if (periods++ > 0) {
            c.t_ns = t_ns;
            c.phase = GuidancePhase::done;
            partner.command(c);
            return;
        }
        sent_ns = c.t_ns = t_ns;
        c.t_ns += 750 * kMs;
        c.impulse_n_s = {0, 0.8 * s.thrusters.force_n, 0};
        partner.command(c);
        c.t_ns += 200 * kMs;
        c.impulse_n_s = {};
        partner.command(c);
    };
    const auto flown = fly(s, {}, bus, partner);
    ASSERT_TRUE(flown) << flown.error().text();
    const double still = partner.speed_m_s(sent_ns), after = partner.speed_m_s(sent_ns + 1'000 * kMs);
    EXPECT_NEAR(std::abs(after - still), 0.2 * s.thrusters.force_n / s.chaser.mass_kg, 1e-4);
    EXPECT_EQ((*flown)["actuator_commands"]["refused"], 0);
}

TEST_F(DynamicsOnSlcan, InRealTimeTheyEndWithoutHeartbeats) {
    const Scenario s = quiet();
    Partner partner(*hub, s);
    partner.run_clock(0);
    partner.on_period = [&](std::int64_t) { partner.on_turn = nullptr; };
    DynamicsOptions options;
    options.silence_s = 0.5;
    const auto flown = fly(s, options, bus, partner);
    ASSERT_FALSE(flown);
    EXPECT_NE(flown.error().what.find("no heartbeat of the emulator for 0.5 s"), std::string::npos)
        << flown.error().text();
    EXPECT_EQ(flown.error().kind, ErrorKind::failed);
}

TEST_F(DynamicsOnSlcan, InLockstepTheyEndWithTheConnection) {
    const Scenario s = quiet();
    Result<nlohmann::json> flown = Error{"not flown"};
    std::thread dynamics([&] {
        const StopFlag stop{false};
        if (const auto client = open_or_fail(bus, CanRole::client))
            flown = run_dynamics(s, lockstep(), *client, stop);
    });
    Partner partner(*hub, s);
    while (partner.poses.empty()) partner.listen();
    hub.reset();
    dynamics.join();
    ASSERT_FALSE(flown);
    EXPECT_NE(flown.error().what.find("the connection to the emulator was lost"), std::string::npos)
        << flown.error().text();
}

TEST(DynamicsOnUdp, TheSameRunInCanFd) {
    const std::string bus = "udp:" + own_group();
    const auto hub = open_or_fail(bus, CanRole::hub);
    const auto slcan = open_or_fail("slcan:0", CanRole::hub);
    Scenario s = dispersed();
    s.duration_s = 5;
    const Flown fd = fly_in_lockstep(s, lockstep(), *hub, bus, rest);
    const Flown classic = fly_in_lockstep(s, lockstep(), *slcan, "slcan:" + std::to_string(hub_port(*slcan)), rest);
    ASSERT_TRUE(fd.document) << fd.document.error().text();
    EXPECT_TRUE(fd.frames.front().fd);
    EXPECT_EQ(fd.frames.size(), 6 + 6 + 2 * 26u);  // reports, attitudes, poses
    ASSERT_EQ(fd.poses.size(), classic.poses.size());
    for (std::size_t i = 0; i < fd.poses.size(); ++i)
        EXPECT_EQ(fd.poses[i].command.motion.T_world_body, classic.poses[i].command.motion.T_world_body);
}

const std::string kProgram = test::build_path("bin/narpa-dynamics ");

TEST(DynamicsProgram, UsesTheCommonExitStatuses) {
    const std::string scenario = test::build_path("scenes/rehearsal/docking.toml");
    const auto status = [](const std::string& arguments) {
        return test::run_command(kProgram + arguments + " 2>&1");
    };
    EXPECT_EQ(status("--help").status, 0);
    EXPECT_EQ(status("").status, 2);
    const test::Done lost = status("none.toml --can slcan:1");
    EXPECT_EQ(lost.status, 2);
    EXPECT_TRUE(lost.out.starts_with("narpa-dynamics: none.toml: no such file, expected a scenario file"))
        << lost.out;
    EXPECT_EQ(status(scenario + " --can slcan:1 --wait 0").status, 3);
    EXPECT_EQ(status(scenario + " --can slcan:1 --wait 0 --seed -1").status, 2);
    EXPECT_EQ(status(scenario + " --can slcan:1 --wait nan").status, 2);
}

}  // namespace
}  // namespace narpa::rehearsal
