// Paths that share what they find: the same light, with less noise, whatever the surfaces and whatever shines.

#include "renderer/frame/camera_image.h"
#include "tests/renderer/integrator/path_support.h"
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

/// Rays through the pixel centres and their first hits, in batches.
struct View {
    std::array<RayBatch, kPixels / kLanes> ray_batches;
    std::array<HitBatch, kPixels / kLanes> hit_batches;

    View(const RenderScene& render_scene, const BodyPoses& at, const Vec3& eye, const Vec3& target,
         double width_m) {
        const Vec3 ahead = normalized(target - eye), across = normalized(cross(ahead, {0, 0, 1})),
                   down = cross(ahead, across);
        for (std::size_t i = 0; i < kPixels; ++i) {
            const double x = (static_cast<double>(i % kSide) + 0.5) / kSide - 0.5,
                         y = (static_cast<double>(i / kSide) + 0.5) / kSide - 0.5;
            ray_batches[i / kLanes].n = kLanes;
            ray_batches[i / kLanes].put(i % kLanes, ray_to(eye, target + width_m * (x * across + y * down)));
        }
        for (std::size_t k = 0; k < ray_batches.size(); ++k)
            render_scene.tracer().intersect(at, ray_batches[k], render_scene.tracer().all_bodies(), hit_batches[k]);
    }
};

using Trace = std::uint64_t (*)(const RenderScene&, const BodyPoses&, const View&, const PathSettings&,
                                std::uint64_t seed, std::uint32_t sample, std::array<Rgb, kPixels>& light);

std::array<PathStart, kPixels> starts_of(const View& view, std::uint32_t sample) {
    std::array<PathStart, kPixels> starts;
    for (std::size_t i = 0; i < kPixels; ++i)
        starts[i] = {&view.ray_batches[i / kLanes],
                     &view.hit_batches[i / kLanes],
                     nullptr,
                     i % kLanes,
                     static_cast<std::uint32_t>(i),
                     sample};
    return starts;
}

std::uint64_t each_for_itself(const RenderScene& render_scene, const BodyPoses& at, const View& view,
                              const PathSettings& settings, std::uint64_t seed, std::uint32_t sample,
                              std::array<Rgb, kPixels>& light) {
    return path_radiance({render_scene, at, settings, seed}, starts_of(view, sample), light);
}

std::uint64_t together(const RenderScene& render_scene, const BodyPoses& at, const View& view,
                       const PathSettings& settings, std::uint64_t seed, std::uint32_t sample,
                       std::array<Rgb, kPixels>& light) {
    static_assert(kPixels == kReuseGroup);
    std::array<float, kReuseGroup> variance;
    return reused_path_radiance({render_scene, at, settings, seed}, starts_of(view, sample), light, variance);
}

