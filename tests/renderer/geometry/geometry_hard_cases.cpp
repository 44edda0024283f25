// Distances, edges and thin gaps on which a tracer in single precision fails.
#include <gtest/gtest.h>

#include "renderer/camera/scene_camera.h"
#include "renderer/detector/detector.h"
#include "renderer/frame/camera_image.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

constexpr int kFewer = NARPA_SANITIZED ? 20 : 1;  // the sanitizers are that much slower

Result<Tracer> tracer_of(const Scene& s) {
    return Tracer::create(s, 1);
}
Result<RenderScene> render_scene_of(const Scene& s) {
    return RenderScene::create(s, 1);
}

Scene bumpy_body_in_the_sun() {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_mesh(s, bumpy(4, 2.5, 0.3), {normalized(Quat{0.9, 0.2, -0.3, 0.1}), {0.25, -0.5, 1.0}});
    add_sun(s, {1, 0.4, 0.3});
    return s;
}

TEST(FarFromTheOrigin, CommonOffsetChangesNoRangeAndNoPixel) {
    const Scene s = bumpy_body_in_the_sun();
    const auto render_scene = render_scene_of(s);
    ASSERT_TRUE(render_scene) << render_scene.error().text();
    Camera c = camera(160, 120, 1400);
    c.detector = Detector{};
    c.format = PixelFormat::y16;
    const Rigid3 T = looking({44, 22, 9}, {0.25, -0.5, 1.0});

    RadianceImage near(c.width, c.height), far(c.width, c.height);
    Aovs near_aovs, far_aovs;
    std::vector<std::uint8_t> near_bytes(2 * near.pixels.size()), far_bytes(near_bytes.size());
    render_radiance(*render_scene, placed(s), c, T, {}, near, &near_aovs);
    expose(c, near, 0, 0, near_bytes);

    for (const Vec3 offset : {Vec3{1e7, 0, 0}, Vec3{-3.844e8, 0, 0}, Vec3{0, 3.844e8, -1e7}}) {
        Rigid3 moved = T;
        moved.t += offset;
        render_radiance(*render_scene, placed(s, offset), c, moved, {}, far, &far_aovs);
        expose(c, far, 0, 0, far_bytes);
        double worst = 0;
        int seen = 0;
        for (std::size_t i = 0; i < near.pixels.size(); ++i) {
            ASSERT_EQ(near_aovs.body[i], far_aovs.body[i]) << i;
            if (near_aovs.body[i] < 0) continue;
            ++seen;
            worst = std::max(worst, std::abs(near_aovs.range_m[i] - far_aovs.range_m[i]));
        }
        EXPECT_GT(seen, 5000);
        EXPECT_LE(worst, 2e-5);
        EXPECT_EQ(near_bytes, far_bytes);
    }
}

TEST(FarFromTheOrigin, OffsetThatIsExactInDoubleChangesNoBitOfTheRadiance) {
    Scene s = bumpy_body_in_the_sun();
    const auto render_scene = render_scene_of(s);
    ASSERT_TRUE(render_scene);
    const Camera c = camera(96, 96, 900);
    const Rigid3 T = looking({44, 22, 9}, {0.25, -0.5, 1.0});
    RadianceImage near(c.width, c.height), far(c.width, c.height);
    FrameSettings settings;
    settings.spp = 2;
    render_radiance(*render_scene, placed(s), c, T, settings, near);
    const Vec3 offset{0x1p28, -0x1p27, 0x1p20};
    render_radiance(*render_scene, placed(s, offset), c, Rigid3{T.q, T.t + offset}, settings, far);
    EXPECT_EQ(near.pixels, far.pixels);
}

/// Nearest hit by trying every face in extended precision.
long double nearest_by_hand(const Mesh& m, const Vec3& origin, const Vec3& direction) {
    using LongVec3 = Vec<long double>;
    const LongVec3 o = vec_cast<long double>(origin), d = vec_cast<long double>(direction);
    long double best = std::numeric_limits<long double>::infinity();
    for (const auto& f : m.faces) {
        const LongVec3 a = vec_cast<long double>(m.positions[f[0]]),
                       e1 = vec_cast<long double>(m.positions[f[1]]) - a,
                       e2 = vec_cast<long double>(m.positions[f[2]]) - a, p = cross(d, e2);
        const long double det = dot(e1, p);
        if (det == 0) continue;
        const LongVec3 s = o - a, q = cross(s, e1);
        const long double b1 = dot(s, p) / det, b2 = dot(d, q) / det, t = dot(e2, q) / det;
        if (b1 >= 0 && b2 >= 0 && b1 + b2 <= 1 && t > 0) best = std::min(best, t);
    }
    return best;
}

