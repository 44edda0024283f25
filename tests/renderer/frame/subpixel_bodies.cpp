// Bodies smaller than a pixel keep their light.
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/frame/camera_image.h"
#include "renderer/frame/subpixel/subpixel_bodies.h"
#include "renderer/material/texture/texture_lookup.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/cameras.h"
#include "tests/support/oracle.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
constexpr double kFocal = 1319.4792168823421;  // 30 degrees across the diagonal of 500 x 500

RadianceImage render(const RenderScene& render_scene, const Camera& c, const Rigid3& T,
                     const FrameSettings& settings = {}) {
    return rendered(render_scene, placed(render_scene.scene()), c, T, settings);
}

/// What a Lambert sphere sends to a far camera under a point Sun.
double lambert_sphere(double albedo, double radius, double distance, double phase, double solar = 1361) {
    return solar * 2 * albedo / (3 * kPi) * std::pow(radius / distance, 2) *
           (std::sin(phase) + (kPi - phase) * std::cos(phase));
}
/// The same for any convex Lambert mesh, face by face.
double convex_mesh(const Mesh& m, double albedo, const Vec3& to_sun, const Vec3& to_camera, double distance,
                   double solar = 1361) {
    double sum = 0;
    for (const auto& face : m.faces) {
        const auto corner = [&](int k) { return vec_cast<double>(m.positions[face[static_cast<std::size_t>(k)]]); };
        const Vec3 n = 0.5 * cross(corner(1) - corner(0), corner(2) - corner(0));
        if (dot(n, to_sun) > 0 && dot(n, to_camera) > 0) sum += dot(n, to_sun) * dot(n, to_camera) / norm(n);
    }
    return sum * albedo * solar / (kPi * distance * distance);
}

/// One body at the origin, the camera on the x axis, the Sun at this phase angle.
struct Far {
    Scene scene;
    Camera c = camera(21, 21, kFocal);
    double distance;

    Far(double d, double phase, double albedo, double sun_diameter = 0) : distance(d) {
        scene.materials.push_back(lambert(static_cast<float>(albedo)));
        add_sun(scene, {std::cos(phase), std::sin(phase), 0});
        scene.sun->angular_diameter_rad = sun_diameter;
    }
    [[nodiscard]] RenderScene render_scene() const {
        auto t = RenderScene::create(scene, 1);
        EXPECT_TRUE(t);
        return std::move(*t);
    }
    [[nodiscard]] Rigid3 view() const { return looking({distance, 0, 0}, {}); }
};

struct Moments {
    double mean = 0, deviation = 0;
};
Moments moments(const std::vector<double>& v) {
    Moments m;
    for (const double x : v) m.mean += x / static_cast<double>(v.size());
    for (const double x : v) m.deviation += (x - m.mean) * (x - m.mean) / static_cast<double>(v.size());
    m.deviation = std::sqrt(m.deviation);
    return m;
}

/// Flux with the body at several places in its pixel, on edges and corners too.
std::vector<double> fluxes(const Far& far, FrameSettings settings) {
    const RenderScene render_scene = far.render_scene();
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> shift(-0.5, 0.5);
    std::vector<double> out;
    for (std::uint32_t k = 0; k < 12; ++k) {
        Camera c = far.c;
        const bool special = k < 4;
        const double cx = 10 + (special ? 0.5 * (k & 1) : shift(random));
        set_principal_point(c, cx, 10 + (special ? 0.25 * (k & 2) : shift(random)));
        settings.frame = k;
        out.push_back(irradiance(render(render_scene, c, far.view(), settings), c));
    }
    return out;
}

