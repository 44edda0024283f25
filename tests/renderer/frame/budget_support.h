/// tests/renderer/frame/budget_support.h - a view to spend budgets on.
#pragma once

#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>

#include "renderer/frame/camera_image.h"
#include "tests/support/shapes.h"

namespace narpa::test {

using BudgetKind = FrameBudget::Kind;

/// A scene before a camera, small enough to be rendered thousands of times.
class BudgetView {
public:
    BudgetView(Scene of, int width, int height, double focal_px, const Rigid3& T_world_camera)
        : scene(std::make_unique<Scene>(std::move(of))),
          render_scene(*RenderScene::create(*scene, 1)),
          camera(test::camera(width, height, focal_px)),
          at(placed(*scene)),
          pose(T_world_camera) {}
    std::unique_ptr<Scene> scene;  // the tracer keeps its address
    RenderScene render_scene;
    Camera camera;
    BodyPoses at;
    CameraPose pose;

    [[nodiscard]] std::uint64_t pixels() const {
        return static_cast<std::uint64_t>(camera.width) * static_cast<std::uint64_t>(camera.height);
    }
};

/// A bumpy body, boxes with thin struts and a globe in sunlight: edges, cast shadows, details finer than a pixel,
/// and light from one body to the next.
inline BudgetView craft_over_a_globe(int width = 72, int height = 51) {
    Scene s;
    s.materials.push_back(lambert(0.4f));
    s.materials.push_back(lambert(0.7f));
    add_sphere(s, 50, {0, 0, -60});
    Mesh m = bumpy(4, 2, 0.3);
    m.face_material.assign(m.faces.size(), 1);
    add_mesh(s, std::move(m), {normalized(Quat{1, 0.2, 0.3, 0.4}), {0, 0, 0}});
    add_mesh(s, box(1, 2, 3), {normalized(Quat{1, -0.2, 0.1, 0}), {3, 2, 1}});
    add_mesh(s, box(0.05, 6, 0.05), {normalized(Quat{1, 0.1, -0.3, 0.2}), {2, 3, 2}});
    add_mesh(s, box(5, 0.12, 0.12), {normalized(Quat{1, 0.2, 0.1, 0.1}), {3, -1, 2}});
    add_sun(s, {0.5, -0.3, 1});
    return {std::move(s), width, height, 1.0 * width, looking({12, 7, 9}, {0, 0, -1})};
}

struct Shown {
    RadianceImage image;
    FrameAccount account;
};

inline FrameSettings rays_a_pixel(const BudgetView& v, double rays, std::uint32_t frame = 0,
                                  RenderSettings::Method method = RenderSettings::Method::direct) {
    FrameSettings s;
    s.frame = frame;
    s.method = method;
    s.max_depth = 4;
    s.budget.kind = BudgetKind::rays;
    s.budget.rays = static_cast<std::uint64_t>(rays * static_cast<double>(v.pixels()));
    return s;
}
inline FrameSettings samples_a_pixel(const BudgetView& v, int spp, std::uint32_t frame = 0,
                                     RenderSettings::Method method = RenderSettings::Method::direct) {
    FrameSettings s = rays_a_pixel(v, 0, frame, method);
    s.budget = {};
    s.spp = spp;
    return s;
}
/// Settings that make a frame again from its account.
inline FrameSettings replay_of(FrameSettings s, const FrameAccount& account) {
    s.budget = {};
    s.budget.kind = BudgetKind::passes;
    s.budget.passes = account.passes;
    s.budget.step = static_cast<std::uint8_t>(account.step);
    return s;
}

inline constexpr float kUntouched = -7;  ///< no radiance: what an image has before a frame

inline Shown render(CameraRenderer& renderer, const BudgetView& v, const FrameSettings& s) {
    Shown shown{RadianceImage(v.camera.width, v.camera.height), {}};
    std::fill(shown.image.pixels.begin(), shown.image.pixels.end(), Rgb{kUntouched, kUntouched, kUntouched});
    shown.account = renderer.render(v.at, v.pose, s, shown.image);
    return shown;
}
inline Shown render(const BudgetView& v, const FrameSettings& s) {
    CameraRenderer renderer(v.render_scene, v.camera);
    return render(renderer, v, s);
}

/// What a frame of 2 spp by paths takes on this machine: the least of five.
inline std::int64_t ns_of_two_samples(CameraRenderer& renderer, const BudgetView& v) {
    std::int64_t min_ns = std::numeric_limits<std::int64_t>::max();
    for (std::uint32_t k = 0; k < 5; ++k) {
        const std::int64_t start = now_ns();
        render(renderer, v, samples_a_pixel(v, 2, k, RenderSettings::Method::path));
        min_ns = std::min(min_ns, now_ns() - start);
    }
    return min_ns;
}

inline bool same_bytes(const RadianceImage& a, const RadianceImage& b) {
    return a.pixels.size() == b.pixels.size() &&
           std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Rgb)) == 0;
}
inline bool is_untouched(const Rgb& p) {
    return p == Rgb{kUntouched, kUntouched, kUntouched};
}
inline bool is_whole(const RadianceImage& image) {
    return std::none_of(image.pixels.begin(), image.pixels.end(), is_untouched);
}
inline bool is_untouched(const RadianceImage& image) {
    return std::all_of(image.pixels.begin(), image.pixels.end(), [](const Rgb& p) { return is_untouched(p); });
}

/// Mean bands of an image of so many samples a pixel: what the budgeted frames should be.
inline std::vector<double> truth_of(const BudgetView& v, int spp,
                                    RenderSettings::Method method = RenderSettings::Method::direct) {
    const Shown shown = render(v, samples_a_pixel(v, spp, 0x7000, method));
    std::vector<double> truth;
    for (const Rgb& p : shown.image.pixels) truth.push_back(mean_band(vec_cast<double>(p)));
    return truth;
}
/// Of an image's mean bands: mean squared error, mean error.
struct Misses {
    double squared = 0, mean = 0;
};
inline Misses misses_of(const RadianceImage& image, const std::vector<double>& truth) {
    Misses m;
    for (std::size_t i = 0; i < truth.size(); ++i) {
        const double miss = mean_band(vec_cast<double>(image.pixels[i])) - truth[i];
        m.squared += miss * miss / static_cast<double>(truth.size());
        m.mean += miss / static_cast<double>(truth.size());
    }
    return m;
}

}  // namespace narpa::test
