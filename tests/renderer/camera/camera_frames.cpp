// Whole frames: what is beside the radiance, and that threads, seeds and the heap have no say in it.
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "renderer/camera/scene_camera.h"
#include "renderer/detector/detector.h"
#include "renderer/frame/camera_image.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

Scene craft_over_a_globe() {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    Material shiny = lambert(0.2f);
    shiny.kind = &kinds::phong;
    shiny.specular = {0.5f, 0.4f, 0.3f};
    shiny.exponent = 30;
    s.materials.push_back(shiny);
    add_sphere(s, 50, {0, 0, -60});
    Mesh m = bumpy(4, 2, 0.3);
    m.face_material.assign(m.faces.size(), 1);
    add_mesh(s, m, {normalized(Quat{1, 0.2, 0.3, 0.4}), {0, 0, 0}});
    add_mesh(s, box(1, 2, 3), {normalized(Quat{1, -0.2, 0.1, 0}), {3, 2, 1}});
    add_sun(s, {0.5, -0.3, 1});
    s.ambient = {0.5f, 0.4f, 0.3f};
    return s;
}
const Rigid3 kView = looking({12, 7, 9}, {0, 0, -1});

TEST(CameraFrame, AovsAgreeWithTheTracer) {
    const Scene s = craft_over_a_globe();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const BodyPoses at = placed(s);
    const Camera c = camera(60, 45, 60);
    RadianceImage image(c.width, c.height);
    Aovs aovs;
    for (const int spp : {1, 4}) {
        FrameSettings settings;
        settings.spp = spp;
        render_radiance(*render_scene, at, c, kView, settings, image, &aovs);
        std::array<int, 4> seen{};
        for (int y = 0; y < c.height; ++y)
            for (int x = 0; x < c.width; ++x) {
                const std::size_t i = static_cast<std::size_t>(y * c.width + x);
                const Ray ray = camera_ray(c, kView, x, y);
                const Hit hit = render_scene->tracer().intersect(at, ray, kInfinity);
                ++seen[static_cast<std::size_t>(hit.body + 1)];
                ASSERT_EQ(aovs.body[i], hit.body);
                if (hit.body < 0) {
                    EXPECT_EQ(aovs.range_m[i], kInfinity);
                    EXPECT_EQ(aovs.depth_m[i], kInfinity);
                    EXPECT_EQ(aovs.normal[i], Vec3{});
                    EXPECT_EQ(aovs.albedo[i], Rgb{});
                    if (spp == 1) {
                        EXPECT_EQ(image.pixels[i], Rgb{});
                    }
                    continue;
                }
                // Packets of rays are rounded in another order than single ones.
                EXPECT_NEAR(aovs.range_m[i], hit.range_m, 1e-12);
                EXPECT_LE(norm(aovs.position[i] - hit.position), 1e-12);
                EXPECT_LE(norm(aovs.normal[i] - hit.shading_normal), 1e-12);
                EXPECT_EQ(aovs.albedo[i], s.materials[static_cast<std::size_t>(hit.material)].diffuse);
                EXPECT_LE(norm(ray.origin + hit.range_m * ray.direction - hit.position), 1e-6);
                EXPECT_NEAR(aovs.depth_m[i], (inverse(kView) * hit.position).z, 1e-6);
                EXPECT_GT(image.pixels[i].x, 0);
            }
        for (const int n : seen) EXPECT_GT(n, 10);
    }
}

TEST(CameraFrame, AlbedoHasTheTextureAndTheColourOfMirrorsAndGlass) {
    Scene s;
    Material m = lambert(0.8f);
    m.texture = 0;
    s.materials.push_back(m);
    s.textures.push_back({"t", 2, 1, {65535, 0, 0, 0, 65535, 0}});  // red left, green right
    m = lambert(0.5f);
    m.kind = &kinds::mirror;
    m.specular = {0.9f, 0.8f, 0.7f};
    s.materials.push_back(m);
    m.kind = &kinds::dielectric;
    s.materials.push_back(m);
    add_mesh(s, plate(4, 4));
    const Camera c = camera(9, 9, 40);
    const Rigid3 T = looking({0, 0, 5}, {0, 0, 0}, {0, 1, 0});
    const auto albedo = [&](std::uint16_t material) {
        s.meshes[0].face_material.assign(2, material);
        const auto render_scene = RenderScene::create(s, 1);
        EXPECT_TRUE(render_scene);
        RadianceImage image(c.width, c.height);
        Aovs aovs;
        render_radiance(*render_scene, placed(s), c, T, {}, image, &aovs);
        return std::pair{aovs.albedo[4 * 9 + 1], aovs.albedo[4 * 9 + 7]};
    };
    const auto [left, right] = albedo(0);
    EXPECT_GT(left.x, right.x);
    EXPECT_GT(right.y, left.y);
    EXPECT_NEAR(left.x + left.y, 0.8, 1e-4);
    EXPECT_EQ(albedo(1).first, (Rgb{0.9f, 0.8f, 0.7f}));
    EXPECT_EQ(albedo(2).first, (Rgb{1, 1, 1}));
}

TEST(CameraFrame, CountsThePixelsThatAreDone) {
    const Scene s = craft_over_a_globe();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const Camera c = camera(37, 21, 30);
    RadianceImage image(c.width, c.height);
    std::atomic<std::size_t> done{0};
    FrameSettings settings;
    settings.pixels_done = &done;
    render_radiance(*render_scene, placed(s), c, kView, settings, image);
    EXPECT_EQ(done, 37u * 21);
}

