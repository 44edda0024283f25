// A flat wall scanned by a LiDAR that moves and turns, read from its packets: with the pose at each shot's own time
// the wall is flat to the noise, with one pose for all shots it is bent by what the motion says.
#include <fmt/format.h>

#include <cmath>

#include "base/constants.h"
#include "emulator/lidar/lidar_unit.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

constexpr double kWallRange_m = 20, kWallNoise_m = 0.02;
constexpr Vec3 kSensorVelocity_m_s{2.4, 4, -1.8};  // 5 m/s, most of it towards the wall
constexpr double kSensorRate_rad_s = 10 * kRadPerDeg;
const Vec3 kSensorAxis = normalized(Vec3{0.6, -0.2, 0.77});

class SweepMotion : public LoopTest {
protected:
    std::unique_ptr<World> world(const std::string& keys) {
        std::ofstream(folder_ / "wall.obj")
            << "v -200 0 -200\nv 200 0 -200\nv 200 0 200\nv -200 0 200\nf 1 2 3 4\n";
        const Vec3 rate = kSensorRate_rad_s * kSensorAxis;
        auto made = World::create(scene(fmt::format(
            "sun.direction = [0, -1, 0]\n[[body]]\nname = \"wall\"\nmesh = \"wall.obj\"\nposition_m = [0, {}, 0]\n"
            "[[body]]\nname = \"craft\"\nsphere = {{radius_m = 1e-6}}\nposition_m = [0, -0.2, 0]\n"
            "velocity_m_s = [{}, {}, {}]\nrate_rad_s = [{}, {}, {}]\n"
            "[[lidar]]\nname = \"eye\"\nmount = \"craft\"\nposition_m = [0.3, 0.2, 0.1]\n{}",
            kWallRange_m, kSensorVelocity_m_s.x, kSensorVelocity_m_s.y, kSensorVelocity_m_s.z, rate.x, rate.y,
            rate.z, keys)));
        EXPECT_TRUE(made) << made.error().text();
        return *std::move(made);
    }
};

struct WallDistance {
    double sum = 0;
    int n = 0;
    void add(double x) { sum += x * x, ++n; }
    [[nodiscard]] double value() const { return std::sqrt(sum / n); }
};

TEST_F(SweepMotion, AWallIsFlatWhereEachShotHasItsOwnPoseAndBentByTheMotionWithout) {
    for (const std::string make : {"VLP-16", "HDL-32E"}) {
        SCOPED_TRACE(make);
        const auto w = world(fmt::format("model = \"{}\"\nrate_hz = 10\nrange_noise_m = {}\n", make, kWallNoise_m));
        LidarUnit unit(*w, 0);
        const LidarModel& model = *unit.lidar().model;
        std::vector<LidarPoint> points(unit.spec().points_per_packet);
        BodyPoses at(2);
        const auto pose = [&](std::int64_t t_ns) {
            w->place(t_ns, -1, at);
            return w->sensor_pose(unit.lidar().mount, unit.lidar().T_mount_lidar, at);
        };
        // A turn about the time at which the beams point at the wall.
        const std::int64_t middle_ns = 100'000'000, from_ns = 50'000'000, to_ns = 150'000'000;
        const Rigid3 T_middle = pose(middle_ns);
        const Vec3 velocity =
            kSensorVelocity_m_s + cross(kSensorRate_rad_s * kSensorAxis, T_middle.t - Vec3{0.24, 0.2, -0.18});
        WallDistance own, bent, expected, left;
        double farthest = 0;
        for (std::int64_t p = unit.first_packet_from(from_ns); unit.packet_start_ns(p) < to_ns; ++p) {
            unit.fire(p);
            const std::size_t n = model.points(unit.bytes(), points);
            for (const LidarPoint& point : std::span(points).first(n)) {
                const std::int64_t t_ns = unit.packet_start_ns(p) + point.t_offset_ns;
                const Rigid3 T = pose(t_ns);
                const Vec3 in_lidar = point.origin_m + point.range_m * point.direction;
                // Across the wall, in metres of range: of beams within 45 degrees of its normal, where an azimuth
                // of whole 0.01 degrees counts as 1.4 mm.
                const double cosine = (T.q * point.direction).y;
                if (cosine < std::cos(45 * kRadPerDeg)) continue;
                const double off_m = ((T * in_lidar).y - kWallRange_m) / cosine;
                const double skewed_m = ((T_middle * in_lidar).y - kWallRange_m) / cosine;
                const double after_s = 1e-9 * static_cast<double>(t_ns - middle_ns);
                const Vec3 lever = T_middle.q * in_lidar;
                const double theory_m =
                    -after_s * (velocity + cross(kSensorRate_rad_s * kSensorAxis, lever)).y / cosine;
                own.add(off_m);
                bent.add(skewed_m);
                expected.add(theory_m);
                left.add(skewed_m - theory_m);
                farthest = std::max(farthest, std::abs(off_m));
            }
        }
        EXPECT_GT(own.n, 6000);
        const double noise_m = std::hypot(kWallNoise_m, unit.spec().range_resolution_m / std::sqrt(12.0));
        const double chance = 4 / std::sqrt(2.0 * own.n);
        EXPECT_NEAR(own.value(), noise_m, (0.01 + chance) * noise_m) << "flat to the noise";
        EXPECT_LT(farthest, 5.5 * kWallNoise_m);
        EXPECT_GT(expected.value(), 2 * kWallNoise_m);
        EXPECT_NEAR(bent.value(), std::hypot(expected.value(), noise_m), 0.02 * bent.value());
        EXPECT_NEAR(left.value(), noise_m, (0.01 + chance) * noise_m)
            << "bent by what the motion says, nothing else";
        RecordProperty(make + " flat mm", std::to_string(1e3 * own.value()));
        RecordProperty(make + " bent mm", std::to_string(1e3 * bent.value()));
        RecordProperty(make + " theory mm", std::to_string(1e3 * expected.value()));
    }
}

}  // namespace
}  // namespace narpa::test