Picture picture(const RenderScene& render_scene, const BodyPoses& at, const View& view,
                const PathSettings& settings, std::uint32_t samples, Trace trace) {
    Picture p;
    std::array<std::array<double, kPictures>, kPixels> means{};
    for (int k = 0; k < kPictures; ++k)
        for (std::uint32_t s = 0; s < samples; ++s) {
            std::array<Rgb, kPixels> light;
            trace(render_scene, at, view, settings, static_cast<std::uint64_t>(k + 1), s, light);
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

struct ReuseCase {
    const char* name;
    void (*add)(Scene&);
};
class PathReuse : public testing::TestWithParam<ReuseCase> {};

TEST_P(PathReuse, KeepsTheMeanAndReducesTheNoise) {
    Scene s = dish_and_block();
    GetParam().add(s);
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const View view(*render_scene, at, {3, -4, 4}, {0.2, 0.3, -0.5}, 1);
    PathSettings settings;
    settings.max_depth = 5;
    const Picture alone = picture(*render_scene, at, view, settings, 32, each_for_itself);
    const Picture shared = picture(*render_scene, at, view, settings, 32, together);
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
    Scenes, PathReuse,
    testing::Values(
        ReuseCase{"InTheSun", [](Scene&) {}},
        ReuseCase{"UnderALamp",
                  [](Scene& s) {
                      Light l;
                      l.kind = Light::Kind::disc;
                      l.T_mount_light = looking({1.5, -1, 2}, {});
                      l.emission = {90, 80, 70};
                      s.lights.push_back(l);
                  }},
        ReuseCase{"UnderASkyAndAWideSun",
                  [](Scene& s) {
                      s.ambient = {30, 20, 10};
                      s.sun->angular_diameter_rad = 1;
                  }},
        ReuseCase{
            "BesideMirrorsGlassAndAGlow",
            [](Scene& s) {
                const int first = static_cast<int>(s.materials.size());
                s.materials.insert(s.materials.end(), {mirror(0.9f), glass(1.5f), shining(0.4f, {40, 50, 60})});
                add_sphere(s, 0.4, {0.8, -0.2, -1}, first);
                add_sphere(s, 0.4, {-0.6, -0.9, -0.9}, first + 1);
                add_sphere(s, 0.2, {1.2, 0.6, 0.2}, first + 2);
            }}),
    [](const auto& test) { return test.param.name; });

/// Of camera frames, in the first band.
Picture frames(const Scene& s, int spp, const Mechanisms& mechanisms = {}) {
    const auto render_scene = RenderScene::create(s, 1);
    EXPECT_TRUE(render_scene);
    const Camera c = camera(static_cast<int>(kSide), static_cast<int>(kSide), 40);
    const Rigid3 T_world_camera = looking({3, -4, 4}, {0.2, 0.3, -0.5});
    FrameSettings settings;
    settings.spp = spp;
    settings.method = RenderSettings::Method::path;
    settings.max_depth = 5;
    settings.mechanisms = mechanisms;
    Picture p;
    std::array<double, kPixels> squares{};
    for (int k = 0; k < kPictures; ++k) {
        settings.frame = static_cast<std::uint32_t>(k);
        RadianceImage image(c.width, c.height);
        render_radiance(*render_scene, placed(s), c, T_world_camera, settings, image);
        for (std::size_t i = 0; i < kPixels; ++i) {
            const auto light = static_cast<double>(image.pixels[i].x);
            p.mean[i] += light / kPictures;
            squares[i] += light * light / kPictures;
        }
    }
    for (std::size_t i = 0; i < kPixels; ++i)
        p.error[i] = std::sqrt(std::max(0.0, squares[i] - p.mean[i] * p.mean[i]) / (kPictures - 1.0));
    return p;
}

TEST(ReusedPaths, ReceiveDirectSunlightAsInDirectLighting) {
    Scene s = dish_and_block();
    const Picture quick = frames(s, 16);
    // Something shines: nothing is simple any more. Nobody sees it.
    s.materials.push_back(shining(0, {1e-20f, 1e-20f, 1e-20f}));
    add_sphere(s, 0.01, {0, 0, -9}, static_cast<int>(s.materials.size()) - 1);
    const Picture slow = frames(s, 16);
    double lit = 0;
    for (std::size_t i = 0; i < kPixels; ++i) {
        EXPECT_NEAR(quick.mean[i], slow.mean[i],
                    kSigmas * std::hypot(quick.error[i], slow.error[i]) + 1e-5 * slow.mean[i])
            << i;
        lit += slow.mean[i];
    }
    EXPECT_GT(lit, 100 * static_cast<double>(kPixels));
}

TEST(ReusedPaths, SampleSmallBodiesWhereDirectSunlightIsApart) {
    // A ball in the Sun lights a Lambert and a Phong plate whose backs are to it.
    Scene s;
    s.materials = {lambert(0.9f), phong(0.3f, 0.4f, 30)};
    add_mesh(s, plate(4, 4));
    Mesh glossy = plate(1, 3);
    glossy.face_material.assign(glossy.faces.size(), 1);
    add_mesh(s, std::move(glossy), {{}, {-0.5, 0, 0.1}});
    add_sphere(s, 0.1, {0.9, 0, 0.7});
    add_sun(s, {-1, 0, -0.1});
    Mechanisms together, by_chance;
    together.separate_sun = by_chance.small_body_sampling = false;
    const Picture apart = frames(s, 64), whole = frames(s, 64, together), chance = frames(s, 64, by_chance);
    for (std::size_t i = 0; i < kPixels; ++i)
        EXPECT_NEAR(apart.mean[i], whole.mean[i],
                    kSigmas * std::hypot(apart.error[i], whole.error[i]) + 1e-5 * whole.mean[i])
            << i;
    // Half of the samples are followed by paths.
    EXPECT_LT(apart.mean_variance(), 3 * whole.mean_variance());
    EXPECT_GT(chance.mean_variance(), 3 * apart.mean_variance());
}

TEST(ReusedPaths, AllocateNothing) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "this build's heap is the sanitizer's own";
    const Scene s = dish_and_block();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const View view(*render_scene, at, {3, -4, 4}, {0.2, 0.3, -0.5}, 1);
    picture(*render_scene, at, view, {}, 1, together);
    const AllocationCounter counter;
    picture(*render_scene, at, view, {}, 2, together);
    EXPECT_EQ(counter.on_this_thread(), 0U);
}

}  // namespace
}  // namespace narpa