TEST(FarFromTheOrigin, RangeOfASmallBodyIsExactToTenMicrometresAtAnyDistance) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_mesh(s, bumpy(3, 4, 0.3));
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> within(-2, 2);
    for (const double distance : {50.0, 1e3, 1e5, 1e7}) {
        double worst = 0;
        for (int i = 0; i < 200; ++i) {
            const Vec3 eye = distance * random_direction(random);
            const Vec3 target{within(random), within(random), within(random)};
            const Ray ray{eye, normalized(target - eye)};
            const Hit hit = tracer->intersect(at, ray, kInfinity);
            ASSERT_EQ(hit.body, 0);
            // The reference starts 20 m away: long double is exact there, and moving along the ray loses nothing.
            const double skipped = distance - 20;
            using LongVec3 = Vec<long double>;
            const LongVec3 start = vec_cast<long double>(eye) +
                                   vec_cast<long double>(ray.direction) * static_cast<long double>(skipped);
            const long double t = static_cast<long double>(skipped) +
                                  nearest_by_hand(s.meshes[0], vec_cast<double>(start), ray.direction);
            worst = std::max(worst, static_cast<double>(std::abs(t - static_cast<long double>(hit.range_m))));
        }
        EXPECT_LE(worst, 1e-5) << distance;
    }
}

TEST(FarFromTheOrigin, MeshModelledFarFromItsOwnOriginKeepsItsPrecision) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    Mesh m = icosphere(4, 1);
    for (Vec3f& p : m.positions) p += Vec3f{4096, -512, 64};
    add_mesh(s, m);
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer);
    std::mt19937_64 random(2);
    double worst = 0;
    for (int i = 0; i < 200; ++i) {
        const Vec3 eye = Vec3{4096, -512, 64} + 30.0 * random_direction(random);
        const Ray ray{eye, normalized(Vec3{4096, -512, 64} + 0.8 * random_direction(random) - eye)};
        const Hit hit = tracer->intersect(placed(s), ray, kInfinity);
        ASSERT_EQ(hit.body, 0);
        worst =
            std::max(worst, std::abs(hit.range_m - static_cast<double>(nearest_by_hand(m, eye, ray.direction))));
    }
    EXPECT_LE(worst, 1e-5);
}

TEST(FarFromTheOrigin, AnEarthBehindChangesNoNearRange) {
    Scene alone = bumpy_body_in_the_sun(), with_earth = bumpy_body_in_the_sun();
    add_sphere(with_earth, 6378137, {0, 0, -6778137});
    const auto a = render_scene_of(alone), b = render_scene_of(with_earth);
    ASSERT_TRUE(a && b);
    const Camera c = camera(80, 60, 80);
    const Rigid3 T = looking({6, 3, 8}, {0, 0, 0});
    RadianceImage image(c.width, c.height);
    Aovs near, both;
    render_radiance(*a, placed(alone), c, T, {}, image, &near);
    render_radiance(*b, placed(with_earth), c, T, {}, image, &both);
    int seen = 0, earth = 0;
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        earth += both.body[i] == 1;
        if (near.body[i] < 0) continue;
        ++seen;
        ASSERT_EQ(both.body[i], 0);
        EXPECT_NEAR(both.range_m[i], near.range_m[i], 1e-6);
    }
    EXPECT_GT(seen, 100);
    EXPECT_GT(earth, 100);
}