TEST(TinyBody, OracleOfThePointSource) {
    NEED_ORACLE(reference, "point_source");
    const Mesh fine = icosphere(6, 5);
    int judged = 0, as_mesh = 0;
    for (const auto& c : reference["cases"]) {
        const auto& in = c["in"];
        const double phase = in["phase_rad"], distance = in["distance_m"], albedo = in["albedo"];
        const double expected = c["out"]["irradiance_at_camera"];
        ASSERT_EQ(in["radius_m"].get<double>(), 5);
        Far far(distance, phase, albedo);
        const double f_px = in["f_px"];
        const Pinhole p = pinhole_of(far.c);
        set_pinhole(far.c, f_px, f_px, p.cx, p.cy);
        add_sphere(far.scene, 5, {});
        for (const int spp : {1, 4})
            for (const double seen : fluxes(far, {.spp = spp}))
                EXPECT_NEAR(seen / expected, 1, 5e-3) << c["id"] << " phase " << phase << " spp " << spp;
        ++judged;

        // The mesh has a light of its own, which is the sphere's only where no facet is wider than the crescent.
        Far mesh(distance, phase, albedo);
        mesh.c = far.c;
        add_mesh(mesh.scene, fine);
        const double own = convex_mesh(fine, albedo, mesh.scene.sun->direction, {1, 0, 0}, distance);
        const bool like_a_sphere = std::abs(own / expected - 1) < 2e-3;
        // 512 points find a crescent of facets that is a thousandth of the disc wide to 10 %.
        const double tolerance = phase < 3 ? 5e-3 : 0.1;
        for (const double seen : fluxes(mesh, {})) {
            EXPECT_NEAR(seen / own, 1, tolerance) << c["id"] << " phase " << phase;
            if (like_a_sphere) {
                EXPECT_NEAR(seen / expected, 1, 5e-3) << c["id"] << " phase " << phase;
            }
        }
        as_mesh += like_a_sphere;
    }
    EXPECT_EQ(judged, 9);
    EXPECT_GE(as_mesh, 7);
}

TEST(TinyBody, LambertSphereAtAnyPhaseAndDistanceHasTheClosedForm) {
    for (const double phase : {0.0, 0.6, 1.2, 2.0, 2.5, 3.0})
        for (const double distance : {1e4, 3e5, 1e9}) {
            Far far(distance, phase, 0.4);
            add_sphere(far.scene, 5, {});
            const Moments m = moments(fluxes(far, {}));
            // The closed form is of an infinite distance: the crescent narrows by the angle of the radius.
            const double near = 4 * 5 / distance / (kPi - phase);
            EXPECT_NEAR(m.mean / lambert_sphere(0.4, 5, distance, phase), 1, 5e-3 + near)
                << phase << " " << distance;
            EXPECT_LE(m.deviation, 1e-2 * m.mean);
        }
}

TEST(TinyBody, SunOfTheRightSizeAndPathsGiveTheSameLight) {
    const double sun = 0.533 * kPi / 180, distance = 1e5;
    for (const double phase : {0.3, 1.5, 2.2}) {
        Far far(distance, phase, 0.4, sun);
        add_sphere(far.scene, 5, {});
        const double expected = lambert_sphere(0.4, 5, distance, phase);
        for (const FrameSettings& settings :
             {FrameSettings{.spp = 1}, FrameSettings{.spp = 16},
              FrameSettings{.spp = 16, .method = RenderSettings::Method::path, .max_depth = 1},
              FrameSettings{.spp = 1, .method = RenderSettings::Method::path, .max_depth = 5}}) {
            const Moments m = moments(fluxes(far, settings));
            EXPECT_NEAR(m.mean / expected, 1, 5e-3) << phase << " spp " << settings.spp;
            EXPECT_LE(m.deviation, 1e-2 * m.mean) << phase << " spp " << settings.spp;
        }
    }
}

TEST(TinyBody, LightStaysTheSameWhileItMovesOverPixelsAndBlocks) {
    Far far(1.5e4, 1.0, 0.5);  // 0.9 px wide
    add_mesh(far.scene, bumpy(3, 5, 0.3));
    const RenderScene render_scene = far.render_scene();
    std::vector<double> seen;
    for (int k = 0; k < 64; ++k) {
        Camera c = far.c;
        set_principal_point(c, 8.5 + 0.11 * k,
                            9.3 + 0.05 * k);  // seven pixels along, over corners of pixels and of blocks
        seen.push_back(irradiance(render(render_scene, c, far.view()), c));
    }
    const Moments m = moments(seen);
    EXPECT_GT(m.mean, 0);
    EXPECT_LE(m.deviation, 1e-2 * m.mean);  // measured 1e-7
    EXPECT_LE(m.deviation, 1e-5 * m.mean);
}

TEST(TinyBody, OneThatTurnsKeepsItsLightToOnePercent) {
    // A needle, a plate and a box: what their outlines leave of their bounds. Shining, so that the light is the
    // area.
    for (const Vec3& size : {Vec3{10, 0.1, 0.1}, Vec3{10, 4, 0.02}, Vec3{3, 2, 4}}) {
        Far far(1e5, 0, 0);
        far.scene.sun.reset();
        far.scene.materials[0].emission = {1, 1, 1};
        add_mesh(far.scene, box(size.x, size.y, size.z));
        std::mt19937_64 random(9);
        std::vector<double> ratio;
        for (int k = 0; k < 60; ++k) {
            const Quat q = random_attitude(random);
            far.scene.bodies[0].initial.T_world_body.q = q;
            const Vec3 v = conjugate(q) * Vec3{1, 0, 0};
            const double area =
                std::abs(v.x) * size.y * size.z + std::abs(v.y) * size.x * size.z + std::abs(v.z) * size.x * size.y;
            ratio.push_back(irradiance(render(far.render_scene(), far.c, far.view()), far.c) / (area / 1e10));
        }
        const Moments m = moments(ratio);
        EXPECT_NEAR(m.mean, 1, 5e-3) << size.x << " x " << size.y << " x " << size.z;
        EXPECT_LE(m.deviation, 1e-2) << size.x << " x " << size.y << " x " << size.z;
    }
}

