#include "estimator/dense/level_solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/pose/symmetric.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

/// A level converges when a step moves the target by less than kConverged_px (its own pixels), or by less than
/// kBeforeFarStep_px if the next level's pixels are a quarter as wide. The finest level also converges when a step
/// is shorter than kConverged_sigmas standard deviations of the pose.
constexpr double kConverged_px = 0.1, kBeforeFarStep_px = 0.05, kConverged_sigmas = 0.2;
constexpr double kFirstDamping = 1e-3, kMinDamping = 1e-7, kDampingStep = 10;
constexpr int kMaxRefused = 4;
/// Steps that move the target by less are accepted without testing the cost, whose change is below its sampling
/// noise.
constexpr double kCoarseTrust_px = 0.5, kFineTrust_px = 0.1;
/// A level ends after kMaxStalled consecutive steps that are not shorter than kShrinking times the shortest
/// before.
constexpr int kMaxStalled = 2;
constexpr double kShrinking = 0.9;
/// Steps of up to this many times the convergence threshold are also attributed to sampling noise.
constexpr double kStillSmall = 10;
/// Least relative decrease of a coarse level's cost per step that counts as progress.
constexpr double kCoarseGain = 0.01;
/// Consecutive steps are parallel if the cosine between them is larger.
constexpr double kSameWay = 0.7, kLongestStride = 8;
/// Sampling noise may increase the cost of a good step by this part.
constexpr double kSlack = 1e-3;
constexpr std::size_t kFewestPixels = 12;
/// kCoarseSamples: factor of the number of samples on coarse levels, whose pixels are few and have more details and
/// less noise. kCoarseFineness: divisor of the derivative's lines for all steps but the last of the finest level.
constexpr int kCoarseSamples = 2;
constexpr int kCoarseFineness = 2;
/// For the image and the derivative from which pixels of a large target are chosen: divisor of the number of
/// samples, and the number of lines.
constexpr int kChoiceSamples = 4, kChoiceFineness = 1;
/// Part of the information that the chosen pixels hold together.
constexpr double kHeld = 0.8;
/// Pixels are chosen if the target covers at least this many: fewer take little time anyway.
constexpr std::size_t kManyPixels = 10'000;
/// Parameters of the last steps. In a curved valley steps end early, and the derivative leaves about a tenth of a
/// step.
struct LastSteps {
    int first_samples,
        samples;  ///< sample factors: before and after a step shorter than before_sigmas
    double before_sigmas;
    double sigmas, px;  ///< the last step is shorter than one of these: in standard deviations, in pixels
    double serves_px;   ///< the Jacobian is reused for poses within this motion
};
/// Chosen pixels show fine details and are limited by sampling noise; low-discrepancy samples are best in powers of
/// two.
constexpr LastSteps kOfAll{6, 6, 0, 1, 0.02, 0.02}, kOfChosen{4, 8, 20, 3, 0, 0.1};
constexpr int kMaxPolishes = 5;
/// Two poses at most kReach_px apart count as one minimum if steps from one leave at most the part kLeft of the
/// distance to the other, or a squared Mahalanobis distance below kLeftVariances.
constexpr double kReach_px = 1, kLeft = 0.5, kLeftVariances = 25;
constexpr int kMeetingSteps = 2;
constexpr int kMaxShift_px = 12;
/// Model error on coarse levels: this part of the signal power.
constexpr double kCoarseModel = 0.1;
constexpr double kMinGain = 0.05;
/// The Jacobian is reused for poses within this motion, px.
constexpr double kDerivativeServes_px = 0.2;
/// Pixels are chosen when a step is shorter than this: the pixels that determine the pose show details smaller than
/// a pixel, whose Jacobian is valid only nearby. After kMaxBeforeChoice steps, when one is shorter than
/// kDerivativeServes_px.
constexpr double kChooses_px = 0.1;
constexpr int kMaxBeforeChoice = 2;

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
    constexpr int kLastStep = 4;
    constexpr double kManyAcross_px = 64;  // of the level before
    if (factor == finest) return 0;
    const bool far = factor <= kLastStep * finest && extent_px / factor >= kManyAcross_px;
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
                        ? kBeforeFarStep_px
                        : kConverged_px),
      settings_{.spp = std::max(2, options.samples_per_pixel * (coarse_ ? kCoarseSamples : 1)),
                .seed = options.seed,
                .method = options.method,
                .max_depth = options.max_depth},
      choosing_(!coarse_ && !camera.point_spread && !(camera.veiling_glare > 0) &&
                pixels_of(view.window()) >= kManyPixels) {}