TEST(FarFromTheOrigin, OneMillimetreFeaturesBesideAPlanetOfAMillionKilometres) {
    Scene alone, both;
    for (Scene* s : {&alone, &both}) {
        s->materials.push_back(lambert(0.4f));
        add_mesh(*s, bumpy(4, 5e-3, 0.3));  // waves of about a millimetre
        add_sphere(*s, 5e-4, {8e-3, 0, 0});
    }
    const double radius = 1e9, depth = radius + 0.1;
    add_sphere(both, radius, {0, 0, -depth});
    const auto a = tracer_of(alone), b = tracer_of(both);
    ASSERT_TRUE(a && b);
    std::mt19937_64 random(8);
    int near = 0, planet = 0, shadows = 0;
    for (int i = 0; i < 20'000; ++i) {
        Vec3 eye = 0.05 * random_direction(random);
        eye.z = std::abs(eye.z);
        const Ray ray{eye, normalized(6e-3 * random_direction(random) - eye)};
        const Hit one = a->intersect(placed(alone), ray, kInfinity),
                  two = b->intersect(placed(both), ray, kInfinity);
        if (one.body < 0) {
            if (ray.direction.z > -0.1) continue;
            ASSERT_EQ(two.body, 2);
            ++planet;
            // Depth of the sphere's surface below a point near its top, to the second order.
            const double x =
                norm(Vec3{ray.origin.x, ray.origin.y, 0} + two.range_m * Vec3{ray.direction.x, ray.direction.y, 0});
            EXPECT_NEAR(ray.origin.z + two.range_m * ray.direction.z, -0.1 - x * x / (2 * radius), 1e-6);
            continue;
        }
        ASSERT_EQ(two.body, one.body);
        ASSERT_EQ(two.range_m, one.range_m);
        ++near;
        Vec3 sun = random_direction(random);
        sun.z = std::abs(sun.z);
        const bool dark = a->occluded(placed(alone), one, sun, kInfinity);
        ASSERT_EQ(b->occluded(placed(both), two, sun, kInfinity), dark);
        ASSERT_TRUE(b->occluded(placed(both), two, {0, 0, -1}, kInfinity));
        shadows += dark;
    }
    EXPECT_GT(near, 10'000);
    EXPECT_GT(planet, 500);
    EXPECT_GT(shadows, 1'000);
}

TEST(ShadowRays, LitFacetsOfAConvexBodyAreNeverDark) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    std::mt19937_64 random(3);
    add_mesh(s, icosphere(5, 5), {random_attitude(random), {}});
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer);
    for (const Vec3 offset : {Vec3{}, Vec3{7e6, 0, 0}, Vec3{3.844e8, -2e7, 1}}) {
        const BodyPoses at = placed(s, offset);
        int lit = 0, dark = 0;
        for (int i = 0; lit < 400'000 / kFewer && i < 2'000'000; ++i) {
            const double distance = std::array{50.0, 1e4, 1e7}[static_cast<std::size_t>(i) % 3];
            const Vec3 eye = offset + distance * random_direction(random);
            const Ray ray{eye, normalized(offset + 4.9 * random_direction(random) - eye)};
            const Hit hit = tracer->intersect(at, ray, kInfinity);
            if (hit.body < 0) continue;
            Vec3 sun = random_direction(random);
            if (dot(sun, hit.geometric_normal) < 0) sun = -sun;
            // Every fourth Sun stands within 0.06 degrees of the facet's horizon.
            if (i % 4 == 0) sun = normalized(sun + (1e-3 - dot(sun, hit.geometric_normal)) * hit.geometric_normal);
            ++lit;
            dark += tracer->occluded(at, hit, sun, kInfinity);
        }
        EXPECT_EQ(dark, 0) << "of " << lit << " at offset " << offset.x;
    }
}

TEST(ShadowRays, APlateOneMillimetreAboveAFacetAlwaysBlocks) {
    const auto blocked_everywhere = [](const Scene& s, const Vec3& offset) {
        const auto tracer = tracer_of(s);
        ASSERT_TRUE(tracer);
        const BodyPoses at = placed(s, offset);
        const Rigid3& T = at.T_world_body[0];
        std::mt19937_64 random(4);
        std::uniform_real_distribution<double> on_facet(-1.9, 1.9);
        for (int i = 0; i < 20'000; ++i) {
            // From the side, under the plate: 1 mm of air over the facet.
            const Vec3 foot{on_facet(random), on_facet(random), 2};
            const Vec3 eye = foot + Vec3{0, 0, 5e-4};
            const Vec3 aim = normalized(Vec3{0.3, 0.2, -1});
            const Hit hit = tracer->intersect(at, {T * eye, T.q * aim}, kInfinity);
            ASSERT_EQ(hit.body, 0);
            EXPECT_NEAR(hit.range_m, 5e-4 / -aim.z, 2e-7);
            Vec3 sun = random_direction(random);
            sun.z = std::abs(sun.z) + 0.05;
            ASSERT_TRUE(tracer->occluded(at, hit, T.q * normalized(sun), kInfinity)) << i << " " << offset.x;
        }
    };
    Mesh above = plate(6, 6, 3);
    std::mt19937_64 random(5);
    const Rigid3 T{random_attitude(random), {}};
    for (const Vec3 offset : {Vec3{}, Vec3{1e7, 0, 0}, Vec3{0, -3.844e8, 0}}) {
        Scene apart;  // the plate is a body of its own
        apart.materials.push_back(lambert(0.4f));
        add_mesh(apart, box(4, 4, 4), T);
        add_mesh(apart, above, T * Rigid3{{}, {0, 0, 2.001}});
        blocked_everywhere(apart, offset);

        Scene joined;  // the plate is part of the same mesh
        joined.materials.push_back(lambert(0.4f));
        Mesh m = box(4, 4, 4);
        const auto first = static_cast<std::uint32_t>(m.positions.size());
        for (const Vec3f& p : above.positions) m.positions.push_back(p + Vec3f{0, 0, 2.001f});
        for (const auto& f : above.faces) m.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
        m.face_material.assign(m.faces.size(), 0);
        add_mesh(joined, m, T);
        blocked_everywhere(joined, offset);
    }
}

