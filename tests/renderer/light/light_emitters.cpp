// What emitters send to a surface, against the closed forms of radiometry.
#include "base/constants.h"
#include "renderer/light/lights.h"
#include "tests/renderer/integrator/path_support.h"

namespace narpa {
namespace {

using namespace test;
const PathSettings kDirectLight{.max_depth = 1};

Light lamp(Light::Kind kind, const Rigid3& T, const Rgb& emission) {
    Light l;
    l.name = "lamp";
    l.kind = kind;
    l.T_mount_light = T;
    l.emission = emission;
    return l;
}
/// A pose at `eye` whose +z looks at `target`.
Rigid3 shining_at(const Vec3& eye, const Vec3& target) {
    return looking(eye, target, {0.3, 0.9, 0.1});
}
/// A white floor about the origin, facing +z.
Scene floor_scene() {
    Scene s;
    s.materials.push_back(lambert(1));
    add_mesh(s, plate(4, 4));
    return s;
}
/// Irradiance on the floor at (x, y), from the radiance that the white floor sends up.
Estimate irradiance_at(const Scene& s, double x, double y, std::uint32_t samples,
                       const PathSettings& settings = kDirectLight) {
    Estimate e = light_along(s, ray_to({x + 0.01, y + 0.02, 0.05}, {x, y, 0}), settings, samples);
    e.mean = kPi * e.mean;
    e.error *= kPi;
    return e;
}

// Lambert's formula for a polygon of even radiance 1 wholly above the horizon: half the sum over its edges of the
// angle that each subtends, times the cosine between the normal and that of the plane through the edge.
double polygon_irradiance(const std::vector<Vec3>& corners, const Vec3& p, const Vec3& n) {
    double sum = 0;
    for (std::size_t k = 0; k < corners.size(); ++k) {
        const Vec3 a = normalized(corners[k] - p), b = normalized(corners[(k + 1) % corners.size()] - p);
        const Vec3 axis = cross(a, b);
        sum += std::atan2(norm(axis), dot(a, b)) * dot(normalized(axis), n);
    }
    return 0.5 * std::abs(sum);
}

TEST(PointLight, FollowsTheInverseSquareAndTheCosine) {
    Scene s = floor_scene();
    s.lights.push_back(lamp(Light::Kind::point, {{}, {0.5, 0, 2}}, {8, 4, 2}));
    const double d2 = 0.25 + 4, cosine = 2 / std::sqrt(d2);
    const Estimate e = irradiance_at(s, 0, 0, 1);
    EXPECT_NEAR(e.mean.x, 8 / d2 * cosine, 1e-6);
    EXPECT_NEAR(e.mean.z, 2 / d2 * cosine, 1e-6);
    add_sphere(s, 0.1, {0.25, 0, 1});  // in the way
    EXPECT_EQ(irradiance_at(s, 0, 0, 1).mean, Vec3{});
    EXPECT_GT(irradiance_at(s, -1, 0, 1).mean.x, 0);
}

TEST(DirectionalLight, FollowsTheCosineAtAnyDistance) {
    Scene s = floor_scene();
    s.lights.push_back(lamp(Light::Kind::directional, shining_at({}, {1, 0, -1}), {3, 2, 1}));
    EXPECT_NEAR(irradiance_at(s, 0, 0, 1).mean.x, 3 * std::sqrt(0.5), 1e-6);
    add_sphere(s, 1e3, {-1e6, 0, 1e6});
    EXPECT_EQ(irradiance_at(s, 0, 0, 1).mean, Vec3{});
}

TEST(MountedLight, RidesOnItsBody) {
    Scene s = floor_scene();
    s.lights.push_back(lamp(Light::Kind::point, {{}, {0, 0, -1.5}}, {8, 8, 8}));
    s.lights[0].mount = add_sphere(s, 1, {});
    // The body stands upside down, 0.5 m to the side: the lamp is above it.
    s.bodies[1].initial.T_world_body = {exp_rotation({kPi, 0, 0}), {0.5, 0, -3.5}};
    Mesh ceiling = plate(4, 4);
    add_mesh(s, std::move(ceiling), {exp_rotation({kPi, 0, 0}), {0, 0, -1}});
    const Estimate e = light_along(s, ray_to({0.51, 0, -1.05}, {0.5, 0, -1}), kDirectLight, 1);
    EXPECT_NEAR(e.mean.x * kPi, 8, 1e-5);
}

TEST(RectangleLight, IsLambertsPolygonFormula) {
    for (const Vec3& at : {Vec3{0, 0, 1}, Vec3{0.7, 0.4, 0.5}, Vec3{0.3, 0, 100}}) {
        Scene s = floor_scene();
        const Rigid3 T = shining_at(at, {0, 0, 0});
        s.lights.push_back(lamp(Light::Kind::rectangle, T, {5, 4, 3}));
        s.lights[0].width_m = 0.6;
        s.lights[0].height_m = 0.3;
        const std::vector<Vec3> corners{T * Vec3{-0.3, -0.15, 0}, T * Vec3{0.3, -0.15, 0}, T * Vec3{0.3, 0.15, 0},
                                        T * Vec3{-0.3, 0.15, 0}};
        const double expected = 5 * polygon_irradiance(corners, {}, {0, 0, 1});
        const Estimate e = irradiance_at(s, 0, 0, 256);
        EXPECT_NEAR(e.mean.x, expected, kSigmas * e.error + 1e-6 * expected);
        EXPECT_LT(e.error, 1e-3 * expected);
    }
}

TEST(RectangleLight, ShinesToOneSideAlone) {
    Scene s = floor_scene();
    s.lights.push_back(lamp(Light::Kind::rectangle, {{}, {0, 0, 1}}, {5, 4, 3}));  // up, away from the floor
    EXPECT_EQ(irradiance_at(s, 0, 0, 16).mean, Vec3{});
    EXPECT_EQ(light_along(s, {{0.1, 0.1, 3}, {0, 0, -1}}, kDirectLight, 1).mean, (Vec3{5, 4, 3}));
    EXPECT_EQ(light_along(s, {{0.1, 0.1, 0.9}, {0, 0, 1}}, kDirectLight, 1).mean, Vec3{});
}

TEST(Lights, HideNothing) {
    // The camera looks through the lamp at a wall that shines.
    Scene s;
    s.materials.push_back(shining(0, {1, 1, 1}));
    add_mesh(s, plate(4, 4));
    s.lights.push_back(lamp(Light::Kind::disc, {{}, {0, 0, 1}}, {5, 4, 3}));
    s.lights[0].radius_m = 0.5;
    EXPECT_EQ(light_along(s, {{0.3, 0.3, 3}, {0, 0, -1}}, kDirectLight, 1).mean, (Vec3{6, 5, 4}));
    EXPECT_EQ(light_along(s, {{0.3, 0.45, 3}, {0, 0, -1}}, kDirectLight, 1).mean, (Vec3{1, 1, 1}));   // beside
    EXPECT_EQ(light_along(s, {{0.3, 0.3, 0.5}, {0, 0, -1}}, kDirectLight, 1).mean, (Vec3{1, 1, 1}));  // behind
}

TEST(Lights, AreHiddenByWhatStandsACentimetreBeforeThemAtAnyDistance) {
    for (const double distance : {3.0, 2e3, 3.8e8}) {
        Scene s;
        s.materials.push_back(shining(0, {1, 1, 1}));
        add_mesh(s, plate(4, 4));
        s.lights.push_back(lamp(Light::Kind::disc, {{}, {0, 0, -0.01}}, {5, 4, 3}));
        EXPECT_EQ(light_along(s, {{0.1, 0.1, distance}, {0, 0, -1}}, kDirectLight, 1).mean, (Vec3{1, 1, 1}));
        s.lights[0].T_mount_light.t.z = 0.01;
        EXPECT_EQ(light_along(s, {{0.1, 0.1, distance}, {0, 0, -1}}, kDirectLight, 1).mean, (Vec3{6, 5, 4}));
        // Flush with what it is mounted on, it still shines.
        s.lights[0].mount = 0;
        s.lights[0].T_mount_light.t.z = 0;
        EXPECT_EQ(light_along(s, {{0.1, 0.1, distance}, {0, 0, -1}}, kDirectLight, 1).mean, (Vec3{6, 5, 4}));
    }
}

// Parallel coaxial discs: the form factor of the small one to the large one, point by point and averaged over the
// disc.
TEST(DiscLight, IsTheFormFactorOfParallelDiscs) {
    const double lamp_radius = 0.8, height = 0.5;
    Scene s = floor_scene();
    s.lights.push_back(lamp(Light::Kind::disc, shining_at({0, 0, height}, {0, 0, 0}), {2, 2, 2}));
    s.lights[0].radius_m = lamp_radius;
    const double a2 = lamp_radius * lamp_radius, h2 = height * height;
    for (const double r : {0.0, 0.3, 0.8, 1.5}) {
        const double b = h2 + r * r + a2;
        const double to_point = 0.5 * (1 - (h2 + r * r - a2) / std::sqrt(b * b - 4 * a2 * r * r));
        const Estimate e = irradiance_at(s, 0.6 * r, 0.8 * r, 256);
        EXPECT_NEAR(e.mean.x, 2 * kPi * to_point, kSigmas * e.error + 1e-6) << r;
        EXPECT_LT(e.error, 3e-3 * e.mean.x) << r;
    }
    const double disc_radius = 0.6, R1 = disc_radius / height, R2 = lamp_radius / height;
    const double X = 1 + (1 + R2 * R2) / (R1 * R1);
    const double form_factor = 0.5 * (X - std::sqrt(X * X - 4 * (R2 / R1) * (R2 / R1)));
    double sum = 0, error2 = 0;
    const int points = 256;  // even in area, along a spiral
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    for (int k = 0; k < points; ++k) {
        const double r = disc_radius * std::sqrt((k + 0.5) / points), phi = k * kPi * (3 - std::sqrt(5.0));
        const Vec3 p{r * std::cos(phi), r * std::sin(phi), 0};
        const Estimate e = light_along(*render_scene, placed(s), ray_to(p + Vec3{0.01, 0, 0.05}, p), kDirectLight,
                                       16, static_cast<std::uint64_t>(k));
        sum += e.mean.x / 2;
        error2 += e.error * e.error / 4;
    }
    // The spiral's own error is that of a smooth integrand with 256 even points: below 1/256 of the range of
    // values.
    EXPECT_NEAR(sum / points, form_factor, kSigmas * std::sqrt(error2) / points + 2e-3);
}

TEST(SphereLamp, IsTheInverseSquareLawExactlyAtAnyDistance) {
    // E = pi L (r / d)^2 cos, for a sphere wholly above the horizon.
    for (const double d : {1.1, 1.5, 10.0, 1e4, 1e9}) {
        Scene s = floor_scene();
        s.materials.push_back(shining(0, {7, 7, 7}));
        const double cosine = 0.99;
        add_sphere(s, 1, {d * std::sqrt(1 - cosine * cosine), 0, d * cosine}, 1);
        const Estimate e = irradiance_at(s, 0, 0, 256);
        const double expected = 7 * kPi / (d * d) * cosine;
        EXPECT_NEAR(e.mean.x, expected, kSigmas * e.error + 1e-5 * expected) << d;
        EXPECT_LT(e.error, 2e-3 * expected) << d;
    }
}

TEST(EllipsoidLamp, IsTheProjectedSolidAngleOfItsOutline) {
    const Vec3 axes{0.5, 1, 0.25}, centre{0.4, -0.2, 1.1};
    const Quat q = normalized(Quat{0.8, 0.3, -0.4, 0.2});
    Scene s = floor_scene();
    s.materials.push_back(shining(0, {7, 7, 7}));
    Body b;
    b.name = "lamp";
    b.shape = exact_ellipsoid(axes, 1);
    b.initial.T_world_body = {q, centre};
    s.bodies.push_back(b);
    // Cosine-weighted directions on a fine grid: those that meet it, over all of them, times pi.
    const int n = 1500;
    int met = 0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            const double x = 2 * (i + 0.5) / n - 1, y = 2 * (j + 0.5) / n - 1, z2 = 1 - x * x - y * y;
            if (z2 <= 0) continue;
            const Vec3 d = conjugate(q) * Vec3{x, y, std::sqrt(z2)}, o = conjugate(q) * -centre;
            const Vec3 ds{d.x / axes.x, d.y / axes.y, d.z / axes.z}, os{o.x / axes.x, o.y / axes.y, o.z / axes.z};
            met += dot(os, ds) * dot(os, ds) >= dot(ds, ds) * (dot(os, os) - 1);
        }
    const double expected = 7 * 4.0 * met / (static_cast<double>(n) * n);
    const Estimate e = irradiance_at(s, 0, 0, 1024);
    EXPECT_NEAR(e.mean.x, expected, kSigmas * e.error + 1e-4 * expected);  // the grid: its outline's pixels
    EXPECT_LT(e.error, 2e-3 * expected);
}

TEST(MeshLamp, IsLambertsPolygonFormulaFromBothSides) {
    for (const double flip : {0.0, kPi}) {
        Scene s = floor_scene();
        s.materials.push_back(shining(0, {7, 6, 5}));
        Mesh panel = plate(0.6, 0.3, 3);
        panel.face_material.assign(panel.faces.size(), 1);
        const Rigid3 T{normalized(Quat{0.9, 0.2, 0.3, 0.1}) * exp_rotation({flip, 0, 0}), {0.3, 0.2, 0.7}};
        const std::vector<Vec3> corners{T * Vec3{-0.3, -0.15, 0}, T * Vec3{0.3, -0.15, 0}, T * Vec3{0.3, 0.15, 0},
                                        T * Vec3{-0.3, 0.15, 0}};
        add_mesh(s, std::move(panel), T);
        const double expected = 7 * polygon_irradiance(corners, {}, {0, 0, 1});
        const Estimate e = irradiance_at(s, 0, 0, 512);
        EXPECT_NEAR(e.mean.x, expected, kSigmas * e.error + 1e-6 * expected);
        EXPECT_LT(e.error, 2e-3 * expected);
    }
}

/// A floor below a row of lamps of one mesh. If faces were chosen by power alone, the error of so many samples
/// would be 14 times as large.
TEST(MeshLamp, ManyInARowAddUpAndTheNearOnesAreSampledMost) {
    Scene s = floor_scene();
    s.materials.push_back(shining(0, {7, 6, 5}));
    Mesh row;
    double expected = 0;
    for (int k = -12; k <= 12; ++k) {
        Mesh panel = plate(0.4, 0.25);
        for (auto& p : panel.positions) p.x += 1.5f * static_cast<float>(k), p.z += 0.6f;
        const auto first = static_cast<std::uint32_t>(row.positions.size());
        row.positions.insert(row.positions.end(), panel.positions.begin(), panel.positions.end());
        for (auto face : panel.faces) {
            for (auto& corner : face) corner += first;
            row.faces.push_back(face);
        }
        const double x = 1.5 * k;
        expected +=
            7 * polygon_irradiance(
                    {{x - 0.2, -0.125, 0.6}, {x + 0.2, -0.125, 0.6}, {x + 0.2, 0.125, 0.6}, {x - 0.2, 0.125, 0.6}},
                    {}, {0, 0, 1});
    }
    row.name = "row";
    row.face_material.assign(row.faces.size(), 1);
    add_mesh(s, std::move(row));
    const Estimate e = irradiance_at(s, 0, 0, 512);
    EXPECT_NEAR(e.mean.x, expected, kSigmas * e.error + 1e-6 * expected);
    EXPECT_LT(e.error, 0.003 * expected);
}

TEST(TexturedLamp, ShinesAsItsTextureSays) {
    // Half of the panel is dark: half of what an even panel would send, and far enough away that it does not matter
    // which.
    Scene s = floor_scene();
    s.materials.push_back(shining(0, {7, 7, 7}));
    Texture t;
    t.width = 2;
    t.height = 1;
    t.wrap = Texture::Wrap::clamp;
    t.rgb = {65535, 65535, 65535, 0, 0, 0};
    s.textures.push_back(t);
    s.materials[1].emission_texture = 0;
    Mesh panel = plate(0.6, 0.3);
    panel.face_material.assign(panel.faces.size(), 1);
    add_mesh(s, std::move(panel), {{}, {0, 0, 20}});
    const Estimate e = irradiance_at(s, 0, 0, 1024);
    const double expected = 0.5 * 7 * 0.6 * 0.3 / 400;
    EXPECT_NEAR(e.mean.x, expected, kSigmas * e.error + 1e-3 * expected);  // a panel of finite size
    EXPECT_LT(e.error, 5e-3 * expected);
}

TEST(Emitters, OfAllKindsAddUp) {
    Scene all = floor_scene();
    all.materials.push_back(shining(0, {1, 1, 1}));
    all.materials.push_back(shining(0, {40, 40, 40}));
    add_sphere(all, 0.2, {-1, 0.3, 1}, 1);
    Mesh panel = plate(0.1, 0.1);
    panel.face_material.assign(panel.faces.size(), 2);
    add_mesh(all, std::move(panel), {{}, {0.5, 0.9, 0.6}});
    all.lights.push_back(lamp(Light::Kind::point, {{}, {1, -1, 0.5}}, {0.2f, 0.2f, 0.2f}));
    all.lights.push_back(lamp(Light::Kind::directional, shining_at({}, {1, 0, -1}), {0.3f, 0.2f, 0.1f}));
    all.lights.push_back(lamp(Light::Kind::disc, shining_at({-0.5, -0.5, 1.5}, {}), {1, 1, 1}));
    all.lights.push_back(lamp(Light::Kind::rectangle, shining_at({0, 0, -1}, {0, 0, 1}), {99, 99, 99}));  // below
    const Estimate together = irradiance_at(all, 0.1, 0, 4096);
    double sum = 0, error2 = together.error * together.error;
    const auto alone = [&](const Scene& s) {
        const Estimate e = irradiance_at(s, 0.1, 0, 1024);
        EXPECT_GE(e.mean.x, 0);
        sum += e.mean.x;
        error2 += e.error * e.error;
    };
    for (std::size_t i = 0; i < all.lights.size(); ++i) {
        Scene s = floor_scene();
        s.lights.push_back(all.lights[i]);
        alone(s);
    }
    for (std::size_t i : {1U, 2U}) {
        Scene s = all;
        s.lights.clear();
        s.materials[3 - i].emission = {};
        alone(s);
    }
    EXPECT_NEAR(together.mean.x, sum, kSigmas * std::sqrt(error2));
    EXPECT_LT(together.error, 0.01 * sum);
}

TEST(Emitters, AtFiniteAndInfiniteDistanceAddUp) {
    // A ceiling above the lamp, under which the other light comes in from the side.
    for (const Light::Kind kind : {Light::Kind::point, Light::Kind::rectangle, Light::Kind::disc}) {
        Scene both = floor_scene();
        add_mesh(both, plate(4, 4), {exp_rotation({kPi, 0, 0}), {0, 0, 2}});
        both.lights.push_back(lamp(kind, shining_at({0, 0, 1}, {0, 0, 0}), {8, 8, 8}));
        both.lights[0].width_m = both.lights[0].height_m = both.lights[0].radius_m = 0.1;
        both.lights.push_back(lamp(Light::Kind::directional, shining_at({}, {1, 0, -0.5}), {3, 3, 3}));
        double sum = 0, error2 = 0;
        for (const Light& l : both.lights) {
            Scene one = both;
            one.lights = {l};
            const Estimate e = irradiance_at(one, 0.1, 0, 1024);
            EXPECT_GT(e.mean.x, 0.01);
            sum += e.mean.x, error2 += e.error * e.error;
        }
        const Estimate together = irradiance_at(both, 0.1, 0, 4096);
        EXPECT_NEAR(together.mean.x, sum, kSigmas * std::sqrt(error2 + together.error * together.error));
        EXPECT_LT(together.error, 0.01 * sum);
    }
}

TEST(Lights, WithoutLightsSunOnlyDirectLightingSuffices) {
    Scene s = floor_scene();
    add_sun(s, {0, 0, 1});
    s.materials[0].emission = {1, 1, 1};
    EXPECT_FALSE(RenderScene::create(s, 1)->lights().any(Lights::Group::lights));
    s.lights.push_back(lamp(Light::Kind::point, {}, {1, 1, 1}));
    EXPECT_TRUE(RenderScene::create(s, 1)->lights().any(Lights::Group::lights));
}

}  // namespace
}  // namespace narpa