DenseStatus LevelSolver::run(bool first) {
    view_.choose_all();
    const int samples = settings_.spp;
    if (choosing_) settings_.spp = std::max(2, samples / kChoiceSamples);
    render(e_.T_camera_body);
    if (first) shift();
    const DenseStatus status = iterate(samples);
    settings_.spp = samples;
    return status;
}

/// `samples`: per pixel once pixels are chosen.
DenseStatus LevelSolver::iterate(int samples) {
    robust_.model_dn2 = coarse_ ? kCoarseModel * signal_power(view_.images()) : 0;
    double damping = kFirstDamping;
    double least = std::numeric_limits<double>::infinity();
    int stalled = 0;
    for (int k = 0; k < o_.iterations; ++k) {
        differentiate();
        if (!linearise()) return DenseStatus::too_few_pixels;
        if (choosing_ && cost_.pixels < kManyPixels) {
            choosing_ = false;
            settings_.spp = samples;
            render(e_.T_camera_body);
            differentiate();
            if (!linearise()) return DenseStatus::too_few_pixels;
        }
        if (k == 0) ++e_.renders;
        const double cost_before = cost_.robust;
        Step step = next_step(damping);
        const double max_px = k < kMaxBeforeChoice ? kChooses_px : kDerivativeServes_px;
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
            if (refused == kMaxRefused) return DenseStatus::diverged;
            if (stride_ == 1) damping *= kDampingStep;
            stride_ = 1;
            step = next_step(damping);
        }
        // Sampling noise keeps the pose moving: ends when steps neither shrink nor reduce the cost.
        const bool shrinks = step.size < kShrinking * least;
        const bool gains = coarse_ ? cost_.robust < (1 - kCoarseGain) * cost_before : step.size > kStillSmall;
        stalled = shrinks || gains ? 0 : stalled + 1;
        least = std::min(least, step.size);
        if (step.trusted && stalled == kMaxStalled) return DenseStatus::converged;
        damping = std::max(damping / kDampingStep, kMinDamping);
        adapt_stride(step);
    }
    return least < kStillSmall ? DenseStatus::converged : DenseStatus::out_of_steps;
}

void LevelSolver::polish() {
    const LastSteps& last = view_.images().chosen.empty() ? kOfAll : kOfChosen;
    const int samples = last.samples * settings_.spp;
    settings_.spp *= last.first_samples;
    stride_ = 1;
    render(e_.T_camera_body);
    ++e_.renders;
    for (int k = 0; k < kMaxPolishes; ++k) {
        differentiate(last.serves_px, o_.fineness);
        if (!linearise()) return;
        Step step = next_step(kMinDamping);
        if (settings_.spp == samples && (step.sigmas < last.sigmas || step.motion_px < last.px)) {
            take(step);
            view_.predict(step.pose);
            return;
        }
        if (settings_.spp < samples && step.sigmas < last.before_sigmas) {
            settings_.spp = samples;
            step.trusted = step.trusted || step.motion_px < kDerivativeServes_px;
        }
        if (!try_step(step)) return;
    }
}

/// Pixels that are not chosen keep their samples, with the signal predicted after this step.
void LevelSolver::choose(const Vector6& step) {
    std::vector<std::uint8_t> pixels = informative_pixels(view_.images(), e_.exposure, kHeld);
    view_.predict(step);
    view_.choose(std::move(pixels));
    choosing_ = false;
}

void LevelSolver::differentiate() {
    differentiate(kDerivativeServes_px, choosing_ ? kChoiceFineness : std::max(1, o_.fineness / kCoarseFineness));
}