TEST(TinyBody, EllipsoidIsSampledOverItsOwnOutline) {
    Far far(1e5, 0, 0);
    far.scene.sun.reset();
    far.scene.materials[0].emission = {1, 1, 1};
    const Vec3 a{5, 0.5, 2};
    Body body;
    body.shape = exact_ellipsoid(a);
    far.scene.bodies.push_back(body);
    std::mt19937_64 random(10);
    for (int k = 0; k < 20; ++k) {
        const Quat q = random_attitude(random);
        far.scene.bodies[0].initial.T_world_body.q = q;
        const Vec3 v = conjugate(q) * Vec3{1, 0, 0};
        const double area = kPi * norm(Vec3{v.x * a.y * a.z, v.y * a.z * a.x, v.z * a.x * a.y});
        EXPECT_NEAR(irradiance(render(far.render_scene(), far.c, far.view()), far.c) / (area / 1e10), 1, 1e-3);
    }
}

TEST(TinyBody, CrossingTheLimitOfSizeChangesTheLightByLessThanOnePercent) {
    for (const double phase : {0.0, 1.5, 2.2})
        for (const bool mesh : {false, true}) {
            std::array<double, 2> scaled{};
            for (const int side : {0, 1}) {
                const double width = side == 0 ? 0.98 * kSubpixelWidth_px : 1.02 * kSubpixelWidth_px;
                const double distance = kFocal * 10 / width;
                Far far(distance, phase, 0.5);
                if (mesh)
                    add_mesh(far.scene, icosphere(4, 5, true));
                else
                    add_sphere(far.scene, 5, {});
                // Where a body is sampled with the rest, 4096 samples a pixel find its light to 0.2 %.
                const auto image = render(far.render_scene(), far.c, far.view(), {.spp = side == 0 ? 1 : 4096});
                scaled[static_cast<std::size_t>(side)] = irradiance(image, far.c) * distance * distance;
            }
            EXPECT_NEAR(scaled[1] / scaled[0], 1, 1e-2) << "phase " << phase << (mesh ? " mesh" : " sphere");
        }
}

/// A scene without a Sun whose bodies shine or are black.
struct Shining {
    Scene s;
    Camera c = camera(16, 16, 1000);
    Shining() {
        s.materials = {lambert(0), lambert(0), lambert(0)};
        s.materials[1].emission = {1, 1, 1};
        s.materials[2].emission = {5, 5, 5};
    }
    /// Mean radiance of the picture times its pixels.
    [[nodiscard]] double sum(int spp = 1) const {
        const auto render_scene = RenderScene::create(s, 1);
        EXPECT_TRUE(render_scene);
        double total = 0;
        for (const Rgb& p : render(*render_scene, c, {}, {.spp = spp}).pixels) total += static_cast<double>(p.x);
        return total;
    }
};

/// Half the width in pixels of a sphere at 1 km through `Shining`'s camera.
constexpr double kWide = 0.5;

TEST(TinyBody, ShowsTheSideOfItsTextureThatFacesTheCamera) {
    Texture halves{.name = "halves", .width = 128, .height = 64, .rgb = {}, .wrap = Texture::Wrap::repeat};
    for (int i = 0; i < 128 * 64; ++i) halves.rgb.insert(halves.rgb.end(), 3, i % 128 < 64 ? 65535 : 0);
    build_coarser_levels(halves);
    for (const double side : {1.0, -1.0}) {
        Far far(1e6, 0, 0.5);
        far.scene.textures.push_back(halves);
        far.scene.materials[0].texture = 0;
        add_sphere(far.scene, 5, {});
        far.scene.bodies[0].initial.T_world_body.q = exp_rotation({0, 0, -side * 0.5 * kPi});
        const double expected = side > 0 ? lambert_sphere(0.5, 5, far.distance, 0) : 0;
        for (const double seen : fluxes(far, {.spp = 16}))
            EXPECT_NEAR(seen, expected, 5e-3 * lambert_sphere(0.5, 5, far.distance, 0)) << side;
    }
}

