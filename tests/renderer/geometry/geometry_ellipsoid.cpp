// Ellipsoids: planets as they are, solved in double; and how textures lie on them and on meshes.
#include <gtest/gtest.h>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/ellipsoid.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
using Wide = Vec<long double>;

/// World Geodetic System 1984: equatorial radius and 1 / flattening (NGA.STND.0036, 2014).
constexpr double kEquator = 6378137, kFlattening = 1 / 298.257223563, kPole = kEquator * (1 - kFlattening);
constexpr Vec3 kEarth{kEquator, kEquator, kPole};

Scene ellipsoid(const Vec3& semi_axes_m, const Rigid3& T_world_body = {}) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    Body b;
    b.name = "planet";
    b.shape = exact_ellipsoid(semi_axes_m);
    b.initial.T_world_body = T_world_body;
    s.bodies.push_back(b);
    return s;
}

/// Gives the material a texture, so that hits carry texture coordinates.
void texture(Scene& s) {
    s.textures.push_back({"white", 1, 1, {65535, 65535, 65535}});
    s.materials[0].texture = 0;
}

TEST(EllipsoidShape, CrossingsAreThoseOfExtendedPrecision) {
    std::mt19937_64 random(21);
    std::uniform_real_distribution<double> unit(0, 1);
    int hits = 0, misses = 0, inside = 0;
    for (int i = 0; i < 200'000; ++i) {
        // 1 mm to 1e9 m, up to 20 times as long as wide, seen from inside, close by and from up to 1e6 times as
        // far.
        const double size = std::pow(10.0, 12 * unit(random) - 3);
        const Vec3 axes = size * Vec3{0.05 + 0.95 * unit(random), 0.05 + 0.95 * unit(random), 1};
        const double distance = size * (i % 5 == 0 ? 0.04 * unit(random) : 1.01 * std::pow(10.0, 6 * unit(random)));
        const Vec3 o = distance * random_direction(random);
        const Vec3 d = normalized(1.2 * axes * random_direction(random) - o);

        // The same in extended precision: the quadratic a t^2 - 2 b t + c about the point of closest approach.
        const Wide scale{1 / static_cast<long double>(axes.x), 1 / static_cast<long double>(axes.y),
                         1 / static_cast<long double>(axes.z)};
        const Wide wo = vec_cast<long double>(o) * scale, wd = vec_cast<long double>(d) * scale;
        const long double a = dot(wd, wd), b = -dot(wo, wd);
        const Wide closest = wo + (b / a) * wd;
        const long double half2 = 1 - dot(closest, closest);
        const auto crossing = EllipsoidShape(axes).first_crossing(o, d);
        // Where each input moves by half a unit in the last place, the line's distance from the squeezed sphere
        // moves by about this much: closer to the limb either answer is right.
        const long double uncertain = 0x1p-53L * (norm(wo) + 1);
        if (std::abs(half2) < 8 * uncertain) continue;
        const long double near = b / a - std::sqrt(half2 / a), far = b / a + std::sqrt(half2 / a);
        if (half2 < 0 || far < 0) {
            ASSERT_EQ(crossing.range, kInfinity) << i;
            ++misses;
            continue;
        }
        ASSERT_LT(crossing.range, kInfinity) << i;
        ++hits;
        const long double expected = near >= 0 ? near : far;
        ASSERT_EQ(crossing.outside, near >= 0) << i;
        inside += !crossing.outside;
        // First-order change of t for half a unit in the last place of every input, and as much again for the
        // squeezing: n.(do + t dd) / n.d; eight times that, as for the sphere.
        const Wide p = wo + expected * wd, n = p * scale;
        const Wide moved{std::abs(o.x) + expected * std::abs(d.x), std::abs(o.y) + expected * std::abs(d.y),
                         std::abs(o.z) + expected * std::abs(d.z)};
        const long double sway = std::abs(n.x) * moved.x + std::abs(n.y) * moved.y + std::abs(n.z) * moved.z;
        const long double bound = 8 * 0x1p-53L * (expected + 2 * sway / std::abs(dot(n, vec_cast<long double>(d))));
        ASSERT_LE(std::abs(static_cast<long double>(crossing.range) - expected), bound) << i;
    }
    EXPECT_GT(hits, 50'000);
    EXPECT_GT(misses, 10'000);
    EXPECT_GT(inside, 30'000);
}

TEST(EllipsoidShape, OfEqualAxesIsTheSphereToTheBit) {
    std::mt19937_64 random(22);
    for (int i = 0; i < 10'000; ++i) {
        const double radius = 0.1 + i;
        const Vec3 o = 3 * radius * random_direction(random), d = normalized(radius * random_direction(random) - o);
        const auto roots = sphere_roots(o, d, radius);
        const auto crossing = EllipsoidShape({radius, radius, radius}).first_crossing(o, d);
        ASSERT_EQ(crossing.range, roots.any() ? roots.near : kInfinity);
    }
}

TEST(EarthFromFourHundredKilometres, LimbIsWithinAHundredthOfAPixelOfTheClosedForm) {
    std::mt19937_64 random(23);
    Camera c = camera(500, 500, 1319.5);
    double worst_px = 0;
    int columns = 0;
    for (const double latitude : {0.0, 0.5, 0.9, kPi / 2}) {
        const Rigid3 T_world_body{random_attitude(random), {3.844e8, -1e7, 2e6}};
        const Scene s = ellipsoid(kEarth, T_world_body);
        const auto tracer = Tracer::create(s, 1);
        ASSERT_TRUE(tracer) << tracer.error().text();
        const BodyPoses at = placed(s);
        // 400 km above the point of this geodetic latitude, the horizon in the middle of the picture.
        const Vec3 up{std::cos(latitude), 0, std::sin(latitude)};
        const Vec3 ground = kEarth * kEarth * up / norm(kEarth * up);
        const Vec3 eye = ground + 4e5 * up;
        const double dip = std::acos(kEquator / (kEquator + 4e5));
        const double azimuth = 6 * std::generate_canonical<double, 53>(random);
        const Vec3 north{-std::sin(latitude), 0, std::cos(latitude)}, east{0, 1, 0};
        const Vec3 ahead = std::cos(azimuth) * north + std::sin(azimuth) * east;
        const Rigid3 T_body_camera = looking(eye, eye + std::cos(dip) * ahead - std::sin(dip) * up, up);
        const Rigid3 T_world_camera = T_world_body * T_body_camera;
        for (double x = 0; x < c.width; x += 12.3, ++columns) {
            const auto meets = [&](double y) {
                return tracer->intersect(at, camera_ray(c, T_world_camera, x, y), kInfinity).body == 0;
            };
            double sky = 0, earth = c.height - 1;
            ASSERT_TRUE(!meets(sky) && meets(earth));
            for (int i = 0; i < 50; ++i) (meets(0.5 * (sky + earth)) ? earth : sky) = 0.5 * (sky + earth);

            // Along the column d = a + y b; it touches where (d.Se)^2 = (d.Sd)(e.Se - 1), S = diag(1 /
            // semi-axes^2).
            const Wide squeeze{1 / static_cast<long double>(kEarth.x), 1 / static_cast<long double>(kEarth.y),
                               1 / static_cast<long double>(kEarth.z)};
            const Vec3 a_camera{(x - pinhole_of(c).cx) / pinhole_of(c).fx, -pinhole_of(c).cy / pinhole_of(c).fy, 1},
                b_camera{0, 1 / pinhole_of(c).fy, 0};
            // The eye as the placement's rounding has it: 4e-8 m.
            const Vec3 eye_body = conjugate(T_world_body.q) * (T_world_camera.t - T_world_body.t);
            const Wide e = vec_cast<long double>(eye_body) * squeeze,
                       a = vec_cast<long double>(T_body_camera.q * a_camera) * squeeze,
                       b = vec_cast<long double>(T_body_camera.q * b_camera) * squeeze;
            const long double h = dot(e, e) - 1, qa = dot(b, e) * dot(b, e) - h * dot(b, b),
                              qb = dot(a, e) * dot(b, e) - h * dot(a, b),
                              qc = dot(a, e) * dot(a, e) - h * dot(a, a);
            const long double root = std::sqrt(qb * qb - qa * qc), y1 = (-qb + root) / qa, y2 = (-qb - root) / qa;
            const double limb =
                static_cast<double>(std::abs(y1 - 0.5 * c.height) < std::abs(y2 - 0.5 * c.height) ? y1 : y2);
            worst_px = std::max(worst_px, std::abs(0.5 * (sky + earth) - limb));
        }
    }
    EXPECT_GT(columns, 150);
    EXPECT_LE(worst_px, 0.01);  // 17 m
    EXPECT_LE(worst_px, 1e-6);  // and in fact 2 mm, of 2293 km
}

TEST(Earth, HitsCarryPositionNormalAndGeodeticCoordinates) {
    std::mt19937_64 random(24);
    const Rigid3 T{random_attitude(random), {1e6, -2e6, 3e7}};
    Scene s = ellipsoid(kEarth, T);
    texture(s);
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const BodyPoses at = placed(s);
    std::uniform_real_distribution<double> turn(-kPi, kPi);
    for (int i = 0; i < 2000; ++i) {
        const double longitude = turn(random), latitude = 0.499 * turn(random);
        const Vec3 up{std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                      std::sin(latitude)};
        // The textbook form: prime vertical radius N, then (N cos, N cos, N (1 - e^2) sin).
        const double e2 = kFlattening * (2 - kFlattening),
                     prime = kEquator / std::sqrt(1 - e2 * std::sin(latitude) * std::sin(latitude));
        const Vec3 ground = prime * up * Vec3{1, 1, 1 - e2};
        const Hit hit = tracer->intersect(at, {T * (ground + 4e5 * up), T.q * -up}, kInfinity);
        ASSERT_EQ(hit.body, 0);
        EXPECT_TRUE(hit.outside);
        EXPECT_NEAR(hit.range_m, 4e5, 1e-7);
        EXPECT_LE(norm(hit.position - T * ground), 1e-7);
        EXPECT_LE(norm(hit.geometric_normal - T.q * up), 1e-14);
        EXPECT_EQ(hit.geometric_normal, hit.shading_normal);
        const double east = longitude / (2 * kPi);
        EXPECT_NEAR(static_cast<double>(hit.u), east < 0 ? east + 1 : east, 6e-8);
        EXPECT_NEAR(static_cast<double>(hit.v), 0.5 + latitude / kPi, 6e-8);

        // From the centre of the Earth the same point is seen from inside.
        const Hit below = tracer->intersect(at, {T * (ground - 4e5 * up), T.q * up}, kInfinity);
        ASSERT_EQ(below.body, 0);
        EXPECT_FALSE(below.outside);
        EXPECT_LE(norm(below.geometric_normal + T.q * up), 1e-14);
        EXPECT_EQ(tracer->bounding_radius_m(0), kEquator);
    }
}

/// The point of an ellipsoid with texture coordinates of this kind.
Vec3 ellipsoid_point(const Vec3& axes, MapLatitude kind, double u, double v) {
    const double longitude = 2 * kPi * u, colatitude = kPi * (1 - v);
    const Vec3 n{std::sin(colatitude) * std::cos(longitude), std::sin(colatitude) * std::sin(longitude),
                 std::cos(colatitude)};
    switch (kind) {
        case MapLatitude::planetographic: return axes * axes * n / norm(axes * n);
        case MapLatitude::planetocentric: return n / norm(n / axes);
        case MapLatitude::parametric: break;
    }
    return axes * n;
}

constexpr std::array kMapLatitudes{MapLatitude::planetographic, MapLatitude::planetocentric,
                                   MapLatitude::parametric};

TEST(EllipsoidMaps, LieByTheLatitudeThatTheMaterialNames) {
    std::mt19937_64 random(28);
    for (const MapLatitude kind : kMapLatitudes)
        for (const Vec3& axes : {kEarth, Vec3{3, 2, 1}, Vec3{13000, 11400, 9100}}) {
            Scene s = ellipsoid(axes);
            texture(s);
            s.materials[0].map_latitude = kind;
            const auto tracer = Tracer::create(s, 1);
            ASSERT_TRUE(tracer);
            for (int i = 0; i < 200; ++i) {
                const double u = 0.001 + 0.998 * std::generate_canonical<double, 53>(random),
                             v = 0.001 + 0.998 * std::generate_canonical<double, 53>(random);
                const Vec3 p = ellipsoid_point(axes, kind, u, v), out = normalized(p / (axes * axes));
                const Hit hit = tracer->intersect(placed(s), {p + axes.x * out, -out}, kInfinity);
                ASSERT_EQ(hit.body, 0);
                EXPECT_NEAR(static_cast<double>(hit.u), u, 1e-7);
                EXPECT_NEAR(static_cast<double>(hit.v), v, 1e-7);
            }
        }
}

TEST(EllipsoidMaps, DifferByWhatTheShapeIsFlattened) {
    // tan(planetographic) = (a / c) tan(parametric) = (a / c)^2 tan(planetocentric).
    const Vec3 axes{2, 2, 1};
    const double parametric = 0.5;
    const Vec3 p = axes * Vec3{std::cos(parametric), 0, std::sin(parametric)};
    for (const auto& [kind, latitude] : {std::pair{MapLatitude::planetographic, std::atan(2 * std::tan(0.5))},
                                         std::pair{MapLatitude::planetocentric, std::atan(0.5 * std::tan(0.5))},
                                         std::pair{MapLatitude::parametric, parametric}}) {
        const EllipsoidShape shape(axes, 0, kind);
        EXPECT_NEAR(EllipsoidShape::uv(shape.map_direction(p))[1], 0.5 + latitude / kPi, 1e-14);
    }
}

/// Metres per unit of u and v by moving the point a little.
template <class Point>
void expect_partials(const Point& at_uv, double u, double v, const Vec3& dp_du, const Vec3& dp_dv, double size) {
    const double h = 1e-5;
    const Vec3 du = (at_uv(u + h, v) - at_uv(u - h, v)) / (2 * h),
               dv = (at_uv(u, v + h) - at_uv(u, v - h)) / (2 * h);
    EXPECT_LE(norm(du - dp_du), 1e-7 * size) << u << " " << v;
    EXPECT_LE(norm(dv - dp_dv), 1e-7 * size) << u << " " << v;
}

TEST(TextureFrame, OfAnEllipsoidIsTheDerivativeOfItsPoints) {
    std::mt19937_64 random(25);
    std::vector<std::pair<MapLatitude, Vec3>> cases;
    for (const MapLatitude kind : kMapLatitudes)
        for (const Vec3& axes : {Vec3{2, 2, 2}, kEarth, Vec3{3, 1, 0.5}}) cases.emplace_back(kind, axes);
    for (const auto& [kind, axes] : cases) {
        const Rigid3 T{random_attitude(random), {5, 6, 7}};
        Scene s = ellipsoid(axes, T);
        texture(s);
        s.materials[0].map_latitude = kind;
        const auto tracer = Tracer::create(s, 1);
        ASSERT_TRUE(tracer);
        const BodyPoses at = placed(s);
        const auto ground = [&, kind = kind, axes = axes](double u, double v) {
            return T.q * ellipsoid_point(axes, kind, u, v);
        };
        const double size = 2 * kPi * axes.x;
        for (int i = 0; i < 200; ++i) {
            const double u = 0.001 + 0.998 * std::generate_canonical<double, 53>(random),
                         v = 0.001 + 0.998 * std::generate_canonical<double, 53>(random);
            const Vec3 p = T.t + ground(u, v), out = normalized(p - T.t);
            const Hit hit = tracer->intersect(at, {p + 2 * axes.x * out, -out}, kInfinity);
            ASSERT_EQ(hit.body, 0);
            const TextureFrame f = tracer->texture_frame(at, hit);
            expect_partials(ground, u, v, f.dp_du, f.dp_dv, size);
            EXPECT_LE(std::abs(dot(f.dp_du, hit.geometric_normal)), 1e-9 * size);
            EXPECT_LE(std::abs(dot(f.dp_dv, hit.geometric_normal)), 1e-9 * size);
        }
        for (const double pole : {1.0, -1.0}) {
            const Vec3 axis = T.q * Vec3{0, 0, pole};
            const Hit hit = tracer->intersect(at, {T.t + 2 * axes.x * axis, -axis}, kInfinity);
            ASSERT_EQ(hit.body, 0);
            const TextureFrame f = tracer->texture_frame(at, hit);
            EXPECT_LE(norm(f.dp_du), 1e-9 * size);
            EXPECT_LE(std::abs(dot(f.dp_dv, axis)), 1e-9 * size);
            if (kind != MapLatitude::planetographic) continue;
            // Pi times the radius of curvature, which at the pole of three unequal axes depends on the meridian.
            EXPECT_LE(norm(f.dp_dv), kPi * axes.x * axes.x / axes.z * (1 + 1e-9));
            EXPECT_GE(norm(f.dp_dv), kPi * axes.y * axes.y / axes.z * (1 - 1e-9));
        }
    }
}

TEST(TextureFrame, OfATriangleIsThatOfItsCorners) {
    std::mt19937_64 random(26);
    std::normal_distribution<float> n;
    const Rigid3 T{random_attitude(random), {-4, 1, 9}};
    for (int i = 0; i < 500; ++i) {
        Scene s;
        s.materials.push_back(lambert(0.5f));
        texture(s);
        Mesh m;
        for (int k = 0; k < 3; ++k) {
            m.positions.push_back({n(random), n(random), n(random)});
            m.uvs.push_back({n(random), n(random)});
        }
        m.faces = {{0, 1, 2}};
        m.face_material = {0};
        add_mesh(s, m, T);
        const auto tracer = Tracer::create(s, 1);
        ASSERT_TRUE(tracer);
        const BodyPoses at = placed(s);
        const auto corner = [&](std::size_t k) { return T * vec_cast<double>(m.positions[k]); };
        const Vec3 middle = (corner(0) + corner(1) + corner(2)) / 3.0;
        const Vec3 up = normalized(cross(corner(1) - corner(0), corner(2) - corner(0)));
        const Hit hit = tracer->intersect(at, {middle + up, -up}, kInfinity);
        ASSERT_EQ(hit.body, 0);
        const TextureFrame f = tracer->texture_frame(at, hit);
        for (std::size_t k = 0; k < 3; ++k) {  // from the hit to each corner by its texture coordinates
            const double du = static_cast<double>(m.uvs[k][0]) - static_cast<double>(hit.u),
                         dv = static_cast<double>(m.uvs[k][1]) - static_cast<double>(hit.v);
            const double slack = 1e-6 * (1 + norm(f.dp_du) + norm(f.dp_dv));
            EXPECT_LE(norm(hit.position + du * f.dp_du + dv * f.dp_dv - corner(k)), slack) << i;
        }
    }
}

TEST(TextureFrame, IsZeroWhereTheTextureHasNoArea) {
    for (const bool with_uvs : {false, true}) {
        Scene s;
        s.materials.push_back(lambert(0.5f));
        texture(s);
        Mesh m = plate(2, 2);
        for (auto& uv : m.uvs) uv = {0.25f, uv[1]};  // a line
        if (!with_uvs) m.uvs.clear();
        add_mesh(s, m);
        const auto tracer = Tracer::create(s, 1);
        ASSERT_TRUE(tracer);
        const Hit hit = tracer->intersect(placed(s), {{0.3, 0.2, 1}, {0, 0, -1}}, kInfinity);
        ASSERT_EQ(hit.body, 0);
        const TextureFrame f = tracer->texture_frame(placed(s), hit);
        EXPECT_EQ(f.dp_du, Vec3{});
        EXPECT_EQ(f.dp_dv, Vec3{});
    }
}

}  // namespace
}  // namespace narpa
