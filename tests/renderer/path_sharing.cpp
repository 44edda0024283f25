// Paths that share what they find: the same light, with less noise, whatever the surfaces and whatever shines.

#include "tests/renderer/path_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

using namespace test;

constexpr std::size_t kSide = 8, kPixels = kSide * kSide;
constexpr int kPictures = 16;

/// Means of the first band over so many samples of 8 x 8 pixels, and how far off they are.
struct Picture {
    std::array<double, kPixels> mean{}, error{};

    [[nodiscard]] double mean_variance() const {
        double sum = 0;
        for (const double e : error) sum += e * e / kPixels;
        return sum;
    }
};

struct View {
    std::array<Ray, kPixels> rays;
    std::array<Hit, kPixels> first;
    std::array<std::uint32_t, kPixels> number;

    View(const Tracer& tracer, const Placement& at, const Vec3& eye, const Vec3& target, double width_m) {
        const Vec3 ahead = normalized(target - eye), across = normalized(cross(ahead, {0, 0, 1})),
                   down = cross(ahead, across);
        for (std::size_t i = 0; i < kPixels; ++i) {
            const double x = (static_cast<double>(i % kSide) + 0.5) / kSide - 0.5,
                         y = (static_cast<double>(i / kSide) + 0.5) / kSide - 0.5;
            rays[i] = ray_to(eye, target + width_m * (x * across + y * down));
            first[i] = tracer.intersect(at, rays[i], kInfinity);
            number[i] = static_cast<std::uint32_t>(i);
        }
    }
};

Picture picture(const Tracer& tracer, const Placement& at, const View& view, const PathSettings& settings,
                std::uint32_t samples) {
    Picture p;
    std::array<std::array<double, kPictures>, kPixels> means{};
    for (int k = 0; k < kPictures; ++k)
        for (std::uint32_t s = 0; s < samples; ++s) {
            std::array<std::uint32_t, kPixels> sample;
            sample.fill(s);
            std::array<Rgb, kPixels> light;
            path_radiance(tracer, at, settings, view.rays, view.first,
                          {static_cast<std::uint64_t>(k + 1), 0, view.number, sample}, light);
            for (std::size_t i = 0; i < kPixels; ++i)
                means[i][static_cast<std::size_t>(k)] += static_cast<double>(light[i].x) / samples;
        }
    for (std::size_t i = 0; i < kPixels; ++i) {
        for (const double m : means[i]) p.mean[i] += m / kPictures;
        double squares = 0;
        for (const double m : means[i]) squares += (m - p.mean[i]) * (m - p.mean[i]);
        p.error[i] = std::sqrt(squares / (kPictures * (kPictures - 1.0)));
    }
    return p;
}

/// A deep dish beside a glossy block over a floor, in the sun: most rays leave into empty space.
Scene dish_and_block() {
    Scene s;
    s.materials = {lambert(0.8f), phong(0.3f, 0.4f, 30), lambert(0.4f)};
    Mesh dish = icosphere(3, 1, false);
    const std::size_t half = dish.faces.size() / 2;
    dish.faces.resize(half);
    dish.face_material.resize(half);
    add_mesh(s, std::move(dish));
    Mesh side = plate(2, 2);
    side.face_material.assign(side.faces.size(), 1);
    add_mesh(s, std::move(side), looking({0.5, 1.2, -0.5}, {0.2, 0, 0}));
    Mesh floor = plate(6, 6, 3);
    floor.face_material.assign(floor.faces.size(), 2);
    add_mesh(s, std::move(floor), {{}, {0, 0, -1.5}});
    add_sun(s, {0.4, -0.3, 1});
    s.sun->angular_diameter_rad = 0.0093;
    return s;
}

struct Case {
    const char* name;
    void (*add)(Scene&);
};
class Sharing : public testing::TestWithParam<Case> {};

