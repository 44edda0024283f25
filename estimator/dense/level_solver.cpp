#include "estimator/dense/level_solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/dense/dense_tuning.h"
#include "estimator/dense/sampling_noise.h"
#include "estimator/least_squares/symmetric.h"
#include "estimator/uncertainty/unobserved.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {

using namespace dense_tuning;

namespace {

/// Approximate largest motion of a point of the target in the image.
double motion_px(const Vector6& step, double pixels_per_radian, const Rigid3& T_camera_target, double extent_px) {
    const double z = std::max(T_camera_target.t.z, 1e-9);
    return pixels_per_radian * step.segment<2>(3).norm() / z +
           0.5 * extent_px * (step.head<3>().norm() + std::abs(step[5]) / z);
}

std::size_t pixels_of(const Window& window) {
    return static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height);
}

}  // namespace

int next_level(int factor, int finest, double extent_px) {
    if (factor == finest) return 0;
    const bool far = factor <= kFarStep * finest && extent_px / factor >= kExtentBeforeFarStep_px;
    return far ? finest : factor / 2;
}

bool is_pose(const Rigid3& T) {
    const bool finite = std::isfinite(T.q.w) && is_finite(T.q.vec()) && is_finite(T.t);
    return finite && std::abs(norm(T.q) - 1) < 1e-3;
}

LevelSolver::LevelSolver(const Camera& camera, const RenderScene& render_scene, std::size_t target, int factor,
                         LevelView& view, const DenseOptions& options, DenseEstimate& estimate)
    : camera_(camera),
      pixels_per_radian_(camera.model->pixels_per_radian()),
      render_scene_(render_scene),
      target_(target),
      view_(view),
      o_(options),
      e_(estimate),
      coarse_(factor > options.finest),
      converged_px_(coarse_ && next_level(factor, options.finest, factor * extent_px(view.window())) < factor / 2
                        ? kConvergedBeforeFarStep_px
                        : kConverged_px),
      settings_{.spp = std::max(2, options.samples_per_pixel * (coarse_ ? kCoarseSamples : 1)),
                .seed = options.seed,
                .method = options.method,
                .max_depth = options.max_depth},
      choosing_(!coarse_ && !camera.optics.spreads_light() && pixels_of(view.window()) >= kPixelsOfLargeTarget) {}

DenseStatus LevelSolver::run(bool first) {
    view_.choose_all();
    const int samples = settings_.spp;
    if (choosing_) settings_.spp = std::max(2, samples / kChoiceSamplesDivisor);
    render(e_.T_camera_body);
    if (first) shift();
    const DenseStatus status = iterate(samples);
    settings_.spp = samples;
    return status;
}

/// `samples`: per pixel once pixels are chosen.
DenseStatus LevelSolver::iterate(int samples) {
    robust_.model_dn2 = coarse_ ? kCoarseModelPart * signal_power(images()) : 0;
    double damping = kDampingFirst;
    double least = std::numeric_limits<double>::infinity();
    int stalled = 0;
    for (int k = 0; k < o_.iterations; ++k) {
        differentiate();
        if (!linearise()) return DenseStatus::too_few_pixels;
        if (choosing_ && cost_.pixels < kPixelsOfLargeTarget) {
            choosing_ = false;
            settings_.spp = samples;
            render(e_.T_camera_body);
            differentiate();
            if (!linearise()) return DenseStatus::too_few_pixels;
        }
        if (k == 0) ++e_.renders;
        const double cost_before = cost_.robust;
        Step step = next_step(damping);
        const double max_px = k < kStepsBeforeChoice ? kChooseBelow_px : kJacobianValid_px;
        const bool chosen = choosing_ && step.motion_px < max_px;
        if (chosen) {
            choose(step.pose);
            settings_.spp = samples;
            step.trusted = true;
        }
        if (step.size < 1 && !chosen) {
            take(step);
            return DenseStatus::converged;
        }
        for (int refused = 0; !try_step(step); ++refused) {
            if (refused == kRefusedMax) return DenseStatus::diverged;
            if (stride_ == 1) damping *= kDampingFactor;
            stride_ = 1;
            step = next_step(damping);
        }
        // Sampling noise keeps the pose moving: ends when steps neither shrink nor reduce the cost.
        const bool shrinks = step.size < kShrinking * least;
        const bool gains = coarse_ ? cost_.robust < (1 - kCoarseProgress) * cost_before : step.size > kNoiseSteps;
        stalled = shrinks || gains ? 0 : stalled + 1;
        least = std::min(least, step.size);
        if (step.trusted && stalled == kStalledMax) return DenseStatus::converged;
        damping = std::max(damping / kDampingFactor, kDampingMin);
        adapt_stride(step);
    }
    return least < kNoiseSteps ? DenseStatus::converged : DenseStatus::out_of_steps;
}