TEST(ShadowRays, AnOverhangOneMillimetreUpHidesTheSunAtAnyDistanceOfTheCamera) {
    // The overhang ends at x = 0. Points of the facet within 2 mm of its foot, seen from above and from far; the
    // Sun stands behind a point of the overhang that is at least 0.1 mm inside it, and then as far outside.
    Scene s;
    s.materials.push_back(lambert(0.4f));
    std::mt19937_64 random(14);
    const Rigid3 T{random_attitude(random), {}};
    add_mesh(s, box(10, 10, 4), T);
    add_mesh(s, plate(4, 8, 3), T * Rigid3{{}, {-2, 0, 2.001}});
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer);
    std::uniform_real_distribution<double> unit(0, 1);
    for (const double distance : {50.0, 1e4, 1e6, 1e7}) {
        const BodyPoses at = placed(s, {3.844e8, 0, -7e6});
        const Rigid3& T_world = at.T_world_body[0];
        for (int i = 0; i < 10'000; ++i) {
            const Vec3 foot{2e-3 * unit(random), 6 * unit(random) - 3, 2};
            const Vec3 eye = foot + distance * normalized(Vec3{1 + unit(random), unit(random) - 0.5, 1});
            const Vec3 world_eye = T_world * eye;
            const Hit hit = tracer->intersect(at, {world_eye, normalized(T_world * foot - world_eye)}, kInfinity);
            ASSERT_EQ(hit.body, 0);
            const auto dark = [&](double beyond_the_rim) {
                const Vec3 behind{beyond_the_rim, foot.y + 1e-3 * (unit(random) - 0.5), 2.001};
                return tracer->occluded(at, hit, T_world.q * normalized(behind - foot), kInfinity);
            };
            ASSERT_TRUE(dark(-1e-4 - 1e-3 * unit(random))) << distance;
            ASSERT_FALSE(dark(1e-4 + 1e-3 * unit(random))) << distance;
        }
    }
}

struct Leaks {
    int rays = 0, lost = 0;
};
/// Rays at points of a closed body, from outside: lost when they miss or first meet the far side.
template <class Aim>
Leaks leaks_of(const Scene& s, int rays, Aim&& aim) {
    const auto tracer = tracer_of(s);
    EXPECT_TRUE(tracer);
    const BodyPoses at = placed(s);
    std::mt19937_64 random(6);
    Leaks leaks;
    while (leaks.rays < rays) {
        const Vec3 eye = 12.0 * random_direction(random);
        const Vec3 target = aim(random);
        const Vec3 direction = normalized(target - eye);
        if (dot(direction, normalized(target)) > -0.2) continue;  // the limb and the far side
        ++leaks.rays;
        const Hit hit = tracer->intersect(at, {eye, direction}, kInfinity);
        leaks.lost += hit.body < 0 || std::abs(hit.range_m - norm(target - eye)) > 0.2;
    }
    return leaks;
}

