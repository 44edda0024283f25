// Depth, height and contour lines of planes, spheres and boxes, whose places in the image have closed forms.
#include "renderer/map/surface_map.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "renderer/frame/camera_image.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;
using QuantityKind = MapQuantity::Kind;

/// A scene, seen by a camera at the world's origin that looks along z.
struct Sight {
    Scene scene;
    Camera c;
    std::optional<Tracer> tracer;
    std::optional<BodyPoses> at;

    Sight(Scene s, const Camera& with) : scene(std::move(s)), c(with), at(placed(scene)) {
        auto made = Tracer::create(scene, 1);
        EXPECT_TRUE(made);
        tracer = *std::move(made);
    }
    [[nodiscard]] SurfaceMapper mapper(const MapQuantity& q = {}) const { return {*tracer, *at, c, {}, q}; }
    [[nodiscard]] std::vector<ContourLine> contours(const MapQuantity& q, std::span<const double> levels,
                                                    SurfaceMap* map = nullptr) const {
        const SurfaceMapper m = mapper(q);
        const SurfaceMap made = m.map();
        if (map != nullptr) *map = made;
        return contour_lines(made.quantity, levels,
                             [&](std::size_t a, std::size_t b) { return m.is_continuous(pixel(a), pixel(b)); });
    }
    [[nodiscard]] ImagePoint pixel(std::size_t i) const {
        const auto width = static_cast<std::size_t>(c.width);
        return {static_cast<double>(i % width), static_cast<double>(i / width)};
    }
};

Scene with_materials() {
    Scene s;
    s.materials.push_back(lambert(0.5f));
    return s;
}

/// A plate of 100 m, 20 m away, turned by 40 degrees about the image's x axis and by 25 about its y axis.
Rigid3 tilted() {
    return {exp_rotation({0.7, 0, 0}) * exp_rotation({0, 3.14159265358979 - 0.44, 0}), {0, 0, 20}};
}

TEST(SurfaceMap, DepthLinesOfATiltedPlaneAreWhereTheyBelong) {
    Scene s = with_materials();
    add_mesh(s, plate(100, 100), tilted());
    const Sight sight(std::move(s), camera(320, 240, 500));
    std::vector<double> levels;
    for (double l = 17; l <= 23; l += 0.5) levels.push_back(l);
    const Vec3 n = tilted().q * Vec3{0, 0, 1};
    const double d = dot(n, tilted().t);
    double worst = 0;
    const auto lines = sight.contours({QuantityKind::depth}, levels);
    for (const ContourLine& line : lines)
        for (const ImagePoint& p : line.points) {
            // n . (x, y, f) / f = d / level: a straight line of the image.
            const double u = (p.x - pinhole_of(sight.c).cx) / pinhole_of(sight.c).fx,
                         v = (p.y - pinhole_of(sight.c).cy) / pinhole_of(sight.c).fy;
            const double off =
                (n.x * u + n.y * v + n.z - d / line.level) / std::hypot(n.x, n.y) * pinhole_of(sight.c).fx;
            worst = std::max(worst, std::abs(off));
        }
    EXPECT_EQ(lines.size(), levels.size()) << "one line a level";
    EXPECT_LT(worst, 1e-3) << "px";
    std::printf("depth lines of a tilted plane: at most %.2g px off\n", worst);
}

TEST(SurfaceMap, DepthIsThatOfARender) {
    Scene s = with_materials();
    add_mesh(s, bumpy(4, 1, 0.3), {{}, {0.2, 0.1, 5}});
    const Sight sight(std::move(s), camera(64, 48, 100));
    const auto render_scene = RenderScene::create(sight.scene, 1);
    ASSERT_TRUE(render_scene);
    RadianceImage image(64, 48);
    Aovs aovs;
    render_radiance(*render_scene, *sight.at, sight.c, {}, {}, image, &aovs);
    const SurfaceMap map = sight.mapper().map();
    for (std::size_t i = 0; i < aovs.depth_m.size(); ++i) {
        EXPECT_EQ(std::isnan(map.quantity.values[i]), std::isinf(aovs.depth_m[i]));
        if (!std::isinf(aovs.depth_m[i])) {
            EXPECT_NEAR(map.quantity.values[i], aovs.depth_m[i], 1e-9);
        }
    }
}