void LevelSolver::refine_with_many_samples() {
    const LastSteps& last = images().chosen.empty() ? kLastStepsOfAllPixels : kLastStepsOfChosenPixels;
    const int samples = last.samples * settings_.spp;
    settings_.spp *= last.first_samples;
    stride_ = 1;
    render(e_.T_camera_body);
    ++e_.renders;
    for (int k = 0; k < kLastStepsMax; ++k) {
        differentiate(last.jacobian_valid_px, o_.fineness);
        measure_noise();
        if (!linearise()) return;
        Step step = next_step(kDampingMin);
        if (settings_.spp == samples && (step.sigmas < last.sigmas || step.motion_px < last.px)) {
            take(step);
            view_.predict(step.pose);
            return;
        }
        if (settings_.spp < samples && step.sigmas < last.before_sigmas) {
            settings_.spp = samples;
            step.trusted = step.trusted || step.motion_px < kJacobianValid_px;
        }
        if (!try_step(step)) return;
    }
}

/// Pixels that are not chosen keep their samples, with the signal predicted after this step.
void LevelSolver::choose(const Vector6& step) {
    std::vector<std::uint8_t> pixels = informative_pixels(images(), e_.exposure, kChosenInformation);
    view_.predict(step);
    view_.choose(std::move(pixels));
    choosing_ = false;
}

void LevelSolver::differentiate() {
    differentiate(kJacobianValid_px, choosing_ ? kChoiceLines : std::max(1, o_.fineness / kLinesDivisor));
}

bool LevelSolver::may_be_same_minimum(const Vector6& way) const {
    return distance_px(way) < kSameMinimum_px;
}

std::optional<Vector6> LevelSolver::distance_after_steps_to(const Rigid3& T_camera_body) {
    const Vector6 way = error_between(e_.T_camera_body, T_camera_body);
    if (!may_be_same_minimum(way)) return {};
    Vector6 left = way;
    const bool of_few_pixels = !images().chosen.empty();
    for (int k = 0; k < kSameMinimumSteps; ++k) {
        if (k > 0)
            settings_.spp *= (of_few_pixels ? kLastStepsOfChosenPixels : kLastStepsOfAllPixels).first_samples;
        render(e_.T_camera_body);
        ++e_.renders;
        differentiate(kSameMinimum_px, std::max(1, o_.fineness / kLinesDivisor));
        if (!linearise()) return {};
        e_.T_camera_body = displaced(e_.T_camera_body, next_step(kDampingMin).pose);
        left = error_between(e_.T_camera_body, T_camera_body);
        const Matrix6 information =
            equations_.pose_information() / std::max(robust_.scale * robust_.scale, e_.overconfidence);
        const double most =
            std::max(kSameMinimum_chi2, kSameMinimumPart * kSameMinimumPart * way.dot(information * way));
        if (!(left.dot(information * left) < most)) return {};
    }
    return left;
}

void LevelSolver::evaluate_loss() {
    view_.choose_all();
    settings_.spp *= kLastStepsOfAllPixels.samples;
    render(e_.T_camera_body);
    ++e_.renders;
    e_.window = view_.window();
    e_.excess_loss = cost(images(), e_.exposure, {}).excess() / e_.overconfidence;
}

void LevelSolver::linearise_with_many_samples() {
    view_.choose_all();
    const bool is_large = pixels_of(view_.window()) >= kPixelsOfLargeTarget;
    settings_.spp =
        (is_large ? kTestSamplesOfLargeTarget : kLastStepsOfAllPixels.samples) * std::max(2, o_.samples_per_pixel);
    render(e_.T_camera_body);
    differentiate(kJacobianValid_px, std::max(1, o_.fineness / kLinesDivisor));
    measure_noise();
    linearise();
    loss_when_linearised_ = cost(images(), e_.exposure, {}).robust;
}

PhotometricImages LevelSolver::images() const {
    PhotometricImages out = view_.images();
    out.sampling_factor = e_.sampling_factor;
    return out;
}

void LevelSolver::measure_noise() {
    const PhotometricImages now = images();
    if (now.measured_variance.empty())
        e_.sampling_factor = sampling_factor(now, e_.exposure, 1 + settings_.spp / kFewestSamplesOfFrame);
}

std::vector<Suspicion> LevelSolver::suspicions() {
    const PhotometricImages now = images();
    const FrameSettings few = settings_of_suspects();
    return narpa::suspicions({view_, now, e_.T_camera_body, few, o_.model, pixels_per_radian_}, e_.exposure,
                             robust_, e_.overconfidence);
}

FrameSettings LevelSolver::settings_of_suspects() const {
    FrameSettings few = settings_;
    few.spp = std::max(2, o_.samples_per_pixel);
    return few;
}

void LevelSolver::solve(const Suspicion& s) {
    const PhotometricImages now = images();
    const FrameSettings few = settings_of_suspects();
    const NuisanceColumns columns =
        s.suspect->columns({view_, now, e_.T_camera_body, few, o_.model, pixels_per_radian_});
    std::vector<float> light(now.signal.size());
    for (std::size_t i = 0; i < columns.size(); ++i)
        for (std::size_t p = 0; p < light.size(); ++p)
            light[p] += static_cast<float>(s.fit.amounts[i]) * columns[i][p];
    view_.add_light(light);
    e_.T_camera_body = displaced(e_.T_camera_body, s.fit.pose_step);
    e_.exposure.gain = std::max(e_.exposure.gain + s.fit.exposure_step.gain, kGainMin);
    e_.exposure.offset_dn += s.fit.exposure_step.offset_dn;
}

