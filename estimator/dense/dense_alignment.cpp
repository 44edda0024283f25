#include "estimator/dense/dense_alignment.h"

#include <fmt/format.h>
#include <cassert>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "estimator/dense/dense_tuning.h"
#include "estimator/dense/level_solver.h"

namespace narpa {

using namespace dense_tuning;

namespace {

/// Makes the pose with the smaller loss the answer.
void keep_better(DenseEstimate& answer, DenseEstimate& other) {
    other.renders = answer.renders;
    if (other.excess_loss < answer.excess_loss) std::swap(answer, other);
}

/// One standard deviation of each of the two least observed motions, if it is weak (kWeakMotion).
std::vector<Vector6> weak_motions(const DenseEstimate& e) {
    constexpr int kMax = 2;
    const Observability o = observability_of(e.covariance_of_image(), norm(e.T_camera_body.t));
    std::vector<Vector6> out;
    for (int i = 0; i < kMax; ++i) {
        const Vector6 motion = o.motions.col(i) / std::sqrt(o.eigenvalues[i]);
        if (std::max(motion.head<3>().norm() / kMaxRotation_rad,
                     motion.tail<3>().norm() / (kMaxTranslation * norm(e.T_camera_body.t))) > kWeakMotion)
            out.push_back(motion);
    }
    return out;
}

/// Rotation of a plane with this normal about its intersection with the image plane to the same tilt on the other
/// side of the line of sight.
Quat other_tilt(const Vec3& normal, const Vec3& position_m) {
    const Vec3 axis = cross(normal, -normalized(position_m));
    const double sine = norm(axis);
    return sine > 1e-9 ? exp_rotation(2 * std::asin(std::min(1.0, sine)) / sine * axis) : Quat{};
}

/// Factor of a descent's first level: the coarsest that shows enough of a target of this extent.
int first_level(const DenseOptions& options, double target_px) {
    int factor = options.coarsest;
    while (factor > options.finest && target_px / factor < kExtentMin_px) factor /= 2;
    return factor;
}

std::size_t level_number(int factor) {
    assert(factor > 0 && std::has_single_bit(static_cast<unsigned>(factor)));
    return static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(factor)));
}

}  // namespace

std::string_view name(DenseStatus status) noexcept {
    constexpr std::array<std::string_view, 6> names{"converged",    "out of steps",     "diverged",
                                                    "does not fit", "left the picture", "too few pixels"};
    return names[static_cast<std::size_t>(status)];
}

DenseAlignment::DenseAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target)
    : render_scene_(render_scene),
      camera_(camera),
      target_(target),
      sensor_(sensor_model(camera)),
      times_(row_times(camera)) {
    if (camera_.embedded_line) {  // the last row holds no light
        --camera_.height;
        camera_.embedded_line = false;
    }
}

void DenseAlignment::set_detector(const Detector& detector) {
    camera_.detector = detector;
    sensor_ = sensor_model(camera_);
    times_.exposure_s = row_times(camera_).exposure_s;  // the middle of a row does not depend on it
}

Status DenseAlignment::check(const MeasuredImage& frame, std::span<const float> frame_variance, const BodyPoses& at,
                             const Rigid3& guess) const {
    if (auto good = check_image(camera_, frame, "the frame"); !good) return good;
    if (!frame_variance.empty() && frame_variance.size() != frame.dn.size())
        return Error{"variances of " + std::to_string(frame_variance.size()) + " pixels, expected " +
                     std::to_string(frame.dn.size())};
    if (!std::all_of(frame_variance.begin(), frame_variance.end(),
                     [](float v) { return std::isfinite(v) && v >= 0; }))
        return Error{"the frame's variance has pixels that are negative or not finite, expected DN^2"};
    if (const std::size_t bodies = render_scene_.scene().bodies.size(); at.T_world_body.size() != bodies)
        return Error{"poses of " + std::to_string(at.T_world_body.size()) + " bodies, expected the scene's " +
                     std::to_string(bodies)};
    if (!is_pose(guess)) return Error{"the guess is no pose, expected finite numbers and a quaternion of norm 1"};
    return Ok{};
}

LevelView& DenseAlignment::level(int factor, const Camera& camera, const Window& window, const Measured& m,
                                 const DenseOptions& options) {
    const std::size_t number = level_number(factor);
    auto& kept = levels_[number];
    if (!kept || kept->window() != window)
        kept.emplace(render_scene_, camera, sensor_, static_cast<double>(factor) * factor, window, target_, m.at);
    else if (hold_frame_[number])
        return *kept;
    hold_frame_[number] = true;
    kept->begin_frame(m.at, options.motion, times_.scaled(factor), options.model, options.T_world_camera);
    kept->measure(coarser_image(m.frame, factor), coarser_variance(m.variance, camera_, factor));
    return *kept;
}

