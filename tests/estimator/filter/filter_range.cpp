// Ranges along beams to a plane of the target, and the fall to ground that turns.
#include <gtest/gtest.h>

#include "tests/estimator/filter/filter_flight.h"

namespace narpa {
namespace {

using namespace test;

/// Of the beam to the plane that the state places there.
double range_of(const RelativeState& s, const BeamRange& m) {
    const Vec3 n = s.q_frame_target * m.normal, u = m.q_frame_chaser * m.direction;
    return dot(n, s.position_m + s.q_frame_target * m.point_m - m.q_frame_chaser * m.origin_m) / dot(n, u);
}

TEST(FilterRange, CorrectsEachComponentThatTheRangeDependsOn) {
    std::mt19937_64 random(3);
    const auto vector = [&](double size) { return size * Vec3{normal(random), normal(random), normal(random)}; };
    int corrected = 0;
    for (int k = 0; k < 50; ++k) {
        const RelativeState state{vector(100), vector(1), exp_rotation(vector(2)), {}};
        BeamRange m{.origin_m = vector(1),
                    .direction = normalized(vector(1)),
                    .point_m = vector(20),
                    .normal = normalized(vector(1)),
                    .sigma_m = 1e-9,
                    .q_frame_chaser = exp_rotation(vector(2))};
        for (const int i : {0, 1, 2, 6, 7, 8}) {
            Vector12 off = Vector12::Zero();
            off[i] = 1e-5;
            const RelativeState truth = displaced(state, off);
            m.range_m = range_of(truth, m);
            const double change_m = std::abs(m.range_m - range_of(state, m));
            if (change_m < 1e-6 || change_m > 1e-2) continue;  // hardly seen, or along the plane
            Matrix12 P = 1e-24 * Matrix12::Identity();
            P(i, i) = 1e-8;
            auto filter = *PoseFilter::create({}, 0, state, P);
            ASSERT_EQ(filter.update(m).outcome, UpdateOutcome::taken);
            EXPECT_NEAR(error_between(filter.state(), truth)[i], 0, 1e-8) << k << " " << i;
            ++corrected;
        }
    }
    EXPECT_GT(corrected, 150);
}

TEST(FilterRange, RefusesInvalidBeams) {
    auto filter = *PoseFilter::create({}, 0, {}, Matrix12::Identity());
    BeamRange m{.direction = {0, 0, 1}, .point_m = {0, 0, 5}, .normal = {0, 0, -1}, .range_m = 5, .sigma_m = 0.1};
    EXPECT_EQ(filter.update(m).outcome, UpdateOutcome::taken);
    for (const auto& spoil : {+[](BeamRange& r) { r.sigma_m = 0; },
                              +[](BeamRange& r) {
                                  r.normal = {0, 0, 2};
                              },
                              +[](BeamRange& r) { r.range_m = NAN; }, +[](BeamRange& r) { r.direction = {}; }}) {
        BeamRange bad = m;
        spoil(bad);
        EXPECT_EQ(filter.update(bad).outcome, UpdateOutcome::bad);
    }
    m.range_m = 500;
    EXPECT_EQ(filter.update(m).outcome, UpdateOutcome::gated);
}

TEST(FilterMotion, TheChaserFallsToTheGroundThatTurns) {
    MotionModel model;
    model.orbit_rate_rad_s = 1e-3;
    model.ground = GroundField{{-3, 0, 0}, Eigen::Matrix3d::Zero()};
    RelativeState state{{-100, 0, 0}, {}, {}, {0, 0, 1e-3}};  // the chaser 100 m above
    Matrix12 P = Matrix12::Identity();
    propagate(model, 2, {}, state, P);
    EXPECT_NEAR(state.position_m.x, -94, 1e-4);
    EXPECT_NEAR(state.velocity_m_s.x, 6, 1e-4);
    EXPECT_NEAR(state.velocity_m_s.y, -2 * 1e-3 * 6, 1e-4);         // Coriolis: -2 w x v
    EXPECT_LT(norm(rotation_vector(state.q_frame_target)), 1e-12);  // it turns with the frame
    model.ground->gravity_m_s2.y = NAN;
    EXPECT_FALSE(check(model));
}

}  // namespace
}  // namespace narpa
