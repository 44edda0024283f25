// A kind of shape that the product does not have, a tilted plane, is added here alone: it is rendered, scanned, and
// lit against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "renderer/frame/camera_image.h"
#include "renderer/lidar/lidar_shot.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

/// A square through the body's origin, facing its unit `normal` on one side and its opposite on the other.
class TiltedSquare final : public Shape {
public:
    TiltedSquare(const Vec3& x, const Vec3& y, double half_m)
        : x_(x), y_(y), normal_(cross(x, y)), half_m_(half_m), box_(box_of(x, y, half_m)) {
        const double radius_m = std::sqrt(2.0) * half_m;
        properties_ = {.radius_m = radius_m,
                       .bound_m = radius_m * (1 + 1e-9),
                       .bounds = {{}, {radius_m, radius_m, radius_m}},
                       .resolution_m = 4e-15 * radius_m,
                       .convex = true};
    }
    std::uint32_t intersect(const ShapeRays& rays, std::uint32_t wanted, ShapeHits& hits) const noexcept override {
        std::uint32_t met = 0;
        for_each_lane(wanted & ~rays.leaving, [&](std::size_t i) {
            const Vec3 o = rays.origin[i], d = rays.direction[i];
            const double range_m = -dot(o, normal_) / dot(d, normal_);
            const Vec3 p = o + range_m * d;
            if (!(range_m >= 0 && range_m < rays.t_max[i] && std::abs(dot(p, x_)) <= half_m_ &&
                  std::abs(dot(p, y_)) <= half_m_))
                return;
            met |= 1u << i;
            hits.range_m[i] = range_m, hits.face[i] = 0;
            hits.position.put(i, p);
            hits.inner = (hits.inner & ~(1u << i)) | (dot(d, normal_) > 0 ? 1u << i : 0u);
        });
        return met;
    }
    [[nodiscard]] std::uint32_t occluded(const ShapeRays& rays, std::uint32_t wanted) const noexcept override {
        ShapeHits unused;
        return intersect(rays, wanted, unused);
    }
    void surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept override {
        hits.outside = ~found.inner;
        for_each_lane(wanted, [&](std::size_t i) {
            const Vec3 facing = is_set(found.inner, i) ? -normal_ : normal_;
            hits.position.put(i, found.position[i]);
            hits.geometric_normal.put(i, facing), hits.shading_normal.put(i, facing);
            hits.departure_body.put(i, found.position[i]), hits.beyond_body.put(i, found.position[i]);
            hits.material[i] = 0, hits.u[i] = hits.v[i] = 0;
        });
    }
    [[nodiscard]] TextureFrame texture_frame(const Hit&) const noexcept override { return {}; }
    [[nodiscard]] std::span<const BoxNode> boxes() const override { return {&box_, 1}; }

private:
    [[nodiscard]] static BoxNode box_of(const Vec3& x, const Vec3& y, double half_m) {
        const Vec3f high =
            vec_cast<float>(half_m * Vec3{std::abs(x.x) + std::abs(y.x), std::abs(x.y) + std::abs(y.y),
                                          std::abs(x.z) + std::abs(y.z)});
        return {{-high.x, -high.y, -high.z}, {high.x, high.y, high.z}};
    }

    Vec3 x_, y_, normal_;
    double half_m_;
    BoxNode box_;
};

const ShapeKind kTiltedSquare{
    .name = "tilted_square",
    .example = "{tilt_rad = ..., half_m = ...}",
    .expected = "a tilted square has a positive length",
    .make = [](std::span<const double> values, int, std::optional<MapLatitude>) -> std::shared_ptr<const Shape> {
        const double tilt_rad = values[0], half_m = values[1];
        if (!(half_m > 0)) return nullptr;
        return std::make_shared<TiltedSquare>(Vec3{1, 0, 0}, Vec3{0, std::cos(tilt_rad), std::sin(tilt_rad)},
                                              half_m);
    }};

/// A ball over the tilted square, under the Sun; far from the world's origin.
struct Stage {
    static constexpr double kTilt = 0.4, kHalf = 3;
    Scene scene;
    Vec3 x{1, 0, 0}, y{0, std::cos(kTilt), std::sin(kTilt)}, normal = cross(x, y), centre{1000, -200, 50};
    std::optional<Tracer> tracer;
    BodyPoses at{2};

    Stage() {
        scene.materials.push_back(lambert(0.6f));
        add_sphere(scene, 1, centre);
        scene.bodies.back().shape = ExactShape{&kTiltedSquare, {kTilt, kHalf}};
        add_sphere(scene, 0.5, centre + Vec3{0, 0, 2});
        add_sun(scene, {0, 0, 1});
        tracer.emplace(*Tracer::create(scene, 1));
        at = placed(scene);
    }
    /// Where a ray hits the plane of the square.
    [[nodiscard]] double range_m(const Vec3& o, const Vec3& d) const {
        return dot(centre - o, normal) / dot(d, normal);
    }
    [[nodiscard]] bool holds(const Vec3& p) const {
        return std::abs(dot(p - centre, x)) < kHalf && std::abs(dot(p - centre, y)) < kHalf;
    }
    [[nodiscard]] bool in_shadow(const Vec3& p) const {
        return std::hypot(p.x - centre.x, p.y - centre.y) < 0.5;  // of the ball, straight below
    }
};