void DenseAlignment::evaluate_losses_on_common_pixels(const Measured& m, const DenseOptions& options,
                                                      DenseEstimate& a, DenseEstimate& b) {
    if (a.window == b.window && a.sampling_factor == b.sampling_factor && a.overconfidence == b.overconfidence)
        return;
    a.sampling_factor = b.sampling_factor = std::min(a.sampling_factor, b.sampling_factor);
    a.overconfidence = b.overconfidence = std::max(a.overconfidence, b.overconfidence);
    const Camera camera = coarser_camera(camera_, options.finest);
    const Window both = joined(a.window, b.window);
    LevelView& view = level(options.finest, camera, both, m, options);
    for (DenseEstimate* e : {&a, &b})
        LevelSolver(camera, render_scene_, target_, options.finest, view, options, *e).evaluate_loss();
}

Result<DenseEstimate> DenseAlignment::align(const MeasuredImage& frame, const BodyPoses& at,
                                            const Rigid3& T_camera_body_guess, const DenseOptions& options,
                                            std::span<const float> frame_variance) {
    if (auto good = check(frame, frame_variance, at, T_camera_body_guess); !good) return good.error();
    hold_frame_.fill(false);
    const Measured m{frame, at, frame_variance};
    DenseEstimate e = descend(m, T_camera_body_guess, options, options.finest);
    Fit fit;
    if (e.status == DenseStatus::converged && options.rivals > 0)
        test_by_mirrored_starts(m, T_camera_body_guess, options, e, fit);
    if (e.status == DenseStatus::converged && options.rivals > 0 && fit.failed.empty() && !weak_motions(e).empty())
        test_weak_motions(m, options, e, fit);
    if (e.status == DenseStatus::converged) {
        observe(e.T_camera_body, e.covariance, fit);
        compare_with_guess(e.T_camera_body, T_camera_body_guess, fit);
        fit.guess_error = options.guess_error;
        const bool exact = options.model == ModelUncertainty{};
        fit.residual = e.residual;
        const bool inexact = !exact && options.model.detail == 0;
        fit.residual_max = inexact                           ? options.residual_max_model_inexact
                           : exact && frame_variance.empty() ? options.residual_max_noise_estimated
                                                             : options.residual_max;
        if (options.rivals > 0) test_model(m, options, e, fit);
        if (options.rivals > 0 && fit.failed.empty() && fit.observability.unobserved > 0)
            keep_guess_where_unobserved(m, T_camera_body_guess, options, e, fit);
    } else {
        fit.failed = name(e.status);
    }
    e.answer = judge(std::move(fit));
    return e;
}

/// A point spread function shares samples between neighbouring pixels, and a mosaic's colours are means of
/// neighbours. Rounding acts like noise if there is half a step of other noise (B. Widrow, IRE Trans. Circuit
/// Theory 3, 1956).
bool DenseAlignment::has_independent_noise() const {
    constexpr double kDithered = 3;  // half a step squared over rounding's variance, step^2 / 12
    return !camera_.optics.point_spread && !is_bayer(camera_.format) &&
           sensor_.read_dn2 >= kDithered * sensor_.rounding_dn2;
}

/// One of the mirrored starts must lead to the answer, or to a pose that is as likely. Its coarse levels suffice if
/// one step from their result leads to the answer. If the first start leads elsewhere, the answer is the pose with
/// the smaller loss, and two of the three starts (with the guess) must lead to it.
void DenseAlignment::test_by_mirrored_starts(const Measured& m, const Rigid3& guess, const DenseOptions& options,
                                             DenseEstimate& e, Fit& fit) {
    if (is_near(options, guess, e)) return;
    fit.failed = "no second start leads to the same pose";
    for (int k = 0; k < options.rivals && !fit.failed.empty(); ++k) {
        const Vector6 beyond = std::pow(0.5, k) * error_between(guess, e.T_camera_body);
        DenseEstimate other = descend(m, displaced(e.T_camera_body, beyond), options, 2 * options.finest);
        e.renders += other.renders;
        if (other.status == DenseStatus::left_the_picture) continue;
        if (converges_to(e, other, options))
            fit.failed.clear();
        else
            descend_and_compare(m, options, other.T_camera_body, e, fit);
    }
    if (fit.failed.empty() && fit.rivals.empty()) test_by_start_near(m, guess, options, e, fit);
}