std::optional<Vector6> LevelSolver::miss(const Rigid3& T_camera_body) {
    const Vector6 way = error_between(e_.T_camera_body, T_camera_body);
    if (!(distance_px(way) < kReach_px)) return {};
    Vector6 left = way;
    const bool of_few_pixels = !view_.images().chosen.empty();
    for (int k = 0; k < kMeetingSteps; ++k) {
        if (k > 0) settings_.spp *= (of_few_pixels ? kOfChosen : kOfAll).first_samples;
        render(e_.T_camera_body);
        ++e_.renders;
        differentiate(kReach_px, std::max(1, o_.fineness / kCoarseFineness));
        if (!linearise()) return {};
        e_.T_camera_body = displaced(e_.T_camera_body, next_step(kMinDamping).pose);
        left = error_between(e_.T_camera_body, T_camera_body);
        const Matrix6 information = equations_.pose_information() / (robust_.scale * robust_.scale);
        const double most = std::max(kLeftVariances, kLeft * kLeft * way.dot(information * way));
        if (!(left.dot(information * left) < most)) return {};
    }
    return left;
}

void LevelSolver::weigh() {
    view_.choose_all();
    settings_.spp *= kOfAll.samples;
    render(e_.T_camera_body);
    ++e_.renders;
    e_.window = view_.window();
    e_.excess_loss = cost(view_.images(), e_.exposure, {}).excess();
}

void LevelSolver::examine() {
    view_.choose_all();
    settings_.spp *= kOfAll.samples;
    render(e_.T_camera_body);
    differentiate(kDerivativeServes_px, std::max(1, o_.fineness / kCoarseFineness));
    linearise();
    examined_loss_ = cost(view_.images(), e_.exposure, {}).robust;
}

void LevelSolver::shift() {
    const int most = std::min({kMaxShift_px, view_.window().width / 4, view_.window().height / 4});
    const auto [dx, dy] = best_shift(view_.images(), most);
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
    if (!coarse_ && pixels_of(view_.window()) < kManyPixels) view_.allow_for_missed_light(settings_.spp);
}

void LevelSolver::differentiate(double reach_px, int fineness) {
    const std::optional<Rigid3>& there = view_.differentiated_at();
    const bool fine_enough = view_.fineness() >= fineness;
    if (there && fine_enough && distance_px(error_between(*there, e_.T_camera_body)) < reach_px) return;
    view_.differentiate(e_.T_camera_body, settings_, fineness);
}

/// False where the pose is not observable.
bool LevelSolver::linearise() {
    const PhotometricImages images = view_.images();
    robust_.scale = residual_scale(images, e_.exposure, robust_.model_dn2);
    cost_ = cost(images, e_.exposure, robust_);
    equations_ = equations(images, e_.exposure, robust_, false);
    return cost_.pixels >= kFewestPixels && equations_.observes_pose();
}

LevelSolver::Step LevelSolver::next_step(double damping) const {
    const Matrix6 information = equations_.pose_information();
    Matrix6 damped = information;
    damped.diagonal() *= 1 + damping;
    Step s;
    s.pose = stride_ * ldlt_solve(damped, equations_.pose_gradient());
    s.sigmas = std::sqrt(std::max(s.pose.dot(information * s.pose), 0.0)) / robust_.scale;
    s.motion_px = distance_px(s.pose);
    s.size = s.motion_px / converged_px_;
    if (!coarse_) s.size = std::min(s.size, s.sigmas / kConverged_sigmas);
    s.trusted = stride_ == 1 && s.motion_px < (coarse_ ? kCoarseTrust_px : kFineTrust_px);
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
    stride_ = coarse_ && along > kSameWay * lengths ? std::min(2 * stride_, kLongestStride) : 1;
    last_step_ = step.pose;
}

/// Accepts the step if the cost does not increase.
bool LevelSolver::try_step(const Step& step) {
    const Rigid3 there = displaced(e_.T_camera_body, step.pose);
    if (!is_pose(there) || !window_about(render_scene_.tracer(), camera_, target_, there)) return false;
    render(there);
    ++e_.renders;
    const PhotometricCost now = cost(view_.images(), after(step), robust_);
    const bool better = step.trusted || now.robust <= cost_.robust * (1 + kSlack);
    if (better) {
        take(step);
        cost_ = now;
    }
    return better;
}

Exposure LevelSolver::after(const Step& step) const {
    const Eigen::Vector2d e = equations_.exposure_step(step.pose);
    return {std::max(e_.exposure.gain + e[0], kMinGain), e_.exposure.offset_dn + e[1]};
}

void LevelSolver::take(const Step& step) {
    e_.exposure = after(step);
    e_.T_camera_body = displaced(e_.T_camera_body, step.pose);
}

}  // namespace narpa