TEST_P(Sharing, ChangesNoMeanAndTakesTheNoiseOfWhatFewFind) {
    Scene s = dish_and_block();
    GetParam().add(s);
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const Placement at = placed(s);
    const View view(*tracer, at, {3, -4, 4}, {0.2, 0.3, -0.5}, 1);
    PathSettings settings;
    settings.max_depth = 5;
    const Picture alone = picture(*tracer, at, view, settings, 32);
    settings.shared = true;
    const Picture shared = picture(*tracer, at, view, settings, 32);
    double sum_alone = 0, sum_shared = 0, square = 0;
    for (std::size_t i = 0; i < kPixels; ++i) {
        // Student's t with some 15 degrees of freedom, 64 times.
        const double error = std::hypot(alone.error[i], shared.error[i]);
        EXPECT_NEAR(shared.mean[i], alone.mean[i], kSigmas * error + 1e-6 * alone.mean[i]) << i;
        sum_alone += alone.mean[i], sum_shared += shared.mean[i];
        square += error * error;
    }
    // Neighbours' errors go together where they share, all of a picture's at worst.
    EXPECT_NEAR(sum_shared, sum_alone, 4 * std::sqrt(square * kPixels)) << sum_alone;
    EXPECT_LT(shared.mean_variance(), 0.75 * alone.mean_variance());
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, Sharing,
    testing::Values(
        Case{"InTheSun", [](Scene&) {}},
        Case{"UnderALamp",
             [](Scene& s) {
                 Light l;
                 l.kind = Light::Kind::disc;
                 l.T_mount_light = looking({1.5, -1, 2}, {});
                 l.emission = {90, 80, 70};
                 s.lights.push_back(l);
             }},
        Case{"UnderASkyAndAWideSun",
             [](Scene& s) {
                 s.ambient = {30, 20, 10};
                 s.sun->angular_diameter_rad = 1;
             }},
        Case{"BesideMirrorsGlassAndAGlow",
             [](Scene& s) {
                 const int first = static_cast<int>(s.materials.size());
                 s.materials.insert(s.materials.end(), {mirror(0.9f), glass(1.5f), shining(0.4f, {40, 50, 60})});
                 add_sphere(s, 0.4, {0.8, -0.2, -1}, first);
                 add_sphere(s, 0.4, {-0.6, -0.9, -0.9}, first + 1);
                 add_sphere(s, 0.2, {1.2, 0.6, 0.2}, first + 2);
             }}),
    [](const auto& info) { return info.param.name; });

TEST(SharedPaths, OfOneRayAloneIsAsGoodAsNone) {
    const Scene s = dish_and_block();
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const Ray ray = ray_to({3, -4, 4}, {0.3, 0.3, -0.7});
    PathSettings settings;
    const Estimate alone = light_along(*tracer, placed(s), ray, settings, 512);
    settings.shared = true;
    std::array<double, kPictures> means{};
    const Hit first = tracer->intersect(placed(s), ray, kInfinity);
    for (std::uint32_t k = 0; k < kPictures; ++k)
        for (std::uint32_t sample = 0; sample < 512; ++sample)
            means[k] +=
                static_cast<double>(light_along(*tracer, placed(s), ray, first, settings, 7, k, sample).x) / 512;
    double mean = 0, squares = 0;
    for (const double m : means) mean += m / kPictures;
    for (const double m : means) squares += (m - mean) * (m - mean);
    const double error = std::sqrt(squares / (kPictures * (kPictures - 1.0)));
    EXPECT_NEAR(mean, alone.mean.x, kSigmas * std::hypot(error, alone.error));
}

TEST(SharedPaths, AllocatesNothing) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "this build's heap is the sanitizer's own";
    const Scene s = dish_and_block();
    const auto tracer = Tracer::create(s, 1);
    ASSERT_TRUE(tracer);
    const Placement at = placed(s);
    const View view(*tracer, at, {3, -4, 4}, {0.2, 0.3, -0.5}, 1);
    PathSettings settings;
    settings.shared = true;
    picture(*tracer, at, view, settings, 1);
    const AllocationCounter counter;
    picture(*tracer, at, view, settings, 2);
    EXPECT_EQ(counter.on_this_thread(), 0U);
}

}  // namespace
}  // namespace narpa