/// True if the guess, such as a filter's prediction, lies so near the answer that starts as near test nothing.
bool DenseAlignment::is_near(const DenseOptions& options, const Rigid3& guess, DenseEstimate& e) {
    const Camera camera = coarser_camera(camera_, options.finest);
    LevelView& finest = *levels_[level_number(options.finest)];
    return LevelSolver(camera, render_scene_, target_, options.finest, finest, options, e)
        .may_be_same_minimum(error_between(guess, e.T_camera_body));
}

/// True if steps from the other's coarse result lead to the answer. Adds the variance of the two to the covariance.
bool DenseAlignment::converges_to(DenseEstimate& e, DenseEstimate& other, const DenseOptions& options) {
    other.exposure = e.exposure, other.sampling_factor = e.sampling_factor;
    other.overconfidence = e.overconfidence, other.renders = 0;
    const Camera camera = coarser_camera(camera_, options.finest);
    LevelView& finest = *levels_[level_number(options.finest)];
    LevelSolver solver(camera, render_scene_, target_, options.finest, finest, options, other);
    const auto apart = solver.distance_after_steps_to(e.T_camera_body);
    e.renders += other.renders;
    if (apart) e.covariance += 0.5 * *apart * apart->transpose();
    return apart.has_value();
}

/// Descends from `start` to the finest level and keeps the pose with the smaller loss. No change if that finds no
/// pose.
void DenseAlignment::descend_and_compare(const Measured& m, const DenseOptions& options, const Rigid3& start,
                                         DenseEstimate& e, Fit& fit) {
    DenseOptions to_finest = options;
    to_finest.coarsest = options.finest;
    DenseEstimate other = descend(m, start, to_finest, options.finest);
    e.renders += other.renders;
    if (other.status != DenseStatus::converged) return;
    const Vector6 apart = error_between(e.T_camera_body, other.T_camera_body);
    if (normalised_error_squared(apart, e.covariance + other.covariance) < kAgree_chi2) {
        e.covariance += 0.5 * apart * apart.transpose();
        fit.failed.clear();
        return;
    }
    evaluate_losses_on_common_pixels(m, options, e, other);
    keep_better(e, other);
    const double worse = other.excess_loss - e.excess_loss;
    fit.failed = worse < kRival_chi2 ? "" : "two starts lead to different poses";
    if (worse < kRival_chi2) fit.rivals.push_back({other.T_camera_body, worse});
}

/// The coarsest levels may lead both starts away from a pose near the guess, to the same false minimum. So if the
/// answer is far from the guess, a third start skips them. Its pose counts only if its loss is smaller.
void DenseAlignment::test_by_start_near(const Measured& m, const Rigid3& guess, const DenseOptions& options,
                                        DenseEstimate& e, Fit& fit) {
    DenseOptions without = options;
    without.coarsest = 2 * options.finest;
    const auto window = window_about(render_scene_.tracer(), camera_, target_, guess);
    if (!window || first_level(options, extent_px(*window)) <= without.coarsest ||
        error_between(guess, e.T_camera_body).head<3>().norm() < kThirdStart_rad)
        return;
    DenseEstimate other = descend(m, guess, without, without.coarsest);
    e.renders += other.renders;
    if (other.status == DenseStatus::left_the_picture || converges_to(e, other, options)) return;
    const Camera camera = coarser_camera(camera_, without.coarsest);
    LevelView& view = *levels_[level_number(without.coarsest)];
    DenseEstimate here = e, there = other;
    there.exposure = e.exposure;
    for (DenseEstimate* x : {&here, &there})
        LevelSolver(camera, render_scene_, target_, without.coarsest, view, options, *x).evaluate_loss();
    e.renders += 2;
    if (there.excess_loss < here.excess_loss) descend_and_compare(m, options, other.T_camera_body, e, fit);
}

