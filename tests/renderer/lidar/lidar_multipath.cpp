// Light that a LiDAR sees by way of two diffuse surfaces, against closed forms and quadratures.
#include <gtest/gtest.h>

#include <cmath>

#include "protocols/lidar/pattern_lidar.h"
#include "renderer/lidar/lidar_receiver.h"
#include "renderer/light/render_scene.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
using Multipath = LidarReceiverModel::Multipath;

const LidarField kAllAround{LidarField::Kind::angles, kPi, kPi / 2};
constexpr double kLongPulse_m = 1e3;  ///< all light is one echo

/// The LiDAR's y axis along the world's z.
const Quat kAlongZ = exp_rotation({kPi / 2, 0, 0});

/// A LiDAR at the origin with its boresight along z; a pulse lights `lit`.
class LitScene {
public:
    explicit LitScene(const LidarField& lit, double albedo = 0.5) {
        scene.materials.push_back(lambert(static_cast<float>(albedo)));
        const auto make = make_of(std::make_shared<LidarPattern>(LidarPattern{.name = "flash",
                                                                              .rate_hz_min = 10,
                                                                              .rate_hz_max = 10,
                                                                              .rate_hz_default = 10,
                                                                              .range_m_default = 1e5,
                                                                              .shots = {{}},
                                                                              .lit = lit}));
        EXPECT_TRUE(make);
        lidar.model = make->configure_default();
        lidar.T_mount_lidar.q = kAlongZ;
        lidar.range_max_m = 1e5;
        lidar.receiver.multipath = Multipath::diffuse;
    }
    /// A plate of this material that faces `normal`, in the plane of two axes.
    int add_plate(double width_m, double height_m, const Quat& q, const Vec3& centre, std::uint16_t material = 0) {
        Mesh mesh = plate(width_m, height_m);
        mesh.face_material.assign(mesh.faces.size(), material);
        return add_mesh(scene, mesh, {q, centre});
    }
    /// Where and as it was, on a body that is turned.
    void mount_on_a_turned_body() {
        lidar.mount = add_sphere(scene, 1e-3, {0, 0, -0.1});
        Rigid3& T_world_body = scene.bodies.back().initial.T_world_body;
        T_world_body.q = exp_rotation({0.4, -1.1, 0.7});
        lidar.T_mount_lidar = inverse(T_world_body) * Rigid3{kAlongZ, {}};
    }
    [[nodiscard]] std::vector<LidarEchoes> shoot(const Vec3& direction, std::size_t n, std::size_t batch = kLanes,
                                                 std::uint64_t seed = 1) const {
        const auto render_scene = RenderScene::create(scene, 1);
        EXPECT_TRUE(render_scene);
        LidarReceiver receiver(render_scene->tracer(), lidar, seed, 0);
        std::vector<LidarEchoes> out(n);
        for (std::size_t first = 0; first < n; first += batch) {
            RayBatch beams;
            for (; beams.n < std::min(batch, n - first); ++beams.n) beams.put(beams.n, {{}, normalized(direction)});
            receiver.receive(placed(scene), beams, first, motions, std::span(out).subspan(first));
        }
        return out;
    }

    Scene scene;
    Lidar lidar;
    std::vector<Motion> motions;
};

/// Over shots: of the light, and of light times range. With standard errors of the means.
struct SeenLight {
    double light = 0, moment = 0, light_error = 0, moment_error = 0;
};
SeenLight mean_light(const std::vector<LidarEchoes>& shots) {
    SeenLight mean, square;
    const auto n = static_cast<double>(shots.size());
    for (const LidarEchoes& e : shots) {
        const double r = e.strongest.range_m, light = static_cast<double>(e.strongest.reflectivity) / (r * r);
        mean.light += light / n, square.light += light * light / n;
        mean.moment += light * r / n, square.moment += light * r * light * r / n;
    }
    mean.light_error = std::sqrt(std::max(0.0, square.light - mean.light * mean.light) / n);
    mean.moment_error = std::sqrt(std::max(0.0, square.moment - mean.moment * mean.moment) / n);
    return mean;
}

/// In the middle of a hollow sphere of radius R, whose parts light each other evenly: a field of the solid angle W
/// that a pulse lights brings rho W / (4 pi) of the direct light to each of its points. From a full sphere all of
/// what was absorbed of the direct light comes back with rho, and by way of chords of 4/3 R in the mean.
TEST(LidarMultipath, InsideOfASphereKeepsTheEnergy) {
    for (const double albedo : {0.3, 1.0})
        for (const double half : {0.0, 0.5, 2.0}) {
            LitScene inside(half > 0 ? LidarField{LidarField::Kind::plane, half, 0.5 * half} : kAllAround, albedo);
            const double solid_angle =
                half > 0 ? 4 * std::atan(half * 0.5 * half / std::sqrt(1 + 1.25 * half * half)) : 4 * kPi;
            add_sphere(inside.scene, 10, {});
            inside.lidar.receiver.pulse_length_m = kLongPulse_m;
            const SeenLight seen = mean_light(inside.shoot({0.1, 0.05, 1}, half > 0 ? 8000 : 500));
            const double direct = albedo / 100, share = albedo * solid_angle / (4 * kPi);
            EXPECT_NEAR(seen.light, direct * (1 + share), 4 * seen.light_error + 1e-6 * direct) << half;
            EXPECT_LT(seen.light_error, 0.01 * direct * share);
            if (half > 0) continue;
            EXPECT_NEAR(seen.moment, direct * (10 + share * (10 + 2.0 / 3 * 10)), 4 * seen.moment_error) << albedo;
        }
}

