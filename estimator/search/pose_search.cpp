#include "estimator/search/pose_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "estimator/dense/level_solver.h"
#include "estimator/search/hypotheses.h"

namespace narpa {
namespace {

/// The target's least extent, px, in the coarse image that hypotheses are fitted to.
constexpr double kCoarseExtent_px = 20;
/// Largest extent of the target, px, in the finest image: acquisition needs no finer one.
constexpr double kFineExtent_px = 128;
constexpr int kCoarsest = 32;
/// Fits to the coarse image: samples per pixel, and lines each way per pixel of the derivative.
constexpr int kCoarseFitSamples = 8, kCoarseFitFineness = 3;
/// Hypotheses whose loss on the coarse image exceeds the least by more are dropped: the frame holds still more
/// information, and most of them have reached their minimum.
constexpr double kExcluded = 100;
constexpr std::size_t kMaxContenders = 4;
/// Tolerance about the known range interval, in standard deviations.
constexpr double kRangeSigmas = 3;
/// Number of fits with other sample seeds, where the frame's sampling noise is not known.
constexpr int kOtherSamples = 3;
/// Samples per pixel where whole images are compared.
constexpr int kWholeSamples = 16;

Status check_search(const SearchOptions& o, const Rigid3& T_world_camera) {
    if (!(o.range_m > 0 && std::isfinite(o.range_m)))
        return Error{fmt::format("range_m = {:g}: expected a range above 0 m", o.range_m)};
    if (!(o.range_part > 0 && o.range_part < 1))
        return Error{fmt::format("range_part = {:g}: expected a part of the range between 0 and 1", o.range_part)};
    if (o.attitudes < 1 || o.kept < 1 || o.finished < 1)
        return Error{"attitudes, kept and finished: expected at least 1 of each"};
    if (!is_pose(T_world_camera))
        return Error{"the camera's pose in the world: expected finite numbers and a quaternion of norm 1"};
    return Ok{};
}

/// Photometric loss over the whole image; its minimum is the most likely pose.
class WholeImage {
public:
    WholeImage(const SearchView& known, const SensorModel& sensor, int factor, const MeasuredImage& frame,
               std::span<const float> variance, const DenseOptions& options)
        : camera_(coarser_camera(known.camera, factor)),
          view_(known.render_scene, camera_, sensor, static_cast<double>(factor) * factor,
                Window{0, 0, camera_.width, camera_.height}, known.target, known.at) {
        view_.begin_frame(known.at, options.motion, row_times(known.camera).scaled(factor), options.model,
                          known.T_world_camera);
        view_.measure(coarser_image(frame, factor), coarser_variance(variance, known.camera, factor));
        settings_.seed = options.seed, settings_.method = options.method, settings_.max_depth = options.max_depth;
        settings_.spp = kWholeSamples;
    }
    [[nodiscard]] double loss(const DenseEstimate& e) {
        view_.render(e.T_camera_body, settings_);
        return cost(view_.images(), e.exposure, {}).robust;
    }

private:
    Camera camera_;
    LevelView view_;
    FrameSettings settings_{};
};

/// Factor of an answer's covariance_of_image where the frame's sampling noise is not known: that noise is taken to
/// be as large as the renders', and the squared difference of two fits with different samples has twice the
/// variance of one.
double with_sampling_noise(DenseAlignment& dense, const MeasuredImage& frame, const BodyPoses& at,
                           const DenseEstimate& answer, DenseOptions options, int& renders) {
    options.coarsest = options.finest, options.rivals = 0;
    const Matrix6 of_image = answer.covariance_of_image();
    double sum = 0;
    for (int k = 0; k < kOtherSamples; ++k) {
        ++options.seed;
        const auto fit = dense.align(frame, at, answer.T_camera_body, options);
        if (!fit) return 1;
        renders += fit->renders;
        sum += normalised_error_squared(error_between(answer.T_camera_body, fit->T_camera_body), of_image);
    }
    return 1 + sum / (6 * kOtherSamples);
}

}  // namespace

struct PoseSearch::SearchState {
    SearchView known;
    const MeasuredImage& frame;
    std::span<const float> variance;
    DenseOptions dense;
    int factor = 1;  ///< of the coarse image
    std::vector<Hypothesis> hypotheses;
};

/// A hypothesis and the poses its fits converge to.
struct PoseSearch::Contender {
    Rigid3 start{}, coarse{};
    DenseEstimate fit;
    double loss = 0;
};

PoseSearch::PoseSearch(const RenderScene& render_scene, const Camera& camera, std::size_t target)
    : render_scene_(render_scene), camera_(camera), target_(target), dense_(render_scene, camera, target) {
    if (camera_.embedded_line) {
        --camera_.height;
        camera_.embedded_line = false;
    }
}

void PoseSearch::set_detector(const Detector& detector) {
    camera_.detector = detector;
    dense_.set_detector(detector);
}

Result<Matrix6> PoseSearch::bound(const BodyPoses& at, const Rigid3& T_world_camera, const Rigid3& T_camera_target,
                                  DenseOptions options, std::span<const float> frame_variance) {
    options.T_world_camera = T_world_camera;
    return dense_.bound(at, T_camera_target, options, frame_variance);
}

Result<SearchEstimate> PoseSearch::find(const MeasuredImage& frame, const BodyPoses& at,
                                        const Rigid3& T_world_camera, const SearchOptions& options,
                                        std::span<const float> frame_variance) {
    if (auto good = check_search(options, T_world_camera); !good) return good.error();
    SearchState sought{{render_scene_, camera_, target_, at, T_world_camera, options.range_m,
                        (1 - options.range_part) * options.range_m, (1 + options.range_part) * options.range_m},
                       frame,
                       frame_variance,
                       options.dense,
                       1,
                       {}};
    if (auto good = dense_.check(frame, frame_variance, at, {}); !good) return good.error();
    sought.dense.T_world_camera = T_world_camera;
    SearchEstimate out;
    const auto region = find_bright_region(sought.known, frame);
    if (!region || region->pixels < options.fewest_pixels) {
        out.answer.why = fmt::format("{} pixels stand out against the background, expected at least {}",
                                     region ? region->pixels : 0, options.fewest_pixels);
        return out;
    }
    sought.hypotheses = find_hypotheses(sought.known, frame, *region, options.attitudes, options.kept,
                                        options.finished, out.templates);
    const double extent_px = sought.known.extent_px();
    while (extent_px / (2 * sought.factor) >= kCoarseExtent_px && sought.factor < kCoarsest) sought.factor *= 2;
    while (extent_px / sought.dense.finest >= kFineExtent_px && sought.dense.finest < sought.factor)
        sought.dense.finest *= 2;
    std::vector<Contender> contenders = coarse_fits(sought, out);
    if (contenders.empty()) {
        out.answer.why = sought.hypotheses.empty()
                             ? "no attitude hypothesis matches the bright region of the frame"
                             : fmt::format("none of {} hypotheses leads to a pose", sought.hypotheses.size());
        return out;
    }
    if (auto good = fine_fits(sought, contenders, out); !good) return good.error();
    return out;
}

/// Fits the hypotheses to a coarse image and returns those that it does not exclude, in order of loss.
std::vector<PoseSearch::Contender> PoseSearch::coarse_fits(const SearchState& sought, SearchEstimate& out) {
    DenseOptions options = sought.dense;
    options.coarsest = options.finest = sought.factor;
    options.samples_per_pixel = kCoarseFitSamples;
    options.fineness = kCoarseFitFineness;
    options.rivals = 0;
    const SensorModel sensor = sensor_model(camera_);
    WholeImage whole(sought.known, sensor, sought.factor, sought.frame, sought.variance, options);
    std::vector<Contender> all;
    for (const Hypothesis& h : sought.hypotheses) {
        auto fit = dense_.align(sought.frame, sought.known.at, h.T_camera_target, options, sought.variance);
        if (!fit || fit->status == DenseStatus::left_the_picture) continue;
        out.renders += fit->renders;
        all.push_back({h.T_camera_target, fit->T_camera_body, *fit, whole.loss(*fit)});
    }
    std::ranges::stable_sort(all, {}, &Contender::loss);
    std::vector<Contender> apart;
    for (const Contender& c : all) {
        if (c.loss > all.front().loss + kExcluded || apart.size() == kMaxContenders) break;
        const bool elsewhere = std::ranges::all_of(apart, [&](const Contender& other) {
            return angle_between(c.fit.T_camera_body.q, other.fit.T_camera_body.q) > 2 * kDegree;
        });
        if (elsewhere) apart.push_back(c);
    }
    return apart;
}

/// Fits from the hypothesis. If that does not converge, retries from both sides of the coarse result with other
/// samples.
Result<DenseEstimate> PoseSearch::fine_fit(const SearchState& sought, const Contender& contender,
                                           DenseOptions options, SearchEstimate& out) {
    auto fit = dense_.align(sought.frame, sought.known.at, contender.start, options, sought.variance);
    for (const double side : {0.5, -0.5}) {
        if (!fit) return fit;
        out.renders += fit->renders;
        if (fit->status == DenseStatus::converged && fit->answer.kind != AnswerKind::refused) return fit;
        const Vector6 way = error_between(contender.coarse, contender.start);
        ++options.seed;
        fit = dense_.align(sought.frame, sought.known.at, displaced(contender.coarse, side * way), options,
                           sought.variance);
    }
    if (fit) out.renders += fit->renders;
    return fit;
}

/// Fits the contenders to the frame; the one with the smallest loss is the answer.
Status PoseSearch::fine_fits(const SearchState& sought, std::vector<Contender>& contenders, SearchEstimate& out) {
    const SensorModel sensor = sensor_model(camera_);
    DenseOptions options = sought.dense;
    options.coarsest = sought.factor;
    WholeImage whole(sought.known, sensor, options.finest, sought.frame, sought.variance, options);
    out.contenders = static_cast<int>(contenders.size());
    if (contenders.size() > 1)
        for (Contender& c : contenders) {
            options.rivals = 0;
            auto fit = fine_fit(sought, c, options, out);
            if (!fit) return fit.error();
            c.fit = *std::move(fit), c.loss = whole.loss(c.fit);
        }
    std::ranges::stable_sort(contenders, {}, &Contender::loss);
    Contender& best = contenders.front();
    options.rivals = sought.dense.rivals;
    auto fit = fine_fit(sought, best, options, out);
    if (!fit) return fit.error();
    out.T_camera_target = fit->T_camera_body;
    out.covariance = fit->covariance, out.covariance_of_model = fit->covariance_of_model;
    out.pixels = fit->pixels, out.residual = fit->residual, out.answer = fit->answer;
    if (!out.answer.usable()) return Ok{};

    const bool noise_known = !sought.variance.empty();
    if (!noise_known)
        out.covariance +=
            (with_sampling_noise(dense_, sought.frame, sought.known.at, *fit, options, out.renders) - 1) *
            fit->covariance_of_image();
    Fit judged;
    observe(out.T_camera_target, out.covariance, judged);
    for (const Contender& c : contenders) {
        if (&c == &best || c.loss - best.loss > kRival_chi2) continue;
        const Vector6 apart = error_between(out.T_camera_target, c.fit.T_camera_body);
        if (normalised_error_squared(apart, out.covariance) > kDistinctPose_chi2)
            judged.rivals.push_back({c.fit.T_camera_body, std::max(0.0, c.loss - best.loss)});
    }
    const double range_m = norm(out.T_camera_target.t), slack_m = kRangeSigmas * position_sigma(out.covariance);
    if (range_m < sought.known.min_m - slack_m || range_m > sought.known.max_m + slack_m)
        judged.failed = fmt::format("a range of {:.4g} m, expected {:.4g} to {:.4g} m", range_m, sought.known.min_m,
                                    sought.known.max_m);
    if (!noise_known || !judged.failed.empty() || !judged.rivals.empty()) out.answer = judge(std::move(judged));
    return Ok{};
}

}  // namespace narpa