TEST(SurfaceMap, HeightLinesAreInTheFrameOfTheBody) {
    Scene s = with_materials();
    const int body = add_mesh(s, plate(100, 100), tilted());
    add_mesh(s, plate(2, 2), {{}, {0, 0, 10}});  // before it: not part of the map
    const Sight sight(std::move(s), camera(320, 240, 500));
    const MapQuantity q{QuantityKind::height, body, normalized(Vec3{1, 2, 0}), 0.75};
    std::vector<double> levels{-2, -1, 0, 1, 2};
    SurfaceMap map;
    const auto lines = sight.contours(q, levels, &map);
    EXPECT_GE(lines.size(), levels.size());
    double worst_px = 0, worst_m = 0;
    for (const ContourLine& line : lines)
        for (const ImagePoint& p : line.points) {
            const Vec3 on_plate = map.position_at(p);
            EXPECT_NEAR(on_plate.z, 0, 1e-5);
            worst_m = std::max(worst_m, std::abs(dot(q.up, on_plate) - q.datum_m - line.level));
            // Where the ray through p meets the plate's plane, and how the height changes there per pixel.
            const auto height = [&](const ImagePoint& at) {
                const Vec3 ray{(at.x - pinhole_of(sight.c).cx) / pinhole_of(sight.c).fx,
                               (at.y - pinhole_of(sight.c).cy) / pinhole_of(sight.c).fy, 1};
                const Vec3 n = tilted().q * Vec3{0, 0, 1};
                const Vec3 met = dot(n, tilted().t) / dot(n, ray) * ray;
                return dot(q.up, inverse(tilted()) * met) - q.datum_m;
            };
            const double slope = std::hypot(height({p.x + 0.5, p.y}) - height({p.x - 0.5, p.y}),
                                            height({p.x, p.y + 0.5}) - height({p.x, p.y - 0.5}));
            worst_px = std::max(worst_px, std::abs(height(p) - line.level) / slope);
        }
    EXPECT_LT(worst_px, 1e-3);
    EXPECT_LT(worst_m, 1e-5);
    std::printf("height lines of a tilted plane: at most %.2g px off, positions %.2g m\n", worst_px, worst_m);
}

TEST(SurfaceMap, DepthLinesOfASphereAreCircles) {
    Scene s = with_materials();
    add_sphere(s, 2, {0, 0, 10});
    const Sight sight(std::move(s), camera(301, 301, 600));
    const std::vector<double> levels{8.01, 8.05, 8.2, 8.5, 9, 9.2};
    const auto lines = sight.contours({QuantityKind::depth}, levels);
    ASSERT_EQ(lines.size(), levels.size());
    const double limb = pinhole_of(sight.c).fx * std::tan(std::asin(2.0 / 10));
    for (std::size_t i = 0; i < lines.size(); ++i) {
        EXPECT_TRUE(lines[i].closed) << lines[i].level;
        const double radius = pinhole_of(sight.c).fx * std::sqrt(4 - std::pow(10 - levels[i], 2)) / levels[i];
        // f'' / (8 f') of linear interpolation: near the peak depth grows as r^2, near the limb as the root of the
        // distance from it.
        const double bound = 1.02 / (8 * radius) + 1 / (16 * (limb - radius - 1));
        double worst = 0;
        for (const ImagePoint& p : lines[i].points)
            worst = std::max(
                worst, std::abs(std::hypot(p.x - pinhole_of(sight.c).cx, p.y - pinhole_of(sight.c).cy) - radius));
        EXPECT_LT(worst, bound) << "level " << levels[i] << ", radius " << radius << " px";
        std::printf("depth lines of a sphere: radius %.1f px: at most %.2g px off\n", radius, worst);
    }
}

TEST(SurfaceMap, RadiusOfASphereIsConstant) {
    Scene s = with_materials();
    const int body = add_sphere(s, 2, {0.5, -0.25, 10});
    const Sight sight(std::move(s), camera(64, 64, 120));
    SurfaceMap map;
    EXPECT_TRUE(sight.contours({QuantityKind::radius, body}, std::array{2.0}, &map).empty());
    int seen = 0;
    for (const double v : map.quantity.values) {
        if (std::isnan(v)) continue;
        ++seen;
        EXPECT_NEAR(v, 2, 1e-6);
    }
    EXPECT_GT(seen, 1000);
}

TEST(SurfaceMap, ShadesWhatFacesTheUpperLeft) {
    Scene s = with_materials();
    add_sphere(s, 2, {0, 0, 10});
    const SurfaceMap map = Sight(std::move(s), camera(101, 101, 200)).mapper().map();
    const auto shade = [&](int x, int y) { return map.shade[static_cast<std::size_t>(y * 101 + x)]; };
    EXPECT_NEAR(shade(50, 50), std::sqrt(0.5), 1e-6);
    EXPECT_GT(shade(32, 32), 0.95f);
    EXPECT_LT(shade(70, 70), 0.3f);
}

/// Whether a segment of a contour line has its ends on different sides.
template <class Inside>
int crossings(const std::vector<ContourLine>& lines, const Inside& inside, int& within) {
    int n = 0;
    for (const ContourLine& line : lines)
        for (std::size_t i = 0; i + 1 < line.points.size(); ++i) {
            n += inside(line.points[i]) != inside(line.points[i + 1]);
            within += inside(line.points[i]);
        }
    return n;
}

