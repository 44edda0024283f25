// Which bodies a tile of the image may show: none is missed, and little more is marked.
#include "renderer/frame/culling/tile_culling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/ellipsoid.h"
#include "renderer/geometry/mesh_shape.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/cameras.h"
#include "tests/support/lens_ray.h"

namespace narpa {
namespace {

using Random = std::mt19937_64;

double uniform(Random& random, double low, double high) {
    return std::uniform_real_distribution(low, high)(random);
}

Vec3 random_direction(Random& random) {
    std::normal_distribution<double> normal;
    return normalized(Vec3{normal(random), normal(random), normal(random)});
}

Quat random_attitude(Random& random) {
    std::normal_distribution<double> normal;
    return normalized(Quat{normal(random), normal(random), normal(random), normal(random)});
}

/// Triangles that grow from one another: a strip that wanders, some of it far larger than the rest.
Mesh wandering_strip(Random& random, int faces, double size_m) {
    Mesh m;
    Vec3 p{uniform(random, -size_m, size_m), 0, 0};
    for (int i = 0; i < faces + 2; ++i) {
        p += uniform(random, 0.02, i % 10 == 0 ? 1.5 : 0.2) * size_m * random_direction(random);
        p *= 0.97;
        m.positions.push_back(vec_cast<float>(p));
    }
    for (std::uint32_t i = 0; i + 2 < m.positions.size(); ++i) m.faces.push_back({i, i + 1, i + 2});
    m.face_material.assign(m.faces.size(), 0);
    return m;
}

/// A cylinder along x of this many flat sides.
Mesh tube(double length_m, double radius_m, int sides) {
    Mesh m;
    for (int i = 0; i < sides; ++i)
        for (const double x : {-0.5, 0.5}) {
            const double angle = 2 * 3.141592653589793 * i / sides;
            m.positions.push_back(
                vec_cast<float>(Vec3{x * length_m, radius_m * std::cos(angle), radius_m * std::sin(angle)}));
        }
    const auto n = static_cast<std::uint32_t>(sides);
    for (std::uint32_t i = 0; i < n; ++i) {
        const std::uint32_t a = 2 * i, b = 2 * ((i + 1) % n);
        m.faces.push_back({a, b, a + 1}), m.faces.push_back({b, b + 1, a + 1});
        if (i > 1) m.faces.push_back({0, 2 * i, 2 * i - 2}), m.faces.push_back({1, 2 * i - 1, 2 * i + 1});
    }
    m.face_material.assign(m.faces.size(), 0);
    return m;
}

Camera camera_of(int width, int height, double f_px) {
    Camera c;
    c.width = width, c.height = height;
    test::set_pinhole(c, f_px, 1.1 * f_px, 0.47 * width, 0.52 * height);
    return c;
}

Tracer tracer_of(const Scene& scene) {
    auto tracer = Tracer::create(scene, 1);
    EXPECT_TRUE(tracer) << tracer.error().what;
    return std::move(*tracer);
}

Body mesh_body(int mesh) {
    return {.name = "mesh " + std::to_string(mesh), .shape = mesh};
}

/// All kinds of shapes, several of each: more than a tile's list holds.
Scene mixed_scene(Random& random) {
    Scene s;
    s.materials.emplace_back();
    s.meshes = {wandering_strip(random, 400, 1), wandering_strip(random, 12, 3), tube(10, 0.2, 24), tube(1, 1, 6)};
    for (int i = 0; i < 8; ++i) s.bodies.push_back(mesh_body(i % 4));
    for (int i = 0; i < 5; ++i)
        s.bodies.push_back({.name = "sphere", .shape = exact_sphere(std::pow(10.0, i - 2))});
    for (int i = 0; i < 7; ++i)
        s.bodies.push_back(
            {.name = "ellipsoid",
             .shape = exact_ellipsoid({std::exp(uniform(random, -3, 3)), std::exp(uniform(random, -3, 3)),
                                       std::exp(uniform(random, -3, 3))})});
    return s;
}

/// Bodies about a camera: some it stands in, some behind it in part, most before it and many of these at the rim
/// of the image, some so far that they are less than a pixel.
void place_about(const Tracer& tracer, const Rigid3& T_world_camera, const Camera& camera, Random& random,
                 BodyPoses& at) {
    for (std::size_t b = 0; b < at.T_world_body.size(); ++b) {
        const double size_m = tracer.bounding_radius_m(b);
        Vec3 direction = random_direction(random);  // anywhere
        double distance_m = size_m * uniform(random, 0, 1.2);
        if (const int kind = static_cast<int>(random() % 8); kind >= 2) {
            const double x = uniform(random, -0.1, 1.1) * camera.width,
                         y = uniform(random, -0.1, 1.1) * camera.height;
            direction = camera_ray(camera, {T_world_camera.q, {}}, x, y).direction;
            distance_m = size_m * std::exp(uniform(random, 0, kind == 2 ? 17 : 4));
        }
        at.set(b, {random_attitude(random), T_world_camera.t + distance_m * direction});
    }
}

struct Tally {
    std::size_t met = 0, missed = 0;
};

/// Of a ray of a picture taken over time; one in three is next to its start or its end.
double random_time(Random& random) {
    const double time = uniform(random, 0, 1);
    return time < 1.0 / 6 ? 1e-3 * time : time > 5.0 / 6 ? 1 - 1e-3 * (1 - time) : time;
}

/// Rays through random points of the image and of the lens, half of them through its rim.
Tally send_rays(const Tracer& tracer, const Camera& camera, const TileCulling& cover, const BodyPoses& at,
                const CameraPose& camera_pose, const Lens* lens, int rays, Random& random) {
    Tally tally;
    for (int i = 0; i < rays; ++i) {
        const double time = camera_pose.over_time() ? random_time(random) : kMidExposure;
        const Rigid3 T_world_camera = camera_pose.at(time);
        const double x = uniform(random, -0.5, camera.width - 0.5), y = uniform(random, -0.5, camera.height - 0.5);
        Ray ray = lens != nullptr ? test::lens_ray(camera, *lens, T_world_camera, x, y,
                                                   aperture_point(*lens, uniform(random, 0, 1),
                                                                  i % 2 == 0 ? 0.999999 : uniform(random, 0, 1)))
                                  : camera_ray(camera, T_world_camera, x, y);
        ray.time = time;
        const auto listed =
            cover.bodies(static_cast<int>((x + 0.5) / kTileSize), static_cast<int>((y + 0.5) / kTileSize));
        // The body behind the first one, too.
        int skip = -1;
        for (int behind = 0; behind < 2; ++behind) {
            const Hit hit = tracer.intersect(at, ray, 1e300, skip);
            if (hit.body < 0) break;
            ++tally.met;
            if (!std::binary_search(listed.begin(), listed.end(), static_cast<std::uint32_t>(hit.body)))
                ++tally.missed;
            skip = hit.body;
        }
    }
    return tally;
}

void expect_no_misses(double far_m, bool with_lens, std::uint64_t seed) {
    Random random(seed);
    Tally all;
    for (int s = 0; s < 3; ++s) {
        const Scene scene = mixed_scene(random);
        const Tracer tracer = tracer_of(scene);
        for (const double f_px : {60.0, 200.0, 3000.0}) {
            const Camera camera = camera_of(150, 115, f_px);
            TileCulling cover(tracer, camera);
            BodyPoses at(scene.bodies.size());
            for (int pose = 0; pose < 25; ++pose) {
                const Rigid3 T_world_camera{random_attitude(random), far_m * random_direction(random)};
                place_about(tracer, T_world_camera, camera, random, at);
                const Lens lens{std::exp(uniform(random, -7, 0)), pose % 5 == 0
                                                                      ? std::numeric_limits<double>::infinity()
                                                                      : std::exp(uniform(random, 0, 5))};
                cover.update(at, T_world_camera, with_lens ? &lens : nullptr);
                const Tally t =
                    send_rays(tracer, camera, cover, at, T_world_camera, with_lens ? &lens : nullptr, 1500, random);
                all.met += t.met, all.missed += t.missed;
            }
        }
    }
    EXPECT_EQ(all.missed, 0u) << "of " << all.met;
    EXPECT_GT(all.met, 200'000u);
}

TEST(TileCulling, MissesNothingOfAPinhole) {
    expect_no_misses(0, false, 1);
}

TEST(TileCulling, MissesNothingOfALens) {
    expect_no_misses(0, true, 2);
}

TEST(TileCulling, MissesNothingAtTheDistanceOfTheMoon) {
    expect_no_misses(4e8, false, 3);
    expect_no_misses(4e8, true, 4);
}

/// Turned by up to `angle_rad` and moved by up to `way_m`.
Rigid3 moved_randomly(const Rigid3& T, double angle_rad, double way_m, Random& random) {
    return {normalized(exp_rotation(uniform(random, 0, angle_rad) * random_direction(random)) * T.q),
            T.t + uniform(random, 0, way_m) * random_direction(random)};
}

/// Bodies and camera move within the exposure: some of them slowly, some by half a turn, some together.
void expect_no_misses_in_motion(const Camera& camera, double far_m, bool with_lens, std::uint64_t seed) {
    Random random(seed);
    const Scene scene = mixed_scene(random);
    const Tracer tracer = tracer_of(scene);
    TileCulling cover(tracer, camera);
    BodyPoses at(scene.bodies.size());
    Tally all;
    for (int pose = 0; pose < 50; ++pose) {
        const Rigid3 start{random_attitude(random), far_m * random_direction(random)};
        place_about(tracer, start, camera, random, at);
        const Vec3 together = pose % 3 == 0 ? 70.0 * random_direction(random) : Vec3{};
        Rigid3 end = pose % 4 == 0 ? start : moved_randomly(start, std::exp(uniform(random, -8, 0.5)), 0.1, random);
        end.t += together;
        for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
            const Rigid3 from = at.T_world_body[b];
            const double size_m = tracer.bounding_radius_m(b);
            Rigid3 to = b % 4 == 0 ? from
                                   : moved_randomly(from, std::exp(uniform(random, -8, 1.2)),
                                                    size_m * std::exp(uniform(random, -6, 1)), random);
            to.t += together;
            at.set(b, from, to);
        }
        const Lens lens{std::exp(uniform(random, -7, 0)), std::exp(uniform(random, 0, 5))};
        const CameraPose camera_pose(start, end);
        cover.update(at, camera_pose, with_lens ? &lens : nullptr);
        const Tally t =
            send_rays(tracer, camera, cover, at, camera_pose, with_lens ? &lens : nullptr, 1500, random);
        all.met += t.met, all.missed += t.missed;
    }
    EXPECT_EQ(all.missed, 0u) << "of " << all.met;
    EXPECT_GT(all.met, 20'000u);
}

TEST(TileCulling, MissesNothingThatMoves) {
    for (const double f_px : {60.0, 200.0, 3000.0})
        expect_no_misses_in_motion(camera_of(150, 115, f_px), 0, false, static_cast<std::uint64_t>(f_px));
    expect_no_misses_in_motion(camera_of(150, 115, 200), 0, true, 11);
    expect_no_misses_in_motion(camera_of(150, 115, 200), 4e8, false, 12);
}

// Bodies of 0.02 px that move by up to 8 px, or that the camera moves past: nothing is to spare at the ends of the
// exposure.
TEST(TileCulling, SweepsToTheEndsOfAMotion) {
    enum Kind { body_moves, camera_moves, camera_turns, body_turns, kinds };
    constexpr double kSize_m = 0.002, kArm_m = 10, kDistance_m = 20;
    Random random(9);
    Scene scene;
    scene.materials.emplace_back();
    scene.meshes = {tube(kSize_m, kSize_m, 6)};
    for (Vec3f& p : scene.meshes[0].positions) p.x += static_cast<float>(kArm_m);
    scene.bodies = {{.name = "sphere", .shape = exact_sphere(kSize_m)}, {.name = "on an arm", .shape = 0}};
    const Tracer tracer = tracer_of(scene);
    const Camera camera = camera_of(150, 115, 200);
    TileCulling cover(tracer, camera);
    for (int kind = 0; kind < kinds; ++kind) {
        std::size_t seen = 0, missed = 0;
        for (int trial = 0; trial < 2000; ++trial) {
            const double direction = uniform(random, 0, 2 * kPi), way_m = uniform(random, 0.3, 0.7);
            const Vec3 along{std::cos(direction), std::sin(direction), 0};
            const Vec3 axis{-along.y, along.x, 0};
            const Vec3 place{uniform(random, -6, 6), uniform(random, -5, 5), kDistance_m};
            BodyPoses at(2);
            for (std::size_t b = 0; b < 2; ++b) at.set(b, {{}, {0, 0, -100}});
            Rigid3 end;
            const std::uint32_t body = kind == body_turns ? 1 : 0;
            if (kind == body_turns) {
                const Quat start = exp_rotation({0, 0, direction});
                at.set(1, {start, place - kArm_m * along},
                       {exp_rotation({0, 0, way_m / kArm_m}) * start, place - kArm_m * along});
            } else {
                at.set(0, {{}, place}, {{}, kind == body_moves ? place + way_m * along : place});
            }
            if (kind == camera_moves) end.t = way_m * along;
            if (kind == camera_turns) end.q = exp_rotation(way_m / kDistance_m * axis);
            const CameraPose camera_pose({}, end);
            cover.update(at, camera_pose, nullptr);
            for (const double time : {0.0, 1.0}) {
                const Vec3 world = at.T_world_body_at(body, time) * Vec3{body == 1 ? kArm_m : 0, 0, 0};
                const auto p = camera.model->project(inverse(camera_pose.at(time)) * world);
                if (!p || p->x < -0.5 || p->y < -0.5 || p->x > 149.5 || p->y > 114.5) continue;
                const auto listed = cover.bodies(static_cast<int>((p->x + 0.5) / kTileSize),
                                                 static_cast<int>((p->y + 0.5) / kTileSize));
                ++seen;
                missed += std::ranges::count(listed, body) == 0;
            }
        }
        EXPECT_EQ(missed, 0u) << kind << ": of " << seen;
        EXPECT_GT(seen, 3000u);
    }
}

TEST(TileCulling, MissesNothingThatMovesBeforeADistortingLens) {
    Camera camera = camera_of(150, 115, 100);
    camera.model = test::brown_conrady(test::pinhole_of(camera), {-0.2, 0.05, 1e-3, 1e-3, 0});
    expect_no_misses_in_motion(camera, 0, false, 13);
    camera.model = test::kannala_brandt({80, 80, 74.5, 57}, {-0.02, 0.004, 0, 0});
    expect_no_misses_in_motion(camera, 0, true, 14);
}

/// Pixels that a body covers, pixels of the tiles that these are in, and of those that the cover marks.
struct Areas {
    int covered = 0, needed = 0, marked = 0;
};

Areas areas_of(const Tracer& tracer, const Camera& camera, const BodyPoses& at,
               const CameraPose& camera_pose = {}) {
    TileCulling cover(tracer, camera);
    cover.update(at, camera_pose, nullptr);
    const int times = camera_pose.over_time() ? 12 : 0;  // parts of the exposure
    Areas a;
    std::vector<int> covered_in(static_cast<std::size_t>(cover.tiles_x() * cover.tiles_y()), 0);
    for (int y = 0; y < camera.height; ++y)
        for (int x = 0; x < camera.width; ++x) {
            const int tile_x = x / kTileSize, tile_y = y / kTileSize;
            int covered = 0;
            for (int k = 0; covered == 0 && k <= times; ++k) {
                const double time = times > 0 ? static_cast<double>(k) / times : kMidExposure;
                Ray ray = camera_ray(camera, camera_pose.at(time), x, y);
                ray.time = time;
                covered = tracer.intersect(at, ray, 1e300).body >= 0 ? 1 : 0;
            }
            a.covered += covered;
            covered_in[static_cast<std::size_t>(tile_y * cover.tiles_x() + tile_x)] += covered;
            a.marked += cover.bodies(tile_x, tile_y).empty() ? 0 : 1;
        }
    for (const int covered : covered_in) a.needed += covered > 0 ? kTileSize * kTileSize : 0;
    return a;
}

/// Modules in a row along x, with two pairs of wings askew to them.
Mesh station() {
    Mesh all;
    const auto add = [&](Mesh part, const Rigid3& T) {
        const auto first = static_cast<std::uint32_t>(all.positions.size());
        for (const Vec3f& p : part.positions) all.positions.push_back(vec_cast<float>(T * vec_cast<double>(p)));
        for (const auto& f : part.faces) all.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
    };
    add(tube(12, 1.2, 32), {});
    add(tube(8, 2, 32), {{std::sqrt(0.5), 0, 0, std::sqrt(0.5)}, {2, 0, 0}});
    Mesh wing;
    wing.positions = {{-1.5f, -9, 0}, {1.5f, -9, 0}, {1.5f, 9, 0}, {-1.5f, 9, 0}};
    wing.faces = {{0, 1, 2}, {0, 2, 3}};
    for (const double x : {-4.0, 4.5}) add(wing, {exp_rotation({0.3, 0.7, 0.4}), {x, 0, 1}});
    all.face_material.assign(all.faces.size(), 0);
    return all;
}

// An outline costs half a tile on average whatever is done: shapes with much of it in the image are measured by the
// tiles that cannot be spared.
TEST(TileCulling, MarksLittleMoreThanBodiesCover) {
    Random random(5);
    const Camera camera = camera_of(1024, 1024, 1000);
    Scene scene;
    scene.materials.emplace_back();
    scene.meshes = {tube(40, 1.5, 48), station()};
    scene.bodies = {{.name = "long thin craft", .shape = 0}, {.name = "station", .shape = 1}};
    scene.bodies.push_back({.name = "sphere", .shape = exact_sphere(7)});
    scene.bodies.push_back({.name = "ellipsoid", .shape = exact_ellipsoid({12, 3, 5})});
    const Tracer tracer = tracer_of(scene);
    for (std::size_t body = 0; body < scene.bodies.size(); ++body) {
        Areas sum;
        for (int pose = 0; pose < 3; ++pose) {
            BodyPoses at(scene.bodies.size());
            for (std::size_t other = 0; other < scene.bodies.size(); ++other) at.set(other, {{}, {0, 0, -1000}});
            const Quat roll = exp_rotation({0, 0, uniform(random, 0, 3)}), tilt = exp_rotation({0.4, 0.5, 0});
            at.set(body, {roll * tilt, {0, 0, 25}});
            const Areas a = areas_of(tracer, camera, at);
            sum.covered += a.covered, sum.needed += a.needed, sum.marked += a.marked;
        }
        const bool exact = !std::holds_alternative<int>(scene.bodies[body].shape);
        EXPECT_GT(sum.covered, 3 * 40'000) << scene.bodies[body].name;
        EXPECT_LE(sum.marked, (exact ? 1.05 : 1.3) * sum.needed) << scene.bodies[body].name;
        EXPECT_LE(sum.marked, (body == 1 ? 1.45 : 1.3) * sum.covered) << scene.bodies[body].name;
    }
}

// Moves by 40 px, by 300 px (more than the sweep is divided for), turns by a quarter; the camera turns by 40 px.
TEST(TileCulling, MarksLittleMoreThanMovingBodiesSweep) {
    const Camera camera = camera_of(512, 512, 500);
    Scene scene;
    scene.materials.emplace_back();
    scene.meshes = {station()};
    scene.bodies = {{.name = "station", .shape = 0}};
    const Tracer tracer = tracer_of(scene);
    const Rigid3 start{exp_rotation({0.4, 0.5, 0}), {0, 0, 30}};
    const auto expect_tight = [&](const Rigid3& end, const CameraPose& camera_pose, double most) {
        BodyPoses at(1);
        at.set(0, start, end);
        const Areas a = areas_of(tracer, camera, at, camera_pose);
        EXPECT_GT(a.covered, 15'000);
        EXPECT_LE(a.marked, most * a.needed) << a.needed;
    };
    const CameraPose still({}, {});
    expect_tight({start.q, start.t + Vec3{2.4, 0, 0}}, still, 1.3);
    expect_tight({start.q, start.t + Vec3{0, 18, 0}}, still, 1.6);
    expect_tight({exp_rotation({0, 0, 1.5}) * start.q, start.t}, still, 1.7);
    expect_tight(start, {{}, {exp_rotation({0, 0.08, 0}), {}}}, 1.3);
}

// A planet seen from low above it: the outline of its image is neither an ellipse nor wholly in front.
TEST(TileCulling, FollowsTheHorizon) {
    const Camera camera = camera_of(512, 512, 400);
    Scene scene;
    scene.materials.emplace_back();
    scene.bodies = {{.name = "Earth", .shape = exact_ellipsoid({6378137, 6378137, 6356752})}};
    const Tracer tracer = tracer_of(scene);
    for (const double height_m : {2.0, 400e3}) {
        BodyPoses at(1);
        at.set(0, {exp_rotation({0.3, 0, 0}), exp_rotation({0, 0, 0.3}) * Vec3{0, 6378137 + height_m, 0}});
        const Areas a = areas_of(tracer, camera, at);
        EXPECT_GT(a.covered, 512 * 512 / 8);
        EXPECT_LE(a.marked, 1.05 * a.needed);
    }
}

TEST(TileCulling, ListsNothingWhereNothingIs) {
    Random random(6);
    const Scene scene = mixed_scene(random);
    const Tracer tracer = tracer_of(scene);
    const Camera camera = camera_of(100, 60, 100);
    TileCulling cover(tracer, camera);
    EXPECT_EQ(cover.tiles_x(), 13);
    EXPECT_EQ(cover.tiles_y(), 8);
    BodyPoses at(scene.bodies.size());
    for (std::size_t b = 0; b < scene.bodies.size(); ++b)
        at.set(b, {random_attitude(random), {0, b % 2 == 0 ? 0 : 1e5, b % 2 == 0 ? -1e5 : 3e4}});
    cover.update(at, {}, nullptr);
    for (int y = 0; y < cover.tiles_y(); ++y)
        for (int x = 0; x < cover.tiles_x(); ++x)
            EXPECT_TRUE(cover.bodies(x, y).empty()) << x << ' ' << y << ' ' << cover.bodies(x, y)[0];
}

TEST(TileCulling, ListsAllWhereMoreCrowdThanItCounts) {
    Scene scene;
    scene.materials.emplace_back();
    for (int i = 0; i < 40; ++i) scene.bodies.push_back({.name = "sphere", .shape = exact_sphere(0.5)});
    const Tracer tracer = tracer_of(scene);
    Camera camera = camera_of(64, 64, 64);
    test::set_principal_point(camera, 27.5, 27.5);  // the middle of a tile
    TileCulling cover(tracer, camera);
    BodyPoses at(scene.bodies.size());
    for (const std::size_t crowd : {TileCulling::kMaxListed, TileCulling::kMaxListed + 1}) {
        for (std::size_t b = 0; b < 40; ++b)
            at.set(b, {{}, {0, 0, b % 2 == 0 && b / 2 < crowd ? 20.0 + static_cast<double>(b) : -5.0}});
        cover.update(at, {}, nullptr);
        const auto listed = cover.bodies(3, 3);
        EXPECT_EQ(listed.size(), crowd <= TileCulling::kMaxListed ? crowd : 40);
        for (std::size_t i = 0; i < listed.size(); ++i)
            EXPECT_EQ(listed[i], crowd <= TileCulling::kMaxListed ? 2 * i : i);
        EXPECT_TRUE(cover.bodies(0, 0).empty());
    }
}

// What a frame does anew when a body has moved: its place, and this.
TEST(TileCulling, AMovedBodyAllocatesNothing) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "the heap is the sanitizer's own";
    Random random(7);
    const Scene scene = mixed_scene(random);
    const Tracer tracer = tracer_of(scene);
    const Camera camera = camera_of(640, 480, 400);
    TileCulling cover(tracer, camera);
    BodyPoses at(scene.bodies.size());
    const Lens lens{0.02, 5};
    const test::AllocationCounter counter;
    for (int frame = 0; frame < 10; ++frame) {
        place_about(tracer, {}, camera, random, at);
        cover.update(at, {}, frame % 2 == 0 ? &lens : nullptr);
    }
    EXPECT_EQ(counter.on_this_thread(), 0u);
}

TEST(BoxTree, LeavesHoldEveryPointOfTheMesh) {
    Random random(8);
    for (const Mesh& mesh : {wandering_strip(random, 3000, 1), tube(10, 0.2, 24), station(), Mesh{}}) {
        const std::vector<BoxNode> nodes = box_tree(mesh);
        std::vector<BoxNode> leaves;
        for (std::size_t i = 0; i < nodes.size(); ++i) {
            if (nodes[i].children == 0) leaves.push_back(nodes[i]);
            if (nodes[i].children != 0) {
                EXPECT_GT(nodes[i].children, i);
            }
        }
        EXPECT_LE(leaves.size(), kBoxLeaves);
        EXPECT_EQ(nodes.empty(), mesh.faces.empty());
        for (const auto& f : mesh.faces)
            for (int i = 0; i < 20; ++i) {
                const double a = std::sqrt(uniform(random, 0, 1)), b = uniform(random, 0, 1);
                const Vec3 p = (1 - a) * vec_cast<double>(mesh.positions[f[0]]) +
                               a * (1 - b) * vec_cast<double>(mesh.positions[f[1]]) +
                               a * b * vec_cast<double>(mesh.positions[f[2]]);
                EXPECT_TRUE(std::any_of(leaves.begin(), leaves.end(), [&](const BoxNode& leaf) {
                    const double slack = 1e-5;
                    return p.x >= leaf.low[0] - slack && p.x <= leaf.high[0] + slack &&
                           p.y >= leaf.low[1] - slack && p.y <= leaf.high[1] + slack &&
                           p.z >= leaf.low[2] - slack && p.z <= leaf.high[2] + slack;
                }));
            }
    }
}

}  // namespace
}  // namespace narpa