TEST(CameraFrame, VarianceIsThatOfTheMean) {
    const Scene s = craft_over_a_globe();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const Camera c = camera(24, 18, 24);
    RadianceImage image(c.width, c.height);
    Aovs aovs;
    FrameSettings settings;
    settings.spp = 64;
    render_radiance(*render_scene, placed(s), c, kView, settings, image, &aovs);
    // An edge pixel varies, a pixel of the background does not; nothing is negative.
    EXPECT_GT(*std::max_element(aovs.variance.begin(), aovs.variance.end()), 1.0f);
    EXPECT_EQ(*std::min_element(aovs.variance.begin(), aovs.variance.end()), 0.0f);
    // A pixel half black, half L has variance L^2 / 4 / (n - 1): no pixel exceeds that for the brightest L, and
    // what neighbours add stays below the largest of them.
    const double brightest = 1361 * (0.2 / 3.14159 + 0.5 * 32 / 6.28318) + 1;
    for (const float v : aovs.variance) EXPECT_LE(v, brightest * brightest / 4 / 63);
}

struct Bytes {
    std::vector<Rgb> radiance;
    std::vector<std::uint8_t> frame;
    friend bool operator==(const Bytes&, const Bytes&) = default;
};
Bytes frame_on(int threads, const Scene& s, const RenderScene& render_scene, std::uint64_t seed,
               std::uint32_t frame, RenderSettings::Method method = RenderSettings::Method::direct) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(threads));
    Bytes bytes;
    tbb::task_arena(threads).execute([&] {
        Camera c = camera(70, 51, 70);  // not a whole number of tiles
        c.detector = Detector{};
        c.detector->shot_noise = true;
        c.detector->read_noise_e = 12;
        c.format = PixelFormat::rgb24;
        FrameSettings settings;
        settings.spp = 3;
        settings.seed = seed;
        settings.frame = frame;
        settings.method = method;
        RadianceImage image(c.width, c.height);
        render_radiance(render_scene, placed(s), c, kView, settings, image);
        bytes.frame.resize(3 * image.pixels.size());
        expose(c, image, seed, frame, bytes.frame);
        bytes.radiance = image.pixels;
    });
    return bytes;
}

TEST(CameraFrame, SameBytesOnOneTwoAndSevenThreads) {
    const Scene s = craft_over_a_globe();
    const auto render_scene = RenderScene::create(s, 2);
    ASSERT_TRUE(render_scene);
    for (const auto method : {RenderSettings::Method::direct, RenderSettings::Method::path}) {
        const Bytes one = frame_on(1, s, *render_scene, 5, 6, method);
        EXPECT_EQ(one, frame_on(2, s, *render_scene, 5, 6, method));
        EXPECT_EQ(one, frame_on(7, s, *render_scene, 5, 6, method));
    }
}

TEST(CameraFrame, SeedAndFrameNumberChangeTheSamples) {
    const Scene s = craft_over_a_globe();
    const auto render_scene = RenderScene::create(s, 1);
    ASSERT_TRUE(render_scene);
    const Bytes a = frame_on(1, s, *render_scene, 5, 6), b = frame_on(1, s, *render_scene, 5, 7),
                c = frame_on(1, s, *render_scene, 6, 6);
    EXPECT_EQ(a, frame_on(1, s, *render_scene, 5, 6));
    EXPECT_NE(a.radiance, b.radiance);
    EXPECT_NE(a.radiance, c.radiance);
    EXPECT_NE(b.radiance, c.radiance);
}

TEST(CameraFrame, AllocatesNothingAfterTheFirstFrame) {
    if (!kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has the heap";
    const Scene s = craft_over_a_globe();
    const auto render_scene = RenderScene::create(s, 2);
    ASSERT_TRUE(render_scene);
    BodyPoses at = placed(s);
    Camera c = camera(160, 120, 160);
    c.detector = Detector{};
    c.detector->shot_noise = true;
    c.format = PixelFormat::yuyv;
    RadianceImage image(c.width, c.height);
    Aovs aovs;
    std::vector<std::uint8_t> bytes(2 * image.pixels.size());
    FrameSettings settings;
    tbb::task_arena arena(2);
    CameraRenderer renderer(*render_scene, c);
    const auto frames = [&](int n) {
        arena.execute([&] {
            for (int i = 0; i < n; ++i) {
                settings.frame = static_cast<std::uint32_t>(i);
                settings.spp = 1 + i % 2;
                renderer.render(at, kView, settings, image, &aovs);
                expose(c, image, 1, settings.frame, bytes);
            }
        });
    };
    frames(50);  // the thread pool and Embree settle
    const AllocationCounter count;
    frames(20);
    EXPECT_EQ(count.on_all_threads(), 0u);
}

TEST(CameraFrame, RaysPassThroughPixelCentres) {
    Camera c = camera(640, 480, 700);
    set_principal_point(c, 300, 250);
    const Ray axis = camera_ray(c, {}, 300, 250);
    EXPECT_EQ(axis.direction, (Vec3{0, 0, 1}));
    const Vec3 right = camera_ray(c, {}, 301, 250).direction, down = camera_ray(c, {}, 300, 251).direction;
    EXPECT_NEAR(right.x / right.z, 1 / 700.0, 1e-15);
    EXPECT_NEAR(down.y / down.z, 1 / 700.0, 1e-15);
    EXPECT_GT(down.y, 0);
}

}  // namespace
}  // namespace narpa