TEST(SurfaceMap, NoLineCrossesTheOutlineOfWhatIsBefore) {
    // Heights along the image's y reach the same levels on all three, so that lines could go on across the
    // outlines.
    Scene s = with_materials();
    add_mesh(s, plate(100, 100), {exp_rotation({0.3, 0.1, 0}), {0, 0, 20}});
    add_mesh(s, plate(3, 2), {exp_rotation({-0.4, 0, 0}), {-3, 0, 15}});
    add_sphere(s, 1.5, {3, 0, 15});
    const Sight sight(std::move(s), camera(320, 240, 400));
    std::vector<double> levels;
    for (int k = -20; k <= 20; ++k) levels.push_back(0.25 * k);
    SurfaceMap map;
    const auto lines = sight.contours({QuantityKind::height, -1, {0, 1, 0}}, levels, &map);
    const auto direction = [&](const ImagePoint& p) {
        return normalized(Vec3{(p.x - pinhole_of(sight.c).cx) / pinhole_of(sight.c).fx,
                               (p.y - pinhole_of(sight.c).cy) / pinhole_of(sight.c).fy, 1});
    };
    const auto on_sphere = [&](const ImagePoint& p) {
        const Vec3 centre{3, 0, 15};
        return norm(cross(direction(p), centre)) < 1.5;
    };
    const auto on_plate = [&](const ImagePoint& p) {
        const Rigid3 T{exp_rotation({-0.4, 0, 0}), {-3, 0, 15}};
        const Vec3 n = T.q * Vec3{0, 0, 1}, ray = direction(p);
        const Vec3 met = inverse(T) * (dot(n, T.t) / dot(n, ray) * ray);
        return std::abs(met.x) < 1.5 && std::abs(met.y) < 1;
    };
    int within_sphere = 0, within_plate = 0;
    EXPECT_EQ(crossings(lines, on_sphere, within_sphere), 0);
    EXPECT_EQ(crossings(lines, on_plate, within_plate), 0);
    EXPECT_GT(within_sphere, 200);
    EXPECT_GT(within_plate, 200);
    int joined = 0;
    const auto all = contour_lines(map.quantity, levels, [](std::size_t, std::size_t) { return true; });
    EXPECT_GT(crossings(all, on_sphere, joined), 20) << "without the rule lines do cross";
}

TEST(SurfaceMap, AConvexBodyIsContinuousUpToItsLimb) {
    const std::array<Vec3, 3> turns{{{0.5, 0.6, 0}, {-0.4, 0.3, 1}, {0.7, -0.5, 2}}};
    for (std::size_t shape = 0; shape < 6; ++shape) {
        Scene s = with_materials();
        if (shape % 2 == 0)
            add_mesh(s, box(2, 3, 4), {exp_rotation(turns[shape / 2]), {0, 0, 12}});
        else
            add_sphere(s, 1.8, {0.1 * static_cast<double>(shape), 0, 12});
        const Sight sight(std::move(s), camera(121, 101, 220));
        const SurfaceMapper mapper = sight.mapper();
        const SurfaceMap map = mapper.map();
        int pairs = 0, broken = 0;
        for (std::size_t i = 0; i + 121 < map.quantity.values.size(); ++i)
            for (const std::size_t j : {i + 1, i + 121}) {
                if (std::isnan(map.quantity.values[i]) || std::isnan(map.quantity.values[j])) continue;
                ++pairs;
                broken += !mapper.is_continuous(sight.pixel(i), sight.pixel(j));
            }
        EXPECT_GT(pairs, 2000);
        EXPECT_EQ(broken, 0) << "shape " << shape;
    }
}

TEST(SurfaceMap, StepsOfAFifthOfAPixelAreFound) {
    for (const double step_px : {0.2, 1.0, 5.0, 200.0}) {
        const double pixel_m = 20.0 / 500;
        Scene s = with_materials();
        add_mesh(s, plate(40, 40), {{}, {0, 0, 20}});
        add_mesh(s, plate(1, 1), {{}, {0, 0, 20 - step_px * pixel_m}});
        const Sight sight(std::move(s), camera(101, 11, 500));
        const SurfaceMapper mapper = sight.mapper();
        int broken = 0;
        for (int x = 0; x + 1 < 101; ++x)
            broken += !mapper.is_continuous({static_cast<double>(x), 5}, {static_cast<double>(x + 1), 5});
        EXPECT_EQ(broken, 2) << step_px << " px";
    }
}

TEST(SurfaceMap, PixelsBeyondTheImageCircleHaveNoSurface) {
    Scene s = with_materials();
    add_sphere(s, 50, {0, 0, 0});  // all around
    Camera c = camera(101, 101, 60);
    c.model = brown_conrady(pinhole_of(c), {-0.35, 0, 0, 0});
    const Sight sight(std::move(s), c);
    const SurfaceMap map = sight.mapper({QuantityKind::range}).map();
    int unseen = 0;
    for (std::size_t i = 0; i < map.quantity.values.size(); ++i) {
        const bool sees = c.model->sees(sight.pixel(i));
        unseen += !sees;
        EXPECT_EQ(std::isnan(map.quantity.values[i]), !sees) << i;
        if (sees) {
            EXPECT_NEAR(map.quantity.values[i], 50, 1e-5);
        }
    }
    EXPECT_GT(unseen, 1000);
}

}  // namespace
}  // namespace narpa