TEST(Watertight, RandomEdgeAndVertexRaysAreNotLost) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_mesh(s, icosphere(5, 4));
    const Mesh& m = s.meshes[0];
    std::uniform_int_distribution<std::size_t> face(0, m.faces.size() - 1);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto vertex = [&](const auto& f, int k) {
        return vec_cast<double>(m.positions[f[static_cast<std::size_t>(k)]]);
    };

    const Leaks interior = leaks_of(s, 2'000'000 / kFewer, [&](auto& random) {
        const auto& f = m.faces[face(random)];
        double u = unit(random), v = unit(random);
        if (u + v > 1) u = 1 - u, v = 1 - v;
        return vertex(f, 0) * (1 - u - v) + vertex(f, 1) * u + vertex(f, 2) * v;
    });
    EXPECT_EQ(interior.lost, 0);
    const Leaks edges = leaks_of(s, 1'000'000 / kFewer, [&](auto& random) {
        const auto& f = m.faces[face(random)];
        const double u = unit(random);
        return vertex(f, 0) * (1 - u) + vertex(f, 1) * u;
    });
    EXPECT_EQ(edges.lost, 0);
    const Leaks vertices =
        leaks_of(s, 1'000'000 / kFewer, [&](auto& random) { return vertex(m.faces[face(random)], 0); });
    EXPECT_LE(vertices.lost, 2e-5 * vertices.rays);
}

TEST(Watertight, NoneOfTenMillionRandomRaysInBatchesIsLost) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_mesh(s, icosphere(5, 4));
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    std::mt19937_64 random(15);
    std::uniform_real_distribution<double> within(-0.3, 0.3);
    int rays = 0, lost = 0;
    while (rays < 10'000'000 / kFewer) {
        const Vec3 towards = random_direction(random), eye = 12.0 * towards, beside = cross(towards, {0.6, 0.8, 0});
        RayBatch packet;
        packet.n = kLanes;
        for (std::size_t i = 0; i < kLanes; ++i)
            packet.put(i, {eye, normalized(within(random) * 7.0 * beside - eye)});
        HitBatch hits;
        tracer->intersect(at, packet, tracer->all_bodies(), hits);
        for (std::size_t i = 0; i < kLanes; ++i)
            lost += hits.body[i] < 0 || !is_set(hits.outside, i) || hits.range_m[i] > 12;
        rays += static_cast<int>(kLanes);
    }
    EXPECT_EQ(lost, 0) << "of " << rays;
}

TEST(Watertight, PixelsThatMeetAGridsVerticesAreNotLost) {
    // A camera above terrain whose posts project onto pixel centres: robust mode alone loses 0.4 % of them.
    Scene s;
    s.materials.push_back(lambert(0.4f));
    Mesh terrain = plate(64, 64, 256);
    for (Vec3f& p : terrain.positions) p.z = 0.1f * std::sin(3 * p.x) * std::cos(2 * p.y);
    add_mesh(s, terrain);
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    int rays = 0, lost = 0;
    for (const Vec3 eye : {Vec3{0, 0, 40}, Vec3{0.1, -0.2, 33}, Vec3{8, 8, 37}, Vec3{-20, 3, 50}})
        for (const Vec3f& p : terrain.positions) {
            if (std::abs(p.x) > 31 || std::abs(p.y) > 31) continue;
            const Vec3 target = vec_cast<double>(p);
            const Hit hit = tracer->intersect(at, {eye, normalized(target - eye)}, kInfinity);
            ++rays;
            lost += hit.body < 0;
        }
    EXPECT_GT(rays, 200'000);
    EXPECT_LE(lost, 2e-5 * rays);
}

TEST(BodyPose, SignOfTheQuaternionChangesNothing) {
    Scene s = bumpy_body_in_the_sun();
    const auto render_scene = render_scene_of(s);
    ASSERT_TRUE(render_scene);
    const Camera c = camera(64, 64, 800);
    Rigid3 T = looking({44, 22, 9}, {0.25, -0.5, 1.0});
    BodyPoses at = placed(s);
    RadianceImage plus(c.width, c.height), minus(c.width, c.height);
    render_radiance(*render_scene, at, c, T, {}, plus);
    T.q = -T.q;
    Rigid3 body = at.T_world_body[0];
    body.q = -body.q;
    at.set(0, body);
    render_radiance(*render_scene, at, c, T, {}, minus);
    EXPECT_EQ(plus.pixels, minus.pixels);
}

TEST(ManyBodies, NearestOfManyWins) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> place(-20, 20);
    const Mesh ball = icosphere(3, 1);
    for (int i = 0; i < 60; ++i) {  // more than one batch, overlapping
        const Vec3 centre{place(random), place(random), place(random)};
        if (i % 2 == 0) {
            add_sphere(s, 1.5, centre);
        } else {
            add_mesh(s, ball, {random_attitude(random), centre});
        }
    }
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer);
    EXPECT_EQ(tracer->triangle_count(), 30u * 1280u);
    const BodyPoses at = placed(s);
    int hits = 0;
    for (int i = 0; i < 800; ++i) {
        const Ray ray{40.0 * random_direction(random), {}};
        const Vec3 target{0.5 * place(random), 0.5 * place(random), 0.5 * place(random)};
        const Ray aimed{ray.origin, normalized(target - ray.origin)};
        const Hit hit = tracer->intersect(at, aimed, kInfinity);
        double best = kInfinity;
        int body = -1;
        for (std::size_t b = 0; b < s.bodies.size(); ++b) {  // each body alone
            Scene one;
            const Rigid3 inverse_T = inverse(at.T_world_body[b]);
            double t = kInfinity;
            if (std::holds_alternative<ExactShape>(s.bodies[b].shape)) {
                const Vec3 o = inverse_T * aimed.origin, d = inverse_T.q * aimed.direction;
                const double k = -dot(o, d), disc = 1.5 * 1.5 - (dot(o, o) - k * k);
                if (disc > 0 && k > 0) t = k - std::sqrt(disc);
            } else {
                t = static_cast<double>(
                    nearest_by_hand(ball, inverse_T * aimed.origin, inverse_T.q * aimed.direction));
            }
            if (t < best) best = t, body = static_cast<int>(b);
        }
        ASSERT_EQ(hit.body, body) << i;
        if (body < 0) continue;
        ++hits;
        EXPECT_NEAR(hit.range_m, best, 1e-6);
        EXPECT_LT(tracer->intersect(at, aimed, best * 0.999).body, 0);
        EXPECT_LT(dot(hit.geometric_normal, aimed.direction), 0);
    }
    EXPECT_GT(hits, 100);
}

