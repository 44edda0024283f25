// The judge and the bus: runs that break off, logs read afterwards, other orders, times between commands; numbers.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "protocols/can/candump.h"
#include "rehearsal/report/run_report.h"
#include "rehearsal/report/template.h"
#include "tests/rehearsal/judge_support.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

Scenario with_all_gates() {
    Scenario s = small_scenario();
    s.gates.corridor = Gates::Corridor{};
    s.gates.keep_out_m = 5;
    s.gates.navigation = Gates::NavigationError{};
    s.gates.contact = CaptureEnvelope{};
    return s;
}

TEST(JudgeBus, ALogGivesTheSameVerdict) {
    const Scenario s = with_all_gates();
    Messages m = docking(s, chaser_at(s, {}, {-0.2, 0, 0}), DynamicsPhase::captured, 4);
    m.ledger(0, 1, 1.02);
    const Verdict live = judge(s, m);
    const test::TemporaryFolder folder;
    const std::string path = folder / "can.log";
    std::ofstream file(path);
    for (const CanFrame& f : m.frames) {
        std::array<char, kCandumpMaxLine> line;
        file.write(line.data(), static_cast<std::streamsize>(format_candump({m.ns(3), f}, "narpa", line)));
    }
    file.close();
    Judge logged(s);
    ASSERT_TRUE(accept_log(logged, path));
    EXPECT_EQ(to_json(logged.finish()).dump(), to_json(live).dump());
    EXPECT_FALSE(accept_log(logged, folder / "none.log"));
}

/// The hub passes a client's frames on before it answers them; its own log has them in another order.
TEST(JudgeBus, TheOrderOfDifferentSendersDoesNotMatter) {
    const Scenario s = with_all_gates();
    const Messages m = docking(s, chaser_at(s, {}, {-0.2, 0, 0}), DynamicsPhase::captured, 4);
    Messages other = m;
    std::stable_partition(other.frames.begin(), other.frames.end(),
                          [](const CanFrame& f) { return f.id >= kTelemetryBaseId && f.id < kDynamicsBaseId; });
    EXPECT_EQ(to_json(judge(s, other)).dump(), to_json(judge(s, m)).dump());
}

TEST(JudgeBus, NamesTheMissingSender) {
    const Scenario s = small_scenario();
    const auto reason = [&](const std::function<void(Messages&)>& last) {
        Messages m(s);
        m.period(0, chaser_at(s, {9, 0, 0}));
        last(m);
        const Verdict v = judge(s, m);
        EXPECT_EQ(gate(v, "complete").state, GateState::failed);
        return full_reason(gate(v, "complete"));
    };
    EXPECT_NE(reason([&](Messages& m) {
                  m.report(1);
                  m.poses(1, chaser_at(s, {8, 0, 0}));
              })
                  .find("broke off: the emulator stopped sending; last received: poses at t = 1.000 s, heartbeat "
                        "at t = 0.000 s"),
              std::string::npos);
    EXPECT_NE(reason([&](Messages& m) {
                  m.report(1);
                  m.poses(1, chaser_at(s, {8, 0, 0}));
                  m.heartbeat(1);
              }).find("the navigation stopped sending"),
              std::string::npos);
    EXPECT_NE(reason([&](Messages& m) {
                  m.period(1, chaser_at(s, {8, 0, 0}));
              }).find("the dynamics stopped sending"),
              std::string::npos);
    EXPECT_NE(gate(judge(s, Messages(s)), "complete").reason.find("the emulator sent nothing"), std::string::npos);
}

TEST(JudgeBus, BetweenCommandsTheTruthIsInterpolated) {
    Scenario s = small_scenario();
    s.gates.navigation = Gates::NavigationError{};
    Messages m(s);
    const auto at = [&](double t) { return chaser_at(s, {20 - t + 0.05 * t * t, 0, 0}, {-1 + 0.1 * t, 0, 0}); };
    m.poses(0, at(0));
    m.estimate(0.3, at(0.3), {0.2, 0, 0});
    EXPECT_EQ(judge(s, m).navigation.unjudged, 1u);
    m.poses(1, at(1));
    const Verdict v = judge(s, m);
    EXPECT_EQ(v.navigation.estimates, 1u);
    EXPECT_NEAR(v.navigation.position_m.max, 0.2, 1e-4);
}