/// The LiDAR 10 m from a wall, and another wall at right angles to it, whose corner is at x = -2.
class Corner : public LitScene {
public:
    explicit Corner(const LidarField& lit) : LitScene(lit, kWall) {
        scene.materials.push_back(lambert(kSide));
        add_plate(2 * kWide, 2 * kHigh, exp_rotation({0, kPi, 0}), {kCorner + kWide, 0, kRange});
        add_plate(kDeep, 2 * kHigh, exp_rotation({0, kPi / 2, 0}), {kCorner, 0, kRange - 0.5 * kDeep}, 1);
    }
    /// What the point of the wall in this direction sends back, directly and by way of the side that is lit.
    [[nodiscard]] SeenLight expected(const Vec3& direction) const {
        const Vec3 b = kRange / direction.z * direction;
        const double r_b = norm(b);
        SeenLight light;
        light.light = static_cast<double>(kWall) * (kRange / r_b) / (r_b * r_b);
        light.moment = light.light * r_b;
        constexpr int kCells = 1200;
        const double dz = kDeep / kCells, dy = 2 * kHigh / kCells;
        for (int i = 0; i < kCells; ++i)
            for (int j = 0; j < kCells; ++j) {
                const Vec3 a{kCorner, (j + 0.5) * dy - kHigh, kRange - (i + 0.5) * dz};
                if (!lidar.model->spec().lit.contains(conjugate(kAlongZ) * normalized(a))) continue;
                const double r_a = norm(a), d = norm(a - b);
                const double cos_lit = -a.x / r_a, cos_a = (b.x - a.x) / d, cos_b = (b.z - a.z) / d;
                const double share = static_cast<double>(kWall * kSide) / kPi * cos_lit * cos_a * cos_b /
                                     (d * d * r_a * r_a) * dy * dz;
                light.light += share;
                light.moment += share * 0.5 * (r_a + d + r_b);
            }
        return light;
    }

    static constexpr float kWall = 0.4f, kSide = 0.8f;
    static constexpr double kCorner = -2, kRange = 10, kDeep = 6, kWide = 3, kHigh = 2;
};

TEST(LidarMultipath, InACornerIsTheQuadrature) {
    for (const LidarField& lit : {kAllAround, LidarField{LidarField::Kind::plane, 0.25, 0.1}})
        for (const Vec3& direction : {Vec3{-0.19, 0, 1}, Vec3{-0.1, 0.05, 1}, Vec3{0.2, 0, 1}})
            for (const int sub_rays : {1, 16}) {
                Corner corner(lit);
                corner.lidar.receiver.pulse_length_m = kLongPulse_m;
                if (sub_rays > 1) corner.mount_on_a_turned_body();
                corner.lidar.receiver.sub_rays = sub_rays;
                corner.lidar.receiver.beam_divergence_rad = sub_rays > 1 ? 1e-4 : 0;
                const SeenLight seen = mean_light(corner.shoot(direction, 4000)),
                                expected = corner.expected(direction);
                EXPECT_NEAR(seen.light, expected.light, 4 * seen.light_error + 2e-6) << direction.x;
                EXPECT_NEAR(seen.moment, expected.moment, 4 * seen.moment_error + 2e-5) << direction.x;
                const double bias_m = seen.moment / seen.light - expected.moment / expected.light;
                EXPECT_LT(std::abs(bias_m), 2e-3) << direction.x;
            }
}

TEST(LidarMultipath, OnlyAddsWhereItIsAskedFor) {
    Corner corner(kAllAround);
    for (const Multipath kind : {Multipath::none, Multipath::mirrors}) {
        corner.lidar.receiver.multipath = kind;
        for (const LidarEchoes& e : corner.shoot({-0.19, 0, 1}, 20))
            EXPECT_NEAR(e.strongest.range_m, 10 * norm(Vec3{-0.19, 0, 1}), 1e-9);
    }
}

/// A black plate before the side wall keeps the pulse from it, and its light from the other.
TEST(LidarMultipath, NothingComesOfWhatIsInShadow) {
    Corner corner(kAllAround);
    corner.scene.materials.push_back(lambert(0));
    corner.add_plate(6.999, 5, exp_rotation({0, kPi / 2, 0}), {-1.99, 0, 6.5}, 2);
    for (const LidarEchoes& e : corner.shoot({-0.1, 0, 1}, 200))
        EXPECT_NEAR(e.strongest.range_m, 10 * norm(Vec3{-0.1, 0, 1}), 1e-9);
}

