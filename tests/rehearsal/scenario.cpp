// Scenario files, and what follows from them.
#include "rehearsal/scenario/scenario.h"

#include <gtest/gtest.h>

namespace narpa::rehearsal {
namespace {

TEST(Orbit, LvlhTurnsAboutTheMomentumWithTheOrbit) {
    Orbit orbit;
    const double quarter_s = 0.5 * 3.14159265358979323846 / orbit.rate_rad_s();
    const Vec3 up = orbit.q_world_lvlh(quarter_s) * Vec3{1, 0, 0};
    EXPECT_NEAR(norm(up - orbit.along), 0, 1e-12);
}

}  // namespace
}  // namespace narpa::rehearsal
