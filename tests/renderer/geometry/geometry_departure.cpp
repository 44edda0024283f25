// Rays that leave surfaces: outwards nothing is met twice, inwards nothing is missed, whatever the size and place.
#include <gtest/gtest.h>

#include <bit>

#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

HitBatch batch_of(const Lanes<Hit>& hits) {
    HitBatch batch;
    for (std::size_t i = 0; i < kLanes; ++i) batch.put(i, hits[i]);
    return batch;
}
Vec3Lanes lanes_of(const Lanes<Vec3>& vectors) {
    Vec3Lanes lanes;
    for (std::size_t i = 0; i < kLanes; ++i) lanes.put(i, vectors[i]);
    return lanes;
}
/// Writes the `wanted` lanes of `hits`.
void trace(const Tracer& tracer, const BodyPoses& at, const Lanes<Hit>& from, const Lanes<Vec3>& directions,
           std::uint32_t wanted, Lanes<Hit>& hits) {
    HitBatch batch = batch_of(from);
    tracer.intersect(at, batch, lanes_of(directions), wanted, batch);
    for_each_lane(wanted, [&](std::size_t i) { hits[i] = batch[i]; });
}

constexpr int kFewerDepartures = NARPA_SANITIZED ? 20 : 1;  // the sanitizers are that much slower

constexpr std::uint32_t kAll = (1u << kLanes) - 1;

void add_ellipsoid(Scene& s, const Vec3& semi_axes_m, const Rigid3& T_world_body) {
    Body b;
    b.name = "ellipsoid";
    b.shape = exact_ellipsoid(semi_axes_m);
    b.initial.T_world_body = T_world_body;
    s.bodies.push_back(b);
}

/// On the side of the hit's normal; every fourth within a thousandth of its horizon.
Vec3 leaving(const Hit& hit, std::mt19937_64& random, int i) {
    Vec3 d = random_direction(random);
    const Vec3& n = hit.geometric_normal;
    if (dot(d, n) < 0) d = -d;
    if (i % 4 == 0) d = normalized(d + (1e-3 * std::abs(d.x) - dot(d, n)) * n);
    return d;
}

/// The body alone, of a size and at a place.
Scene alone(const std::string& shape, double radius_m, std::mt19937_64& random) {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    const Rigid3 T{random_attitude(random), {}};
    if (shape == "sphere") {
        add_sphere(s, radius_m, {});
    } else if (shape == "ellipsoid") {
        add_ellipsoid(s, radius_m * Vec3{1, 0.7, 0.4}, T);
    } else if (shape == "smooth") {
        add_mesh(s, icosphere(4, radius_m, true), T);
    } else {
        add_mesh(s, icosphere(4, radius_m), T);
    }
    return s;
}

class LeavingAConvexBody : public testing::TestWithParam<std::string> {};

TEST_P(LeavingAConvexBody, OutwardsMissesItAndInwardsMeetsItFromInside) {
    std::mt19937_64 random(31);
    int outward = 0, met_again = 0, dark = 0, inward = 0, missed = 0, bright = 0;
    for (const double radius : {5e-4, 0.3, 40.0, 6378137.0})
        for (const Vec3 offset : {Vec3{}, Vec3{7e6, -1e3, 2}, Vec3{-3.844e8, 1e7, 3}}) {
            const Scene s = alone(GetParam(), radius, random);
            const auto tracer = Tracer::create(s, 1);
            ASSERT_TRUE(tracer) << tracer.error().text();
            const BodyPoses at = placed(s, offset);
            for (int k = 0; k < 7500 / kFewerDepartures; ++k) {
                Lanes<Hit> from, met;
                Lanes<Vec3> out, in;
                std::uint32_t seen = 0;
                for (std::size_t i = 0; i < kLanes; ++i) {
                    const Vec3 eye = offset + 5 * radius * random_direction(random);
                    const Ray ray{eye, normalized(offset + 0.95 * radius * random_direction(random) - eye)};
                    from[i] = tracer->intersect(at, ray, kInfinity);
                    if (from[i].body < 0) continue;
                    seen |= 1u << i;
                    ASSERT_TRUE(from[i].outside);
                    out[i] = leaving(from[i], random, k);
                    in[i] = -leaving(from[i], random, k);
                }
                outward += std::popcount(seen);
                trace(*tracer, at, from, out, seen, met);
                for (std::size_t i = 0; i < kLanes; ++i) met_again += is_set(seen, i) && met[i].body >= 0;
                dark += std::popcount(tracer->occluded(at, batch_of(from), lanes_of(out), seen));

                for (std::size_t i = 0; i < kLanes; ++i)
                    if (is_set(seen, i)) from[i] = other_side(from[i]);
                inward += std::popcount(seen);
                trace(*tracer, at, from, in, seen, met);
                for (std::size_t i = 0; i < kLanes; ++i)
                    missed += is_set(seen, i) && (met[i].body != 0 || met[i].outside);
                bright += std::popcount(seen & ~tracer->occluded(at, batch_of(from), lanes_of(in), seen));
            }
        }
    EXPECT_GE(outward, 500'000 / kFewerDepartures);
    EXPECT_EQ(met_again, 0) << "of " << outward;
    EXPECT_EQ(dark, 0) << "of " << outward;
    EXPECT_EQ(missed, 0) << "of " << inward;
    EXPECT_EQ(bright, 0) << "of " << inward;
}
INSTANTIATE_TEST_SUITE_P(Shapes, LeavingAConvexBody, testing::Values("mesh", "smooth", "sphere", "ellipsoid"),
                         [](const auto& shape) { return shape.param; });

TEST(LeavingAPlate, ItsInnerSideIsAsFreeAsItsOuterSide) {
    std::mt19937_64 random(34);
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, plate(4, 4, 8), {random_attitude(random), {7e6, 0, 0}});
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    const Rigid3& T = at.T_world_body[0];
    std::uniform_real_distribution<double> within(-1.9, 1.9);
    int met = 0, dark = 0;
    for (int k = 0; k < 4000; ++k) {
        HitBatch from, next;
        Vec3Lanes directions;
        for (std::size_t i = 0; i < kLanes; ++i) {
            const Vec3 above{within(random), within(random), 1};
            const Hit hit = other_side(tracer->intersect(at, {T * above, T.q * Vec3{0, 0, -1}}, kInfinity));
            ASSERT_EQ(hit.body, 0);
            ASSERT_FALSE(hit.outside);
            from.put(i, hit);
            directions.put(i, leaving(hit, random, k));  // every fourth batch within a milliradian of the plate
        }
        tracer->intersect(at, from, directions, kAll, next);
        met += std::popcount(next.met);
        dark += std::popcount(tracer->occluded(at, from, directions, kAll));
    }
    EXPECT_EQ(met, 0);
    EXPECT_EQ(dark, 0);
}

