// Each gate of the judge, passed and failed, on messages as they are on the bus.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/rehearsal/judge_support.h"

namespace narpa::rehearsal {
namespace {

using State = GateState;
constexpr double kRad = std::numbers::pi / 180;

/// Within every limit of the standard.
Motion good_contact(const Scenario& s) {
    return chaser_at(s, {0, 0.03, -0.04}, {-0.07, 0.01, 0.02}, {1 * kRad, 0.5 * kRad, -1 * kRad},
                     {0.05 * kRad, 0.02 * kRad, 0});
}

TEST(Judge, AGoodDockingPassesEveryGate) {
    Scenario s = small_scenario();
    s.gates.corridor = Gates::Corridor{10, 0.5, 20};
    s.gates.keep_out_m = 8;
    s.gates.navigation = Gates::NavigationError{};
    s.gates.contact = CaptureEnvelope{};
    const Verdict v = judge(s, docking(s, good_contact(s)));
    for (const GateResult& g : v.gates) EXPECT_EQ(g.state, State::passed) << g.name << ": " << g.reason;
    EXPECT_EQ(v.gates.size(), 6u);
    EXPECT_TRUE(v.passed);
    EXPECT_NE(v.headline.find("Docked after 10.0 s"), std::string::npos) << v.headline;
    EXPECT_EQ(v.poses, 12u);
    EXPECT_EQ(v.navigation.estimates, 10u);
    EXPECT_LT(v.navigation.nees, 0.01);  // errors of the wire's steps alone
}

TEST(Judge, ContactConditionsAreThoseOfTheTruthAtContact) {
    Scenario s = small_scenario();
    s.gates.contact = CaptureEnvelope{};
    const Verdict v = judge(s, docking(s, good_contact(s)));
    ASSERT_TRUE(v.contact);
    const auto value = [&](std::size_t i) { return v.contact->conditions[i].value; };
    EXPECT_NEAR(value(0), 0.07, 1e-4);
    EXPECT_NEAR(value(1), std::hypot(0.01, 0.02), 1e-4);
    EXPECT_NEAR(value(2), 0.05, 1e-5);
    EXPECT_NEAR(value(3), std::hypot(0.5, 1), 0.01);
    EXPECT_NEAR(value(4), 1, 0.01);
    EXPECT_NEAR(value(5), 0.02, 2e-3);
    EXPECT_NEAR(value(6), 0.05, 2e-3);
    EXPECT_NEAR(v.contact->t_s, 10, 1e-9);
}

TEST(Judge, EachContactConditionFailsByItself) {
    Scenario s = small_scenario();
    s.gates.contact = CaptureEnvelope{};
    const Vec3 v_good{-0.07, 0, 0};
    const std::vector<std::pair<std::string, Motion>> bad{
        {"closing rate 0.12", chaser_at(s, {}, {-0.12, 0, 0})},
        {"closing rate 0.03", chaser_at(s, {}, {-0.03, 0, 0})},
        {"lateral rate", chaser_at(s, {}, {-0.07, 0, 0.05})},
        {"lateral misalignment", chaser_at(s, {0, 0.11, 0}, v_good)},
        {"pitch and yaw 4.5", chaser_at(s, {}, v_good, {0, 0, 4.5 * kRad})},
        {"roll 4.5", chaser_at(s, {}, v_good, {4.5 * kRad, 0, 0})},
        {"pitch and yaw rate", chaser_at(s, {}, v_good, {}, {0, 0.25 * kRad, 0})},
        {"roll rate", chaser_at(s, {}, v_good, {}, {0.25 * kRad, 0, 0})},
    };
    for (const auto& [expected, motion] : bad) {
        const Verdict v = judge(s, docking(s, motion));
        EXPECT_EQ(gate(v, "contact").state, State::failed);
        EXPECT_TRUE(gate(v, "contact").reason.starts_with(expected)) << gate(v, "contact").reason;
        int beyond = 0;
        for (const ContactCondition& c : v.contact->conditions) beyond += !c.within();
        EXPECT_EQ(beyond, 1) << expected << ": " << gate(v, "contact").reason;
        EXPECT_LT(*gate(v, "contact").margin, 0);
    }
}

TEST(Judge, LimitsBelongToTheAllowedRange) {
    const PortState s{{T_port_docked().q, {0, 0.10, 0}}, {-0.05, 0, 0.04}, {}};
    for (const ContactCondition& c : contact_conditions(CaptureEnvelope{}, s)) EXPECT_TRUE(c.within()) << c.name;
}

TEST(Judge, ABounceIsNoDocking) {
    Scenario s = small_scenario();
    s.gates.contact = CaptureEnvelope{};
    const Verdict v = judge(s, docking(s, chaser_at(s, {}, {-0.3, 0, 0}), DynamicsPhase::bounced));
    EXPECT_EQ(gate(v, "contact").state, State::failed);
    EXPECT_TRUE(gate(v, "contact").reason.starts_with("closing rate 0.3")) << gate(v, "contact").reason;
    EXPECT_NE(full_reason(gate(v, "contact")).find("; bounced off at t = 10.00 s"), std::string::npos);
    EXPECT_EQ(gate(v, "complete").state, State::failed);
    EXPECT_EQ(gate(v, "duration").state, State::not_judged);
}

TEST(Judge, CorridorViolationsNameFirstWorstAndLeg) {
    Scenario s = small_scenario();
    s.gates.corridor = Gates::Corridor{10, 0.5, 20};
    std::vector<std::string> reported;
    const Verdict v = judge(s, docking(s, good_contact(s), DynamicsPhase::captured, 3),
                            [&](const GateResult& g) { reported.push_back(g.name); });
    const GateResult& g = gate(v, "corridor");
    EXPECT_EQ(g.state, State::failed);
    EXPECT_EQ(g.t_first_s, 5);
    EXPECT_NEAR(*g.margin, 0.5 + 5 * std::tan(10 * kRad) - 3, 1e-4);
    EXPECT_TRUE(g.reason.starts_with("3.000 m off the axis 5.00 m before the port, the corridor allows 1.38"))
        << g.reason;
    EXPECT_TRUE(g.reason.ends_with(" m at t = 5.00 s (leg 1 \"far\", moving)")) << g.reason;
    EXPECT_EQ(reported, std::vector<std::string>{"corridor"});
    // The same path, judged from 4 m on only.
    s.gates.corridor->from_m = 4;
    EXPECT_EQ(gate(judge(s, docking(s, good_contact(s), DynamicsPhase::captured, 3)), "corridor").state,
              State::passed);
}

TEST(Judge, TheCorridorIsNotJudgedFartherAway) {
    Scenario s = small_scenario();
    s.gates.corridor = Gates::Corridor{10, 0.5, 5};
    Messages m(s);
    m.period(0, chaser_at(s, {50, 0, 0}));
    EXPECT_EQ(gate(judge(s, m), "corridor").state, State::not_judged);
}

TEST(Judge, TheCorridorsWall) {
    const Gates::Corridor c{45, 1, 20};
    EXPECT_NEAR(corridor_clearance_m(c, {2, 0, 0}), 3, 1e-12);
    EXPECT_NEAR(corridor_clearance_m(c, {2, 0, -3.5}), -0.5, 1e-12);
    EXPECT_NEAR(corridor_clearance_m(c, {-0.6, 0.8, 0}), 0, 1e-12);
}

TEST(Judge, OnlyTheCorridorLeadsIntoTheKeepOutZone) {
    Scenario s = small_scenario();
    s.gates.keep_out_m = 6;
    EXPECT_EQ(gate(judge(s, docking(s, good_contact(s))), "keep_out").state, State::failed);
    s.gates.corridor = Gates::Corridor{10, 0.5, 1};
    EXPECT_EQ(gate(judge(s, docking(s, good_contact(s))), "keep_out").state, State::passed);
    const Verdict off = judge(s, docking(s, good_contact(s), DynamicsPhase::captured, 2));
    EXPECT_EQ(gate(off, "keep_out").t_first_s, 5);
}

TEST(Judge, DistancesHaveTwoLimits) {
    Scenario s = small_scenario();
    s.legs[1].contact = false;
    s.gates.distance_m = {4, 9};
    const auto flown = [&](double near_m, double far_m) {
        Messages m(s);
        m.period(0, chaser_at(s, {0, near_m, 0}));
        m.period(1, chaser_at(s, {0, 0, -far_m}), 1, GuidancePhase::done);
        m.report(2, DynamicsPhase::finished);
        return judge(s, m);
    };
    EXPECT_TRUE(flown(4.5, 8.5).passed);
    EXPECT_NEAR(*gate(flown(4.5, 8.7), "distance").margin, 0.3, 1e-5);
    EXPECT_EQ(gate(flown(3.5, 8.5), "distance").t_first_s, 0);
    EXPECT_EQ(gate(flown(4.5, 9.5), "distance").t_first_s, 1);
}

TEST(Judge, EstimatesAreJudgedByTheirStandardDeviations) {
    Scenario s = small_scenario();
    s.legs[1].contact = false;
    s.gates.navigation = Gates::NavigationError{.sigmas = 3, .share = 0.75, .position_m = 5, .attitude_deg = 3};
    const auto flown = [&](double wrong_m, double wrong_rad) {
        Messages m(s);
        const Motion chaser = chaser_at(s, {30, 1, 2}, {}, {0.1, 0.2, 0.3});
        for (int k = 0; k < 4; ++k) {
            m.poses(k, chaser);
            m.estimate(k, chaser, {0, k == 2 ? wrong_m : 0.1, 0}, {0, 0, k == 3 ? wrong_rad : 0});
        }
        m.command(4, GuidancePhase::done, 1);
        m.report(5, DynamicsPhase::finished);
        return judge(s, m);
    };
    const Verdict one = flown(0.5, 0);  // one of four is beyond: that is what is allowed
    EXPECT_EQ(gate(one, "navigation").state, State::passed) << gate(one, "navigation").reason;
    EXPECT_DOUBLE_EQ(one.navigation.share_within, 0.75);
    const auto says = [](const Verdict& v, const char* words) {
        return full_reason(gate(v, "navigation")).find(words) != std::string::npos;
    };
    EXPECT_EQ(gate(one, "navigation").reason,
              "75.00 % of 4 estimates are within 3 standard deviations, asked 75 %");
    for (const char* words : {"; nearest to the limit: position 0.500 m off (limit 5 m) at t = 2.00 s",
                              "; nearest to the limit: attitude 0.000 deg off (limit 3 deg)"})
        EXPECT_TRUE(says(one, words)) << words << ": " << full_reason(gate(one, "navigation"));
    EXPECT_NEAR(one.navigation.nees, (25 + 3 * 1) / 4.0, 0.01);
    const Verdict two = flown(0.5, 0.035);
    EXPECT_EQ(gate(two, "navigation").state, State::failed);
    EXPECT_NE(gate(two, "navigation").reason.find("50.00 % of 4 estimates"), std::string::npos);
    const Verdict far = flown(6, 0);
    EXPECT_EQ(gate(far, "navigation").state, State::failed);
    EXPECT_EQ(gate(far, "navigation").t_first_s, 2) << gate(far, "navigation").reason;
    EXPECT_TRUE(gate(far, "navigation").reason.starts_with("position 6.000 m off (limit 5 m) at t = 2.00 s"))
        << "the limit that was exceeded first: " << gate(far, "navigation").reason;
    EXPECT_TRUE(says(far, "; 75.00 % of 4 estimates")) << full_reason(gate(far, "navigation"));
    s.gates.navigation = Gates::NavigationError{.sigmas = 30, .share = 0};
    EXPECT_TRUE(says(flown(0.5, 0), "; largest position error 0.500 m")) << "there is no limit";
}

TEST(Judge, LargestErrorsCountFromTheFirstMeasurementOn) {
    Scenario s = small_scenario();
    s.legs[1].contact = false;
    s.gates.navigation = Gates::NavigationError{.sigmas = 4, .share = 0, .position_m = 0.5, .attitude_deg = 3};
    const auto flown = [&](int wrong) {
        Messages m(s);
        const Motion chaser = chaser_at(s, {30, 1, 2}, {}, {0.1, 0.2, 0.3});
        for (int k = 0; k < 4; ++k) {
            m.poses(k, chaser);
            const std::uint8_t taken = k == 1 ? 1 : 0;
            m.estimate(k, chaser, {0, k == wrong ? 2.0 : 0.0, 0}, {}, 1, 0.01, {}, taken);
        }
        m.command(4, GuidancePhase::done, 1);
        m.report(5, DynamicsPhase::finished);
        return judge(s, m);
    };
    const Verdict before = flown(0), after = flown(3);
    EXPECT_EQ(gate(before, "navigation").state, State::passed) << gate(before, "navigation").reason;
    EXPECT_LT(before.navigation.position_m.max, 1e-3);
    EXPECT_EQ(gate(after, "navigation").state, State::failed);
    EXPECT_EQ(gate(after, "navigation").t_first_s, 3);
}

TEST(Judge, WithoutEstimatesTheNavigationFails) {
    Scenario s = small_scenario();
    s.gates.navigation = Gates::NavigationError{};
    Messages m(s);
    m.report(0);
    m.poses(0, chaser_at(s, {9, 0, 0}));
    EXPECT_EQ(gate(judge(s, m), "navigation").reason, "no estimate was on the bus");
}

TEST(Judge, AnAbortFailsAtOnceUnlessItIsAllowed) {
    Scenario s = small_scenario();
    Messages m(s);
    m.period(0, chaser_at(s, {9, 0, 0}));
    m.command(1, GuidancePhase::retreating, 1, AbortReason::lost);
    std::vector<std::string> reported;
    const Verdict v = judge(s, m, [&](const GateResult& g) { reported.push_back(g.reason); });
    ASSERT_EQ(reported.size(), 1u);
    EXPECT_EQ(reported[0], "the navigation gave up at t = 1.00 s in leg 2 \"last\": lost");
    EXPECT_FALSE(v.passed);
    s.gates.complete = false;
    m.report(2, DynamicsPhase::finished);
    EXPECT_TRUE(judge(s, m).passed);
}

TEST(Judge, ARunThatBreaksOffAfterItHasDockedIsNotComplete) {
    const Scenario s = small_scenario();
    const Motion docked = chaser_at(s, {0, 0, 0}, {-0.05, 0, 0});
    Messages m(s);
    m.period(0, docked, 1);
    m.report(1, DynamicsPhase::captured);
    m.poses(1, docked);
    const Verdict v = judge(s, m);
    EXPECT_FALSE(v.passed);
    EXPECT_EQ(gate(v, "complete").state, State::failed);
    EXPECT_EQ(gate(v, "duration").state, State::passed);
}

TEST(Judge, ATimeOutIsReported) {
    Scenario s = small_scenario();
    Messages m(s);
    m.period(0, chaser_at(s, {9, 0, 0}));
    m.report(100, DynamicsPhase::finished);
    const Verdict v = judge(s, m);
    EXPECT_EQ(gate(v, "duration").state, State::failed);
    EXPECT_EQ(gate(v, "complete").state, State::failed);
}

}  // namespace
}  // namespace narpa::rehearsal