/// Tests what the covariance of a weak motion does not include: other minima along it; a flat face tilted to the
/// other side of the line of sight; an image that is not linear in the pose over a few standard deviations. If all
/// motions count as observed, at least one of these descents must converge: else nothing was tested.
void DenseAlignment::test_weak_motions(const Measured& m, const DenseOptions& options, DenseEstimate& e, Fit& fit) {
    const Camera camera = coarser_camera(camera_, options.finest);
    const auto view_of_answer = [&]() -> LevelView& {
        const auto window = window_about(render_scene_.tracer(), camera, target_, e.T_camera_body);
        return level(options.finest, camera, *window, m, options);
    };
    std::vector<Rigid3> starts;
    for (const Vector6& motion : weak_motions(e))
        for (const double sigmas : {kSearchedBeside_sigmas, -kSearchedBeside_sigmas})
            starts.push_back(displaced(e.T_camera_body, sigmas * motion));
    LevelView& view = view_of_answer();
    LevelSolver(camera, render_scene_, target_, options.finest, view, options, e).linearise_with_many_samples();
    if (const auto face = view.flat_face())
        starts.push_back({other_tilt(*face, e.T_camera_body.t) * e.T_camera_body.q, e.T_camera_body.t});
    std::vector<DenseEstimate> minima{e};
    for (const Rival& r : std::exchange(fit.rivals, {})) {
        minima.push_back(e);
        minima.back().T_camera_body = r.T_sensor_target, minima.back().excess_loss += r.worse_chi2;
    }
    DenseOptions from_near = options;
    from_near.coarsest = std::min(options.coarsest, 2 * options.finest);
    bool tested = false;
    for (const Rigid3& start : starts) {
        DenseEstimate other = descend(m, start, from_near, options.finest);
        e.renders += other.renders;
        if (other.status != DenseStatus::converged) continue;
        tested = true;
        evaluate_losses_on_common_pixels(m, options, e, other);
        minima.push_back(other);
        keep_better(e, other);
    }
    if (!tested && observability_of(e.covariance, norm(e.T_camera_body.t)).unobserved == 0)
        fit.failed = "no descent beside the weakest motion converges, so that it is not tested";
    for (DenseEstimate& other : minima) {
        const Vector6 apart = error_between(e.T_camera_body, other.T_camera_body);
        if (!(normalised_error_squared(apart, e.covariance) > kDistinctPose_chi2)) continue;
        evaluate_losses_on_common_pixels(m, options, e, other);
        const double worse = other.excess_loss - e.excess_loss;
        if (worse < kRival_chi2) fit.rivals.push_back({other.T_camera_body, worse});
    }
    LevelSolver solver(camera, render_scene_, target_, options.finest, view_of_answer(), options, e);
    solver.linearise_with_many_samples();
    for (const LinearityTest& test : kLinearityTests)
        if (const auto rise = solver.rise(test.motions, test.sigmas);
            !(rise.min > test.rise_min && rise.max < test.rise_max()))
            fit.failed =
                fmt::format("the image is not linear in the pose over {:g} standard deviations", test.sigmas);
}

DenseEstimate DenseAlignment::descend(const Measured& m, const Rigid3& guess, const DenseOptions& options,
                                      int last) {
    DenseEstimate e;
    e.T_camera_body = guess;
    const Tracer& tracer = render_scene_.tracer();
    const std::optional<Window> about = window_about(tracer, camera_, target_, guess);
    if (!about) {
        e.status = DenseStatus::left_the_picture;
        return e;
    }
    int factor = first_level(options, extent_px(*about));
    for (bool first = options.coarsest > options.finest; factor >= last;
         factor = next_level(factor, options.finest, extent_px(*about)), first = false) {
        const Camera camera = coarser_camera(camera_, factor);
        std::optional<Window> window = window_about(tracer, camera, target_, e.T_camera_body);
        if (!window) {
            e.status = DenseStatus::left_the_picture;
            return e;
        }
        // The first level uses the whole image, as the guess may be far off.
        if (first && factor > 1) window = Window{0, 0, camera.width, camera.height};
        LevelView& view = level(factor, camera, *window, m, options);
        LevelSolver solver(camera, render_scene_, target_, factor, view, options, e);
        e.status = solver.run(first);
        if (factor != options.finest || e.status != DenseStatus::converged) continue;
        solver.refine_with_many_samples();
        solver.finish();
    }
    return e;
}

Result<Matrix6> DenseAlignment::bound(const BodyPoses& at, const Rigid3& T_camera_body, const DenseOptions& options,
                                      std::span<const float> frame_variance) {
    const MeasuredImage none{
        camera_.width, camera_.height,
        std::vector<float>(static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height))};
    if (auto good = check(none, frame_variance, at, T_camera_body); !good) return good.error();
    const Camera camera = coarser_camera(camera_, options.finest);
    const std::optional<Window> window = window_about(render_scene_.tracer(), camera, target_, T_camera_body);
    if (!window) return Error{"the target is not in the image"};
    hold_frame_.fill(false);
    LevelView& view = level(options.finest, camera, *window, {none, at, frame_variance}, options);
    DenseEstimate e;
    e.T_camera_body = T_camera_body;
    return LevelSolver(camera, render_scene_, target_, options.finest, view, options, e).bound();
}

}  // namespace narpa