/// The field of a scanner's receiver is its own beam: beside a wall it sees no light that comes by way of it.
TEST(LidarMultipath, OfANarrowBeamIsFromWithinTheBeam) {
    Corner corner({});
    corner.lidar.receiver.beam_divergence_rad = 3e-3;
    corner.lidar.receiver.sub_rays = 32;
    for (const LidarEchoes& e : corner.shoot({-0.19, 0, 1}, 500))
        EXPECT_NEAR(e.strongest.reflectivity, 0.4 / norm(Vec3{-0.19, 0, 1}), 1e-5);
    // With the corner itself in the beam the light grows, and the range by less than the beam is wide.
    const std::vector<LidarEchoes> with = corner.shoot({-0.2, 0, 1}, 2000);
    corner.lidar.receiver.multipath = Multipath::none;
    const SeenLight direct = mean_light(corner.shoot({-0.2, 0, 1}, 2000)), seen = mean_light(with);
    EXPECT_GT(seen.light, 1.02 * direct.light);
    EXPECT_LT(seen.light, 1.5 * direct.light);
    EXPECT_GT(seen.moment / seen.light, direct.moment / direct.light);
    EXPECT_LT(seen.moment / seen.light, direct.moment / direct.light + 0.03);
}

/// A wall 4 m behind the LiDAR, lit too: more than a pulse later than the wall before it.
TEST(LidarMultipath, LightThatIsLaterThanAPulseIsAnEchoOfItsOwn) {
    LitScene room(kAllAround);
    room.add_plate(4, 4, exp_rotation({0, kPi, 0}), {0, 0, 5});
    room.add_plate(4, 4, {}, {0, 0, -4});
    room.lidar.receiver.pulse_length_m = 0.6;
    const double min_m = 0.5 * (5 + 9 + 4), max_m = min_m + 1.5;
    std::size_t late = 0;
    for (const LidarEchoes& e : room.shoot({0, 0, 1}, 500)) {
        EXPECT_NEAR(e.strongest.range_m, 5, 1e-9);
        if (e.second.range_m == 0) continue;
        ++late;
        EXPECT_GT(e.second.range_m, min_m);
        EXPECT_LT(e.second.range_m, max_m);
        EXPECT_EQ(e.last.range_m, e.second.range_m);
    }
    EXPECT_GT(late, 400u);
}

/// Half the rate of the way's length: of a small plate behind the LiDAR, of the wall and of the LiDAR itself.
TEST(LidarMultipath, ItsVelocityIsHalfTheRateOfTheWay) {
    LitScene room(kAllAround);
    room.add_plate(4, 4, exp_rotation({0, kPi, 0}), {0, 0, 5});
    room.add_plate(0.2, 0.2, {}, {3, 0, -4});
    add_sphere(room.scene, 1e-3, {0, 0, -0.1});
    room.lidar.mount = 2;
    room.lidar.T_mount_lidar.t = {0, 0, 0.1};
    room.motions = {{.velocity_m_s = {2, 1, 3}}, {.velocity_m_s = {-1, 0.5, 4}}, {.velocity_m_s = {0.3, -2, 1}}};
    const Vec3 lidar{}, b{0, 0, 5}, a{3, 0, -4};
    const double rate =
        0.5 * (dot(normalized(b - lidar), Vec3{1.7, 3, 2}) + dot(normalized(a - b), Vec3{-3, -0.5, 1}) +
               dot(normalized(lidar - a), Vec3{1.3, -2.5, -3}));
    std::size_t late = 0;
    for (const LidarEchoes& e : room.shoot({0, 0, 1}, 4000)) {
        EXPECT_NEAR(e.strongest.velocity_m_s, 2, 1e-9);
        if (e.second.range_m == 0) continue;
        ++late;
        EXPECT_NEAR(e.second.range_m, 0.5 * (norm(b) + norm(a - b) + norm(a)), 0.15);
        EXPECT_NEAR(e.second.velocity_m_s, rate, 0.1);
    }
    EXPECT_GT(late, 5u);
}

TEST(LidarMultipath, DrawsDependOnSeedAndShotAlone) {
    const Corner corner(kAllAround);
    const auto once = corner.shoot({-0.15, 0, 1}, 100), again = corner.shoot({-0.15, 0, 1}, 37, 5),
               other = corner.shoot({-0.15, 0, 1}, 37, 5, 2);
    for (std::size_t i = 0; i < again.size(); ++i) {
        EXPECT_EQ(once[i].strongest.range_m, again[i].strongest.range_m);
        EXPECT_NE(once[i].strongest.range_m, other[i].strongest.range_m);
    }
}

}  // namespace
}  // namespace narpa
