// The gates of a landing: at their limits, and what happens without one.
#include <gtest/gtest.h>

#include <cmath>

#include "estimator/pose/pose_estimate.h"
#include "tests/rehearsal/judge_support.h"
#include "tests/support/paths.h"

namespace narpa::rehearsal {
namespace {

/// On the ground of the shipped scene; the site is clear and nearly flat.
Scenario to_land() {
    auto read = read_scenario(test::build_path("scenes/rehearsal/landing.toml"));
    EXPECT_TRUE(read) << read.error().text();
    Scenario s = *std::move(read);
    s.gates = {};
    s.gates.landing = LandingLimits{};
    return s;
}

/// Comes down from 10 m, touches so, and rests where it touched.
Messages landing(const Scenario& s, const Motion& touching, const Motion& resting,
                 DynamicsPhase outcome = DynamicsPhase::landed) {
    Messages m(s);
    for (int k = 0; k < 10; ++k) m.period(k, chaser_at(s, {10.0 - k, 0, 0}, {-1, 0, 0}), 1);
    m.report(10, DynamicsPhase::touched_down);
    m.poses(10, touching);
    m.heartbeat(10);
    m.command(10, GuidancePhase::landed, 1);
    m.report(12, outcome);
    m.poses(12, resting);
    m.report(13, DynamicsPhase::finished);
    m.poses(13, resting);
    m.heartbeat(13);
    return m;
}

TEST(LandingGates, ASoftLandingAtTheSitePasses) {
    const Scenario s = to_land();
    const Verdict v = judge(s, landing(s, chaser_at(s, {0.02, 1, 2}, {-1, 0.1, 0}), chaser_at(s, {0, 1, 2})));
    EXPECT_TRUE(v.passed) << v.headline;
    EXPECT_EQ(v.headline, "Landed after 12.0 s, all gates passed");
    ASSERT_EQ(v.contact->conditions.size(), 7u);
    EXPECT_NEAR(v.contact->conditions[0].value, 1, 1e-5);
    EXPECT_NEAR(v.contact->conditions[1].value, 0.1, 1e-5);
    EXPECT_NEAR(v.contact->conditions[4].value, std::sqrt(5.0), 1e-5);
    EXPECT_LT(v.contact->conditions[5].value, 5);
    EXPECT_GE(v.contact->conditions[6].value, 0);
}

TEST(LandingGates, EachConditionFailsAtItsOwnGate) {
    const Scenario s = to_land();
    const double deg = kDegree;
    struct Case {
        const char* gate;
        Vec3 position, velocity, rotation, rate;
    };
    for (const Case& c : {Case{"vertical_velocity", {0, 0, 0}, {-1.6, 0, 0}, {}, {}},
                          {"horizontal_velocity", {0, 0, 0}, {-1, 0.4, 0.4}, {}, {}},
                          {"tilt", {0, 0, 0}, {-1, 0, 0}, {0, 6 * deg, 0}, {}},
                          {"rate", {0, 0, 0}, {-1, 0, 0}, {}, {4 * deg, 0, 0}},
                          {"site", {0, 0, 10.5}, {-1, 0, 0}, {}, {}}}) {
        const Motion touching = chaser_at(s, c.position, c.velocity, c.rotation, c.rate);
        std::vector<std::string> reported;
        const Verdict v = judge(s, landing(s, touching, chaser_at(s, c.position)),
                                [&](const GateResult& g) { reported.push_back(g.name); });
        for (const GateResult& g : v.gates) {
            if (g.name == "slope" || g.name == "step") continue;
            EXPECT_EQ(g.state == GateState::failed, g.name == c.gate)
                << c.gate << ": " << g.name << " " << g.reason;
        }
        EXPECT_EQ(reported, std::vector<std::string>{c.gate});
        EXPECT_LT(gate(v, c.gate).margin.value(), 0);
    }
}

TEST(LandingGates, TheGroundUnderTheFeetIsJudgedWhereItRests) {
    Scenario s = to_land();
    s.gates.landing->slope_deg = 0;
    s.gates.landing->step_m = 1e-4;
    const Verdict v = judge(s, landing(s, chaser_at(s, {0, 0, 0}, {-1, 0, 0}), chaser_at(s, {0, 0, 0})));
    EXPECT_EQ(gate(v, "slope").state, GateState::failed);
    EXPECT_EQ(gate(v, "step").state, GateState::failed);
    EXPECT_FALSE(v.passed);
}

TEST(LandingGates, ACrashIsNoLanding) {
    const Scenario s = to_land();
    const Motion touching = chaser_at(s, {0, 0, 0}, {-5, 0, 0});
    const Verdict v = judge(s, landing(s, touching, chaser_at(s, {0, 0, 0}), DynamicsPhase::crashed));
    EXPECT_FALSE(v.passed);
    EXPECT_EQ(gate(v, "vertical_velocity").state, GateState::failed);
    EXPECT_EQ(gate(v, "complete").state, GateState::failed);
    EXPECT_NE(gate(v, "complete").reason.find("it crashed"), std::string::npos) << gate(v, "complete").reason;
    EXPECT_FALSE(v.contact->captured);
}

TEST(LandingGates, WithoutATouchdownTheyAreNotJudgedAndTheRunIsNotComplete) {
    const Scenario s = to_land();
    Messages m(s);
    for (int k = 0; k < 3; ++k) m.period(k, chaser_at(s, {10.0 - k, 0, 0}, {-1, 0, 0}), 1);
    m.report(3, DynamicsPhase::finished);
    m.poses(3, chaser_at(s, {7, 0, 0}));
    const Verdict v = judge(s, m);
    EXPECT_FALSE(v.passed);
    for (const char* name : {"vertical_velocity", "horizontal_velocity", "tilt", "rate", "site", "slope", "step"})
        EXPECT_EQ(gate(v, name).state, GateState::not_judged) << name;
    EXPECT_EQ(gate(v, "complete").state, GateState::failed);
}

TEST(LandingGates, EstimatesAfterTheTouchdownAreNotJudged) {
    Scenario s = to_land();
    s.gates.navigation = Gates::NavigationError{};
    Messages m = landing(s, chaser_at(s, {0, 0, 0}, {-1, 0, 0}), chaser_at(s, {0, 0, 0}));
    const Verdict before = judge(s, m);
    m.estimate(12.5, chaser_at(s, {0, 0, 0}), {9, 9, 9});
    const Verdict after = judge(s, m);
    EXPECT_EQ(gate(after, "navigation").state, GateState::passed);
    EXPECT_EQ(after.navigation.estimates, before.navigation.estimates);
}

}  // namespace
}  // namespace narpa::rehearsal