/// Where vertices have normals rays leave from above the face, and perhaps from beside it: such starts are not
/// moved, so that a surface at the end of a ray does not hide itself.
TEST(LeavingASmoothMesh, TheEndOfARayIsWhereItWasMeasuredTo) {
    std::mt19937_64 random(35);
    Scene s;
    s.materials.push_back(lambert(0.5f));
    add_mesh(s, icosphere(0, 1, true));
    add_mesh(s, plate(100, 100, 1), {{}, {0, 0, -3}});
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    int above = 0, hidden = 0;
    for (int k = 0; k < 2000; ++k) {
        const Vec3 side = random_direction(random);
        const Hit hit = tracer->intersect(at, {2 * side, -side}, kInfinity);
        ASSERT_EQ(hit.body, 0);
        const Vec3 start = at.T_world_body[0] * hit.departure_body;
        if (dot(hit.geometric_normal, start - hit.position) < 1e-3) continue;
        const Vec3 down = normalized(Vec3{0.3 * side.x, 0.3 * side.y, -1});
        if (!(dot(hit.geometric_normal, down) > 0.05)) continue;
        ++above;
        const double range_m = (-3 - start.z) / down.z;
        hidden += tracer->occluded(at, hit, down, range_m - 1e-5);
    }
    EXPECT_GT(above, 300);
    EXPECT_EQ(hidden, 0) << "of " << above;
}

/// Sixteen paths that bounce about inside a closed body. Counts those that get out; each of them starts anew.
struct Bounces {
    int bounces = 0, escapes = 0;
};
Bounces bounce_inside(const Scene& s, const Vec3& offset, int wanted) {
    const auto tracer = Tracer::create(s, 1);
    EXPECT_TRUE(tracer);
    const BodyPoses at = placed(s, offset);
    std::mt19937_64 random(32);
    const auto start = [&] {
        return tracer->intersect(at, {at.T_world_body[0].t, random_direction(random)}, kInfinity);
    };
    Lanes<Hit> hits;
    for (Hit& h : hits) h = start();
    Bounces b;
    Lanes<Vec3> directions;
    while (b.bounces < wanted) {
        for (std::size_t i = 0; i < kLanes; ++i) directions[i] = leaving(hits[i], random, b.bounces);
        trace(*tracer, at, hits, directions, kAll, hits);
        b.bounces += static_cast<int>(kLanes);
        for (Hit& h : hits)
            if (h.body < 0 || h.outside) {
                ++b.escapes;
                h = start();
            }
    }
    return b;
}

TEST(BouncingInside, NothingEscapes) {
    std::mt19937_64 random(33);
    const Rigid3 T{random_attitude(random), {}};
    const auto body = [&](Mesh mesh) {
        Scene s;
        s.materials.push_back(lambert(0.5f));
        add_mesh(s, std::move(mesh), T);
        return s;
    };
    const std::vector<std::pair<std::string, Scene>> bodies{
        {"icosphere", body(icosphere(3, 1))},   {"smooth icosphere", body(icosphere(3, 1, true))},
        {"bumpy", body(bumpy(4, 2.5, 0.3))},    {"box", body(box(1, 2, 3))},
        {"1 mm", body(icosphere(3, 5e-4))},     {"Earth", body(icosphere(3, 6378137))},
        {"sphere", alone("sphere", 1, random)}, {"ellipsoid", alone("ellipsoid", 1, random)}};
    for (const auto& [name, scene] : bodies) {
        const Bounces b = bounce_inside(scene, {3.844e8, -7e6, 5}, 1'000'000 / kFewerDepartures);
        EXPECT_EQ(b.escapes, 0) << name << " of " << b.bounces;
    }
}

}  // namespace
}  // namespace narpa