TEST(ShapeJoint, RangesOfAnAddedShapeAreExact) {
    const Stage s;
    std::mt19937_64 random(1);
    int on = 0, off = 0;
    for (int k = 0; k < 100; ++k) {
        RayBatch beams;
        for (beams.n = 0; beams.n < kLanes; ++beams.n) {
            const Vec3 o = s.centre + Vec3{0, -1, -8}, to = s.centre + 4.0 * random_direction(random);
            beams.put(beams.n, {o, normalized(to - o)});
        }
        std::array<LidarReturn, kLanes> seen;
        shoot(*s.tracer, s.at, beams, {.range_max_m = 100}, seen);
        for (std::size_t i = 0; i < kLanes; ++i) {
            const Vec3 o = beams.origin[i], d = beams.direction[i];
            const double range_m = s.range_m(o, d);
            const bool expected = range_m > 0 && s.holds(o + range_m * d);
            if (seen[i].body != 1) {
                EXPECT_EQ(seen[i].body == 0, expected);
            }
            if (seen[i].body != 0) {
                ++off;
                continue;
            }
            ++on;
            EXPECT_NEAR(seen[i].range_m, range_m, 1e-12 * 1000);
            EXPECT_NEAR(seen[i].reflectivity, 0.6 * std::abs(dot(d, s.normal)), 1e-6);
        }
    }
    EXPECT_GT(on, 300);
    EXPECT_GT(off, 100);
}

TEST(ShapeJoint, BadValuesOfAnAddedShapeAreNamed) {
    Stage s;
    s.scene.bodies[0].shape = ExactShape{&kTiltedSquare, {0, -1}};
    const auto tracer = Tracer::create(s.scene, 1);
    ASSERT_FALSE(tracer);
    EXPECT_NE(tracer.error().what.find(kTiltedSquare.expected), std::string::npos);
}

TEST(ShapeJoint, AnAddedShapeIsRenderedLitAndShadowed) {
    const Stage s;
    const auto frames = RenderScene::create(s.scene, 1);
    ASSERT_TRUE(frames) << frames.error().text();
    const Camera c = camera(120, 90, 90);
    const Rigid3 T = looking(s.centre + Vec3{2, -7, 5}, s.centre);
    RadianceImage image(c.width, c.height);
    FrameSettings settings;
    render_radiance(*frames, s.at, c, T, settings, image);
    const double lit = 0.6 / std::numbers::pi * 1361 * dot(s.normal, Vec3{0, 0, 1});
    int bright = 0, dark = 0, empty = 0;
    for (int j = 1; j + 1 < c.height; ++j)
        for (int i = 1; i + 1 < c.width; ++i) {
            // Pixels that see one thing alone: what their centre sees, their corners see too.
            enum class Sees { nothing, sunlit, shadow, ball, mixed } sees = Sees::mixed;
            for (const auto& [dx, dy] : {std::pair{0.0, 0.0}, {-0.6, -0.6}, {0.6, -0.6}, {-0.6, 0.6}, {0.6, 0.6}}) {
                const Vec3 d = T.q * normalized(Vec3{(i + dx - pinhole_of(c).cx) / pinhole_of(c).fx,
                                                     (j + dy - pinhole_of(c).cy) / pinhole_of(c).fy, 1});
                const Hit hit = s.tracer->intersect(s.at, {T.t, d}, kInfinity);
                const Vec3 p = T.t + s.range_m(T.t, d) * d;
                const Sees here = hit.body == 1    ? Sees::ball
                                  : !s.holds(p)    ? Sees::nothing
                                  : s.in_shadow(p) ? Sees::shadow
                                                   : Sees::sunlit;
                EXPECT_EQ(here == Sees::nothing, hit.body < 0);
                sees = dx == 0 || sees == here ? here : Sees::mixed;
                if (sees == Sees::mixed) break;
            }
            const float radiance = image.pixels[static_cast<std::size_t>(j * c.width + i)].x;
            if (sees == Sees::sunlit) {
                ++bright;
                EXPECT_NEAR(radiance, lit, 1e-4 * lit);
            } else if (sees == Sees::shadow || sees == Sees::nothing) {
                ++(sees == Sees::shadow ? dark : empty);
                EXPECT_EQ(radiance, 0);
            }
        }
    EXPECT_GT(bright, 500);
    EXPECT_GT(dark, 20);
    EXPECT_GT(empty, 500);
}

}  // namespace
}  // namespace narpa