TEST(JudgeBus, PortAxesRotateWithTheTarget) {
    const Scenario s = small_scenario();
    const Vec3 rate{0, 0, 0.1};
    // Rigidly joined, docked: nothing moves against the port whatever both turn.
    const Motion target{{exp_rotation({0.3, -0.2, 0.9}), {1, 2, 3}}, {0.4, 0.5, 0.6}, rate};
    const Rigid3 T = target.T_world_body * s.target.T_body_port * T_port_docked() * inverse(s.chaser.T_body_port);
    const Vec3 world_rate = target.T_world_body.q * rate;
    const Motion chaser{T, target.velocity_m_s + cross(world_rate, T.t - target.T_world_body.t),
                        conjugate(T.q) * world_rate};
    const PortState state = port_state(s.target, target, s.chaser, chaser);
    EXPECT_NEAR(norm(state.position_m()) + norm(state.velocity_m_s) + norm(state.misalignment_rad()) +
                    norm(state.rate_rad_s),
                0, 1e-12);
}

TEST(JudgeBus, LatencyIsFromTheCommandToTheHandOver) {
    const Scenario s = small_scenario();
    Messages m(s);
    for (std::uint32_t k = 0; k < 100; ++k) m.ledger(k, k * 0.1, k * 0.1 + 0.001 * (k + 1), k != 7);
    const Verdict v = judge(s, m);
    EXPECT_EQ(v.ledger.frames, 100u);
    EXPECT_EQ(v.ledger.deadlines_met, 99u);
    EXPECT_NEAR(v.ledger.latency_ms.p50, 50, 1e-6);
    EXPECT_NEAR(v.ledger.latency_ms.p99, 99, 1e-6);
    EXPECT_NEAR(v.ledger.latency_ms.max, 100, 1e-6);
}

TEST(Statistics, TheIntervalOfClopperAndPearson) {
    // Tables: 95 of 100, 0 of 10, 10 of 10 (R's binom.test).
    const auto [low, high] = success_interval(95, 100);
    EXPECT_NEAR(low, 0.8871651, 1e-6);
    EXPECT_NEAR(high, 0.9835681, 1e-6);
    EXPECT_EQ(success_interval(0, 10).first, 0);
    EXPECT_NEAR(success_interval(0, 10).second, 0.3084971, 1e-6);
    EXPECT_NEAR(success_interval(10, 10).first, 0.6915029, 1e-6);
    EXPECT_EQ(success_interval(10, 10).second, 1);
}

TEST(Statistics, PercentilesAreValuesThatOccur) {
    const Distribution d = distribution({5, 1, 4, 2, 3});
    EXPECT_EQ(d.p50, 3);
    EXPECT_EQ(d.p90, 5);
    EXPECT_EQ(d.min, 1);
    EXPECT_DOUBLE_EQ(d.mean, 3);
    EXPECT_NEAR(d.sigma, std::sqrt(2.5), 1e-12);
    EXPECT_EQ(distribution({}).count, 0u);
}

TEST(Junit, NamesFailuresAndEscapesText) {
    Scenario s = with_all_gates();
    s.legs[0].name = "<far & \"away\">";
    const Verdict v = judge(s, docking(s, chaser_at(s, {}, {-0.2, 0, 0}), DynamicsPhase::captured, 4));
    const std::string xml = junit(v, "a<b", 1.5);
    EXPECT_NE(xml.find("name=\"a&lt;b\" tests=\"6\""), std::string::npos) << xml;
    EXPECT_NE(xml.find("&lt;far &amp; &quot;away&quot;&gt;"), std::string::npos) << xml;
    EXPECT_EQ(escape("a\x01'"), "a\xEF\xBF\xBD&#39;");
}

}  // namespace
}  // namespace narpa::rehearsal