/// Rays through it would see air without ground.
TEST(TinyBody, IsNoneThatHasAnAtmosphere) {
    Far far(1e10, 1, 0.1);
    add_sphere(far.scene, 6.371e6, {});
    const BodyPoses at = placed(far.scene);
    const auto tracer = Tracer::create(far.scene, 1);
    ASSERT_TRUE(tracer);
    EXPECT_TRUE(SubpixelBodies(*tracer, at, far.c, far.c.model.get(), far.view(), nullptr, false).any());
    far.scene.atmosphere.emplace();
    far.scene.atmosphere->body = 0;
    const auto with_air = Tracer::create(far.scene, 1);
    ASSERT_TRUE(with_air);
    const SubpixelBodies none(*with_air, at, far.c, far.c.model.get(), far.view(), nullptr, false);
    EXPECT_FALSE(none.any());
    EXPECT_FALSE(none.contains(0));
}

TEST(TinyBody, CoversWhatIsBehindIt) {
    for (const int spp : {1, 4}) {
        Shining w;
        w.c.model = w.c.model->windowed(-0.23, 0.31);
        Mesh wall = plate(200, 200);
        wall.face_material.assign(wall.faces.size(), 1);
        add_mesh(w.s, wall, {{0, 1, 0, 0}, {0, 0, 2000}});
        EXPECT_NEAR(w.sum(spp), 256, 1e-4);
        add_sphere(w.s, kWide, {0, 0, 1000}, 0);
        const double disc = kPi * kWide * kWide;  // px^2
        EXPECT_NEAR(256 - w.sum(spp), disc, 5e-3 * disc) << spp;
        w.s.bodies.pop_back();
        add_sphere(w.s, kWide, {0, 0, 1000}, 2);
        EXPECT_NEAR(w.sum(spp) - 256, 4 * disc, 5e-3 * 4 * disc) << spp;
    }
}

TEST(TinyBody, IsHiddenByWhatIsBeforeIt) {
    for (const int spp : {1, 4}) {
        Shining w;
        add_sphere(w.s, kWide, {0.1, 0.2, 1000}, 2);
        const double whole = w.sum(spp);
        EXPECT_NEAR(whole, 5 * kPi * kWide * kWide, 5e-3 * whole);
        // A black wall up to the middle of the sphere, far larger than a pixel.
        add_mesh(w.s, plate(40, 40), {{0, 1, 0, 0}, {-20 + 0.1 * 0.5, 0, 500}});
        EXPECT_NEAR(w.sum(spp), 0.5 * whole, 5e-3 * whole) << spp;
        w.s.bodies.back().initial.T_world_body.t.x += 1;
        EXPECT_EQ(w.sum(spp), 0) << spp;
    }
}

TEST(TinyBody, TwoTogetherHideEachOtherAsTheyStand) {
    Shining w;
    const double disc = kPi * kWide * kWide, r = kWide;
    add_sphere(w.s, r, {0, 0, 1000}, 1);
    add_sphere(w.s, r, {0.5 * r, 0, 1001}, 2);  // behind, half a radius aside
    const double lens = 2 * r * r * std::acos(0.25) - 0.25 * r * std::sqrt(4 * r * r - 0.25 * r * r);
    const double expected = disc + 5 * (disc - lens);
    EXPECT_NEAR(w.sum(), expected, 5e-3 * expected);
    std::swap(w.s.bodies[0], w.s.bodies[1]);
    EXPECT_NEAR(w.sum(), expected, 5e-3 * expected);
    // Behind both is a wall.
    Mesh wall = plate(200, 200);
    wall.face_material.assign(wall.faces.size(), 1);
    add_mesh(w.s, wall, {{0, 1, 0, 0}, {0, 0, 2000}});
    EXPECT_NEAR(w.sum() - 256, 4 * (disc - lens), 5e-3 * expected);
}

