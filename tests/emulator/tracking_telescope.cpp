// A telescope on the ground follows a station in orbit, over the time of a run.
#include <gtest/gtest.h>

#include "emulator/camera/camera_unit.h"
#include "emulator/world.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

/// The station is a ball of 50 km: no Earth hides it, and it is some pixels wide anywhere on its orbit.
constexpr const char* kPass = R"([scene]
epoch = 2026-03-01T18:40:00Z
[observer]
latitude_deg = 51.4778
longitude_deg = -0.0014
sees = ["station"]
[[body]]
name = "station"
sphere = {radius_m = 50000}
material = {kind = "lambert", albedo = 0, emission = [1, 1, 1]}
orbit = {semi_major_axis_m = 6791000, inclination_deg = 51.6, ascending_node_deg = 20, mean_anomaly_deg = 80}
[[camera]]
name = "telescope"
resolution = [64, 64]
fov_horizontal_deg = 8
track = "station"
white_radiance = 1
)";

struct Disc {
    double x = 0, y = 0, light = 0;
};
Disc disc_in(const RadianceImage& image) {
    Disc d;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const auto light = static_cast<double>(image.pixels[i].y);
        d.x += light * static_cast<double>(i % 64), d.y += light * static_cast<double>(i / 64);
        d.light += light;
    }
    d.x /= d.light, d.y /= d.light;
    return d;
}

class TrackingTelescope : public LoopTest {};

TEST_F(TrackingTelescope, KeepsTheStationInTheMiddleOfItsImages) {
    auto world = World::create(scene(kPass));
    ASSERT_TRUE(world) << world.error().text();
    CameraUnit unit(**world, 0);
    Vec3 before{};
    for (const double t_s : {0.0, 20.0, 60.0}) {
        const auto t_ns = static_cast<std::int64_t>(1e9 * t_s);
        BodyPoses at(1);
        (*world)->place(t_ns, -1, at);
        const Rigid3 T = (*world)->camera_pose((*world)->scene().cameras[0], t_s, at);
        const Vec3 direction = normalized(at.T_world_body[0].t - T.t);
        EXPECT_LT(norm(cross(direction, T.q * Vec3{0, 0, 1})), 1e-9);
        EXPECT_GT(norm(direction - before), 0.01) << "the station has moved on";
        before = direction;
        unit.expose(0, t_ns);
        const Disc disc = disc_in(unit.radiance());
        ASSERT_GT(disc.light, 0) << t_s;
        EXPECT_NEAR(disc.x, 31.5, 0.3) << t_s;
        EXPECT_NEAR(disc.y, 31.5, 0.3) << t_s;
    }
}

}  // namespace
}  // namespace narpa::test
