#include "renderer/geometry/poses_at.h"

#include <gtest/gtest.h>

namespace narpa {
namespace {

/// Turns whose series has one term, and more; signs that differ; a body at rest.
TEST(PosesAt, AreThoseOfEachMoment) {
    const Rigid3 start{normalized(Quat{0.3, -0.5, 0.7, 0.1}), {7e6, -3, 0.1}};
    Lanes<double> time;
    for (std::size_t i = 0; i < kLanes; ++i) time[i] = static_cast<double>(i) / (kLanes - 1);
    BodyPoses at(1);
    for (const double angle : {0.0, 1e-9, 1e-4, 1.9e-3, 2.1e-3, 0.4, 3.0})
        for (const double sign : {1.0, -1.0}) {
            const Quat q = start.q * exp_rotation({0, angle * 0.6, angle * 0.8});
            at.set(0, start, {sign < 0 ? -q : q, start.t + angle * Vec3{1, 2, 3}});
            PoseLanes poses;
            Vec3Lanes positions;
            poses_at(at, 0, time, poses);
            positions_at(at, 0, time, positions);
            for (std::size_t i = 0; i < kLanes; ++i) {
                EXPECT_EQ(poses[i], at.T_world_body_at(0, time[i])) << angle << " at " << time[i];
                EXPECT_EQ(positions[i], at.position_at(0, time[i]));
            }
            const PosePath path(at.path(0).start(), at.path(0).end());
            poses_at(path, time, poses);
            for (std::size_t i = 0; i < kLanes; ++i) EXPECT_EQ(poses[i], path.at(time[i]));
        }
}

}  // namespace
}  // namespace narpa