Vector6 LevelSolver::remaining_step() const {
    return ldlt_solve(equations_.pose_information(), equations_.pose_gradient());
}

void LevelSolver::step_along_observed(const Observability& o) {
    constexpr int kSteps = 2;
    view_.choose_all();
    for (int k = 0; k < kSteps; ++k) {
        render(e_.T_camera_body);
        ++e_.renders;
        differentiate(kJacobianValid_px, std::max(1, o_.fineness / kLinesDivisor));
        if (!linearise()) return;
        const Vector6 step = observed_step(o, equations_.pose_information(), equations_.pose_gradient());
        e_.T_camera_body = displaced(e_.T_camera_body, step);
    }
}

void LevelSolver::shift() {
    const int most = std::min({kShiftMax_px, view_.window().width / 4, view_.window().height / 4});
    const auto [dx, dy] = best_shift(images(), most);
    if (dx == 0 && dy == 0) return;
    Vector6 sideways = Vector6::Zero();
    const double z = std::abs(e_.T_camera_body.t.z);
    sideways[3] = dx * z / pixels_per_radian_, sideways[4] = dy * z / pixels_per_radian_;
    e_.T_camera_body = displaced(e_.T_camera_body, sideways);
    render(e_.T_camera_body);
}

void LevelSolver::render(const Rigid3& T) {
    view_.render(T, settings_);
    // With a large target thousands of pixels determine the pose, and overstated variances would bias the blur
    // score.
    if (!coarse_ && pixels_of(view_.window()) < kPixelsOfLargeTarget) view_.allow_for_missed_light(settings_.spp);
}

void LevelSolver::differentiate(double reach_px, int fineness) {
    const std::optional<Rigid3>& there = view_.differentiated_at();
    const bool fine_enough = view_.fineness() >= fineness;
    if (there && fine_enough && distance_px(error_between(*there, e_.T_camera_body)) < reach_px) return;
    view_.differentiate(e_.T_camera_body, settings_, fineness);
}

/// False where the pose is not observable.
bool LevelSolver::linearise() {
    const PhotometricImages now = images();
    robust_.scale = residual_scale(now, e_.exposure, robust_.model_dn2);
    cost_ = cost(now, e_.exposure, robust_);
    equations_ = equations(now, e_.exposure, robust_, false);
    return cost_.pixels >= kPixelsMin && equations_.observes_pose();
}

LevelSolver::Step LevelSolver::next_step(double damping) const {
    const Matrix6 information = equations_.pose_information();
    Step s;
    // LDLT, not damped_step: the information of a frame that shows next to nothing is indefinite by rounding, and
    // its step leads to a pose that is refused for what the image shows.
    Matrix6 damped = information;
    damped.diagonal() *= 1 + damping;
    s.pose = stride_ * ldlt_solve(damped, equations_.pose_gradient());
    s.sigmas = std::sqrt(std::max(s.pose.dot(information * s.pose), 0.0)) / robust_.scale;
    s.motion_px = distance_px(s.pose);
    s.size = s.motion_px / converged_px_;
    if (!coarse_) s.size = std::min(s.size, s.sigmas / kConverged_sigmas);
    s.trusted = stride_ == 1 && s.motion_px < (coarse_ ? kTrustCoarse_px : kTrustFine_px);
    return s;
}

double LevelSolver::distance_px(const Vector6& step) const {
    return motion_px(step, pixels_per_radian_, e_.T_camera_body, extent_px(view_.window()));
}

/// Fine details that are off by more than their extent make steps too short: while consecutive steps are parallel,
/// they are lengthened.
void LevelSolver::adapt_stride(const Step& step) {
    const Matrix6 information = equations_.pose_information();
    const double along = step.pose.dot(information * last_step_);
    const double lengths =
        std::sqrt(step.pose.dot(information * step.pose) * last_step_.dot(information * last_step_));
    stride_ = coarse_ && along > kParallelCosine * lengths ? std::min(2 * stride_, kStrideMax) : 1;
    last_step_ = step.pose;
}

/// Accepts the step if the cost does not increase.
bool LevelSolver::try_step(const Step& step) {
    const Rigid3 there = displaced(e_.T_camera_body, step.pose);
    if (!is_pose(there) || !window_about(render_scene_.tracer(), camera_, target_, there)) return false;
    render(there);
    ++e_.renders;
    const PhotometricCost now = cost(images(), after(step), robust_);
    const bool better = step.trusted || now.robust <= cost_.robust * (1 + kCostSlack);
    if (better) {
        take(step);
        cost_ = now;
    }
    return better;
}

Exposure LevelSolver::after(const Step& step) const {
    const Eigen::Vector2d e = equations_.exposure_step(step.pose);
    return {std::max(e_.exposure.gain + e[0], kGainMin), e_.exposure.offset_dn + e[1]};
}

void LevelSolver::take(const Step& step) {
    e_.exposure = after(step);
    e_.T_camera_body = displaced(e_.T_camera_body, step.pose);
}

}  // namespace narpa
