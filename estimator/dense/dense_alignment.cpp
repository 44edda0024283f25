#include "estimator/dense/dense_alignment.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <string>

#include "estimator/dense/level_solver.h"

namespace narpa {
namespace {

/// The coarsest level shows the target no smaller than this.
constexpr double kLeastExtent_px = 16;

}  // namespace

std::string_view name(DenseStatus status) noexcept {
    constexpr std::array<std::string_view, 6> names{"converged",    "out of steps",     "diverged",
                                                    "does not fit", "left the picture", "too few pixels"};
    return names[static_cast<std::size_t>(status)];
}

struct DenseAlignment::Impl {
    Impl(const RenderScene& the_render_scene, const Camera& the_camera, std::size_t the_target)
        : render_scene(the_render_scene), camera(the_camera), target(the_target), sensor(sensor_model(the_camera)) {
        if (camera.embedded_line) {  // the last row holds no light
            --camera.height;
            camera.embedded_line = false;
        }
    }

    LevelView& view_of(int factor, const Camera& level_camera, const Window& window, const BodyPoses& at) {
        auto& kept = levels[static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(factor)))];
        if (!kept || kept->window() != window) kept.emplace(render_scene, level_camera, window, target, at);
        kept->place_bodies(at);
        return *kept;
    }

    const RenderScene& render_scene;
    Camera camera;
    const std::size_t target;
    const SensorModel sensor;
    std::array<std::optional<LevelView>, 7> levels{};  ///< by the logarithm of their factor
};

namespace {

/// Means over factor x factor pixels have this variance.
std::vector<float> coarser_variance(std::span<const float> variance, const Camera& camera, int factor) {
    if (variance.empty()) return {};
    MeasuredImage mean = coarser_image({camera.width, camera.height, {variance.begin(), variance.end()}}, factor);
    for (float& v : mean.dn) v /= static_cast<float>(factor * factor);
    return std::move(mean.dn);
}

Status check_input(const Camera& camera, const MeasuredImage& frame, std::span<const float> frame_variance,
                   std::size_t bodies, const BodyPoses& at, const Rigid3& guess) {
    const auto size = [](auto w, auto h) { return std::to_string(w) + " x " + std::to_string(h); };
    const std::size_t pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
    if (frame.width != camera.width || frame.height != camera.height || frame.dn.size() != pixels)
        return Error{"a frame of " + size(frame.width, frame.height) + " pixels, expected the camera's " +
                     size(camera.width, camera.height)};
    if (!std::all_of(frame.dn.begin(), frame.dn.end(), [](float v) { return std::isfinite(v); }))
        return Error{"the frame has pixels that are not finite, expected DN"};
    if (!frame_variance.empty() && frame_variance.size() != pixels)
        return Error{"variances of " + std::to_string(frame_variance.size()) + " pixels, expected " +
                     std::to_string(pixels)};
    if (!std::all_of(frame_variance.begin(), frame_variance.end(),
                     [](float v) { return std::isfinite(v) && v >= 0; }))
        return Error{"the frame's variance has pixels that are negative or not finite, expected DN^2"};
    if (at.T_world_body.size() != bodies)
        return Error{"poses of " + std::to_string(at.T_world_body.size()) + " bodies, expected the scene's " +
                     std::to_string(bodies)};
    if (!is_pose(guess)) return Error{"the guess is no pose, expected finite numbers and a quaternion of norm 1"};
    return Ok{};
}

}  // namespace

DenseAlignment::DenseAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target)
    : impl_(std::make_unique<Impl>(render_scene, camera, target)) {}
DenseAlignment::~DenseAlignment() = default;

Result<DenseEstimate> DenseAlignment::align(const MeasuredImage& frame, const BodyPoses& at,
                                            const Rigid3& T_camera_body_guess, const DenseOptions& options,
                                            std::span<const float> frame_variance) {
    Impl& i = *impl_;
    if (const Status good = check_input(i.camera, frame, frame_variance, i.render_scene.scene().bodies.size(), at,
                                        T_camera_body_guess);
        !good)
        return good.error();
    DenseEstimate e;
    e.T_camera_body = T_camera_body_guess;
    const std::optional<Window> about =
        window_about(i.render_scene.tracer(), i.camera, i.target, T_camera_body_guess);
    if (!about) {
        e.status = DenseStatus::left_the_picture;
        return e;
    }
    int factor = options.coarsest;
    while (factor > options.finest && extent_px(*about) / factor < kLeastExtent_px) factor /= 2;
    for (bool first = true; factor >= options.finest; factor /= 2, first = false) {
        const Camera camera = coarser_camera(i.camera, factor);
        std::optional<Window> window = window_about(i.render_scene.tracer(), camera, i.target, e.T_camera_body);
        if (!window) {
            e.status = DenseStatus::left_the_picture;
            return e;
        }
        // From a guess the target may have far to go.
        if (first && factor > 1) window = Window{0, 0, camera.width, camera.height};
        LevelView& view = i.view_of(factor, camera, *window, at);
        view.measure(coarser_image(frame, factor), coarser_variance(frame_variance, i.camera, factor));
        LevelSolver solver(camera, i.sensor, i.render_scene, i.target, factor, view, options, e);
        e.status = solver.run(first);
        if (factor != options.finest || e.status != DenseStatus::converged) continue;
        solver.polish();
        solver.finish();
    }
    return e;
}

Result<Matrix6> DenseAlignment::bound(const BodyPoses& at, const Rigid3& T_camera_body, const DenseOptions& options,
                                      std::span<const float> frame_variance) {
    Impl& i = *impl_;
    const MeasuredImage none{
        i.camera.width, i.camera.height,
        std::vector<float>(static_cast<std::size_t>(i.camera.width) * static_cast<std::size_t>(i.camera.height))};
    if (const Status good =
            check_input(i.camera, none, frame_variance, i.render_scene.scene().bodies.size(), at, T_camera_body);
        !good)
        return good.error();
    const int factor = options.finest;
    const Camera camera = coarser_camera(i.camera, factor);
    const std::optional<Window> window = window_about(i.render_scene.tracer(), camera, i.target, T_camera_body);
    if (!window) return Error{"the target is not in the image"};
    LevelView& view = i.view_of(factor, camera, *window, at);
    view.measure(coarser_image(none, factor), coarser_variance(frame_variance, i.camera, factor));
    DenseEstimate e;
    e.T_camera_body = T_camera_body;
    LevelSolver solver(camera, i.sensor, i.render_scene, i.target, factor, view, options, e);
    return solver.bound();
}

}  // namespace narpa