TEST(TracerErrors, BadLightsAreNamed) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_mesh(s, box(1, 1, 1));
    s.lights.push_back({.name = "beacon", .mount = 7});
    const auto on_nobody = render_scene_of(s);
    ASSERT_FALSE(on_nobody);
    EXPECT_NE(on_nobody.error().what.find("beacon"), std::string::npos);
    s.lights[0] = {.name = "panel", .kind = Light::Kind::rectangle, .width_m = 0};
    EXPECT_FALSE(render_scene_of(s));
    s.lights[0].width_m = 1;
    EXPECT_TRUE(render_scene_of(s));
}

TEST(TracerErrors, BadMeshesAreNamed) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_mesh(s, box(1, 1, 1));
    s.meshes[0].faces[3][1] = 99;
    auto tracer = tracer_of(s);
    ASSERT_FALSE(tracer);
    EXPECT_NE(tracer.error().what.find("box"), std::string::npos);
    EXPECT_NE(tracer.error().what.find("99"), std::string::npos);

    s.meshes[0] = box(1, 1, 1);
    s.meshes[0].positions[2].y = std::numeric_limits<float>::quiet_NaN();
    EXPECT_FALSE(tracer_of(s));
    s.meshes[0] = box(1, 1, 1);
    s.meshes[0].face_material[0] = 5;
    EXPECT_FALSE(tracer_of(s));
    s.meshes[0] = box(1, 1, 1);
    EXPECT_TRUE(tracer_of(s));
    add_sphere(s, -1, {});
    EXPECT_FALSE(tracer_of(s));
    s.bodies.back().shape = exact_ellipsoid({1, 0, 1});
    tracer = tracer_of(s);
    ASSERT_FALSE(tracer);
    EXPECT_NE(tracer.error().what.find("semi-axes"), std::string::npos);
    s.bodies.back().shape = exact_ellipsoid({1, 2, 1}, 3);
    EXPECT_FALSE(tracer_of(s));
    s.bodies.back().shape = exact_ellipsoid({1, 2, 1});
    EXPECT_TRUE(tracer_of(s));
    s.materials[0].normal_texture = 4;
    tracer = tracer_of(s);
    ASSERT_FALSE(tracer);
    EXPECT_NE(tracer.error().what.find("texture 4"), std::string::npos);
}

TEST(TracerErrors, AnEmptyMeshIsInvisible) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    add_mesh(s, Mesh{});
    const auto tracer = tracer_of(s);
    ASSERT_TRUE(tracer) << tracer.error().text();
    EXPECT_LT(tracer->intersect(placed(s), {{0, 0, -5}, {0, 0, 1}}, kInfinity).body, 0);
}

}  // namespace
}  // namespace narpa