TEST(TinyBody, OffTheAxisAndOverTheEdgeOfTheImage) {
    // 25 degrees off the axis the image of a sphere is longer and wider; what the pixels see must make up for it.
    Shining w;
    w.c = camera(1000, 16, 1000);
    for (const double x : {-466.0, 300.0}) {
        w.s.bodies.clear();
        add_sphere(w.s, kWide, {x, 0, 1000}, 1);
        const auto render_scene = RenderScene::create(w.s, 1);
        ASSERT_TRUE(render_scene);
        const double d2 = x * x + 1e6, solid_angle = 2 * kPi * (1 - std::sqrt(1 - kWide * kWide / d2));
        EXPECT_NEAR(irradiance(render(*render_scene, w.c, {}), w.c) / solid_angle, 1, 5e-3) << x;
    }
    w.c = camera(16, 16, 1000);
    w.s.bodies.clear();
    add_sphere(w.s, kWide, {8, 0, 1000}, 1);  // its middle on the image's right edge
    const double half = 0.5 * kPi * kWide * kWide;
    EXPECT_NEAR(w.sum(), half, 1e-2 * half);
    w.s.bodies[0].initial.T_world_body.t = {8, 0, -1000};
    EXPECT_EQ(w.sum(), 0);
}

TEST(TinyBody, BoundsHoldTheMesh) {
    std::mt19937_64 random(4);
    Scene s;
    s.materials.resize(1);
    Mesh far_box = box(10, 0.1, 0.1);
    for (Vec3f& p : far_box.positions) p += Vec3f{100, 0, -3};
    for (const Mesh& mesh : {bumpy(3, 2, 0.5), far_box, plate(3, 2), icosphere(3, 7)}) add_mesh(s, mesh);
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer) << tracer.error().text();
    for (std::size_t m = 0; m < 4; ++m) {
        const BodyBounds& b = tracer->bounds(m);
        for (const Vec3f& p : s.meshes[m].positions) {
            const Vec3 d = vec_cast<double>(p) - b.centre_m;
            const Vec3 unit{d.x / b.semi_axes_m.x, d.y / b.semi_axes_m.y, d.z / b.semi_axes_m.z};
            EXPECT_LE(norm(unit), 1) << m;
        }
    }
    EXPECT_NEAR(tracer->bounds(3).semi_axes_m.y, 7, 1e-5);  // a sphere's are the sphere
    EXPECT_NEAR(tracer->bounds(1).centre_m.x, 100, 1e-4);
    EXPECT_NEAR(tracer->bounds(1).semi_axes_m.x, 5 * std::sqrt(3), 1e-4);
}

Scene swarm_over_a_globe() {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_sphere(s, 3e4, {0, 0, 8e4});
    std::mt19937_64 random(12);
    std::uniform_real_distribution<double> place(-1, 1);
    for (int i = 0; i < 30; ++i) {
        const Vec3 at{200 * place(random), 200 * place(random), 2e4};
        if (i % 2 == 0)
            add_sphere(s, 1 + i % 5, at);
        else
            add_mesh(s, box(5, 2, 1 + i % 3), {random_attitude(random), at});
    }
    add_sun(s, {1, -0.5, -1});
    s.ambient = {0.5f, 0.4f, 0.3f};
    return s;
}

TEST(TinyBody, SameBytesOnOneTwoAndSevenThreadsWithAndWithoutALens) {
    const Scene s = swarm_over_a_globe();
    const auto render_scene = RenderScene::create(s, 2);
    ASSERT_TRUE(render_scene);
    for (const bool lens : {false, true})
        for (const auto method : {RenderSettings::Method::direct, RenderSettings::Method::path}) {
            std::vector<std::vector<Rgb>> pictures;
            for (const int threads : {1, 2, 7}) {
                const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                                static_cast<std::size_t>(threads));
                tbb::task_arena(threads).execute([&] {
                    Camera c = camera(45, 38, 2000);
                    if (lens) c.optics.lens = Lens{0.05, 50};
                    pictures.push_back(render(*render_scene, c, {}, {.spp = 2, .method = method}).pixels);
                });
            }
            EXPECT_EQ(pictures[0], pictures[1]);
            EXPECT_EQ(pictures[0], pictures[2]);
        }
}

TEST(TinyBody, FramesWithThemAllocateNothing) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has the heap";
    const Scene s = swarm_over_a_globe();
    const auto render_scene = RenderScene::create(s, 2);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const Camera c = camera(48, 48, 2000);
    RadianceImage image(c.width, c.height);
    Aovs aovs;
    tbb::task_arena arena(2);
    CameraRenderer renderer(*render_scene, c);
    const auto frames = [&](std::uint32_t n) {
        arena.execute([&] {
            for (std::uint32_t i = 0; i < n; ++i) renderer.render(at, {}, {.spp = 2, .frame = i}, image, &aovs);
        });
    };
    frames(30);  // the thread pool and Embree settle
    const AllocationCounter count;
    frames(10);
    EXPECT_EQ(count.on_all_threads(), 0u);
}

}  // namespace
}  // namespace narpa
