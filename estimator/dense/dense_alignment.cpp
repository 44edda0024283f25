#include "estimator/dense/dense_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <string>

#include "estimator/dense/level_view.h"

namespace narpa {
namespace {

/// The coarsest level shows the target no smaller than this.
constexpr double kLeastExtent_px = 16;
/// Coarse levels are done when a step moves nothing by more than this, px of the level.
constexpr double kCoarseStep_px = 0.1;
constexpr double kFirstDamping = 1e-3, kLeastDamping = 1e-7, kDampingStep = 10;
constexpr int kMostRefused = 4;
/// Steps that move the target by less are taken without a look at the cost, in which the noise of the render's
/// samples weighs more than they do.
constexpr double kCoarseTrust_px = 0.5, kFineTrust_px = 0.1;
/// A level has ended when so many steps in a row were no smaller than this part of the smallest before.
constexpr int kMostStalled = 2;
constexpr double kShrinking = 0.9;
/// Steps so many times as large as they should be in the end are put down to that noise too.
constexpr double kStillSmall = 10;
/// Part of the cost that a coarse level gains with each step while it gets on.
constexpr double kCoarseGain = 0.01;
/// Steps go the same way if the cosine between them is larger.
constexpr double kSameWay = 0.7, kLongestStride = 8;
/// Residuals so many times as large as their noise: what is seen is not what is rendered.
constexpr double kNoFit = 6;
/// The noise of the render's samples may make a good step look worse by so much of the cost.
constexpr double kSlack = 1e-3;
constexpr std::size_t kFewestPixels = 12;
/// Least eigenvalue of the pose's information, scaled to ones on its diagonal.
constexpr double kLeastInformation = 1e-10;
/// Coarse levels, whose pixels hold many of the fine ones, take this part of the rays and so much coarser a grid.
constexpr double kCoarseRays = 0.125;
constexpr int kCoarseFineness = 3;
/// Of a window that the target is taken to fill before it is known.
constexpr double kFirstPart = 0.25;
constexpr int kMostShift_px = 12;
/// While the pose is off, residuals are those of the model: this part of the signal, squared.
constexpr double kCoarseModel = 0.1;
constexpr double kLeastGain = 0.05;
/// A derivative serves for poses so near, px.
constexpr double kDerivativeServes_px = 0.2;

class Stopwatch {
public:
    explicit Stopwatch(double& ms) : ms_(ms) {}
    ~Stopwatch() {
        const std::chrono::duration<double, std::milli> passed = std::chrono::steady_clock::now() - begun_;
        ms_ += passed.count();
    }

private:
    double& ms_;
    std::chrono::steady_clock::time_point begun_ = std::chrono::steady_clock::now();
};

std::string number(double v) {
    return std::to_string(v);
}
Error wrong(const std::string& field, double value, const std::string& expected) {
    return Error{field + " = " + number(value) + ", expected " + expected};
}

bool is_pose(const Rigid3& T) {
    const bool finite = std::isfinite(T.q.w) && is_finite(T.q.vec()) && is_finite(T.t);
    return finite && std::abs(norm(T.q) - 1) < 1e-3;
}

/// Longest way that a point of the target goes in the image, about.
double motion_px(const Vector6& step, const Camera& camera, const Rigid3& T_camera_target, double extent_px) {
    const double z = std::max(T_camera_target.t.z, 1e-9);
    return camera.fx * step.segment<2>(3).norm() / z +
           0.5 * extent_px * (step.head<3>().norm() + std::abs(step[5]) / z);
}

}  // namespace

Status check(const DenseOptions& o) {
    const auto power_of_two = [](int n) { return n >= 1 && n <= 64 && (n & (n - 1)) == 0; };
    if (!(o.cauchy > 0)) return wrong("cauchy", o.cauchy, "more than 0 standard deviations");
    if (!(o.sigmas > 0)) return wrong("sigmas", o.sigmas, "more than 0");
    if (o.iterations < 1) return wrong("iterations", o.iterations, "at least 1");
    if (!power_of_two(o.coarsest)) return wrong("coarsest", o.coarsest, "a power of two from 1 to 64");
    if (!power_of_two(o.finest) || o.finest > o.coarsest)
        return wrong("finest", o.finest, "a power of two from 1 to coarsest");
    if (!(o.rays_per_pixel >= 2 && o.rays_per_pixel <= 1e4))
        return wrong("rays_per_pixel", o.rays_per_pixel, "2 to 10000");
    if (o.fineness < 1 || o.fineness > 32) return wrong("fineness", o.fineness, "1 to 32");
    if (!(o.exposure.gain_sigma >= 0)) return wrong("gain_sigma", o.exposure.gain_sigma, "0 or more");
    if (!(o.exposure.offset_sigma_dn >= 0))
        return wrong("offset_sigma_dn", o.exposure.offset_sigma_dn, "0 DN or more");
    if (o.max_depth < 1 || o.max_depth > 40) return wrong("max_depth", o.max_depth, "1 to 40");
    return Ok{};
}

std::string_view name(DenseStatus status) noexcept {
    switch (status) {
        case DenseStatus::converged: return "converged";
        case DenseStatus::out_of_steps: return "out of steps";
        case DenseStatus::diverged: return "diverged";
        case DenseStatus::does_not_fit: return "does not fit";
        case DenseStatus::left_the_picture: return "left the picture";
        case DenseStatus::too_few_pixels: return "too few pixels";
    }
    return "";
}

struct DenseAlignment::Impl {
    Impl(const Tracer& the_tracer, const Camera& the_camera, std::size_t the_target)
        : tracer(the_tracer), camera(the_camera), target(the_target), sensor(sensor_model(the_camera)) {
        if (camera.embedded_line) {  // the last row holds no light
            --camera.height;
            camera.embedded_line = false;
        }
    }

    LevelView& view_of(int factor, const Camera& level_camera, const Window& window, const Placement& at) {
        auto& kept = levels[static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(factor)))];
        if (!kept || kept->window() != window) kept.emplace(tracer, level_camera, window, target, at);
        kept->place_bodies(at);
        return *kept;
    }

    const Tracer& tracer;
    Camera camera;
    const std::size_t target;
    const SensorModel sensor;
    std::array<std::optional<LevelView>, 7> levels{};  ///< by the logarithm of their factor
};

namespace {

/// One level of one frame.
class Descent {
public:
    Descent(const Camera& camera, const SensorModel& sensor, const Tracer& tracer, std::size_t target, int factor,
            LevelView& view, const DenseOptions& options, DenseEstimate& estimate)
        : camera_(camera),
          sensor_(sensor),
          tracer_(tracer),
          target_(target),
          factor_(factor),
          view_(view),
          o_(options),
          e_(estimate),
          settings_(settings_of(options)) {}

    /// Moves the estimate to where this level's images agree.
    DenseStatus run(bool first) {
        render(e_.T_camera_body);
        if (first) shift();
        robust_.model_dn2 = coarse_ ? kCoarseModel * signal_power(view_.images(pixels_averaged())) : 0;
        double damping = kFirstDamping, moved_px = std::numeric_limits<double>::infinity();
        double least = std::numeric_limits<double>::infinity();
        int stalled = 0;
        for (int k = 0; k < o_.iterations; ++k) {
            if (moved_px > kDerivativeServes_px) {
                differentiate();
                moved_px = 0;
            }
            if (!linearise()) return DenseStatus::too_few_pixels;
            if (k == 0) note(0, true);
            const double cost_before = cost_.robust;
            Step step = next_step(damping);
            for (int refused = 0; !try_step(step); ++refused) {
                if (refused == kMostRefused) return DenseStatus::diverged;
                if (stride_ == 1) damping *= kDampingStep;
                stride_ = 1;
                step = next_step(damping);
            }
            if (step.size < 1) return DenseStatus::converged;
            // Noise of the render keeps the pose moving.
            const bool shrinks = step.size < kShrinking * least;
            const bool gains = coarse_ ? cost_.robust < (1 - kCoarseGain) * cost_before : step.size > kStillSmall;
            stalled = shrinks || gains ? 0 : stalled + 1;
            least = std::min(least, step.size);
            if (step.trusted && stalled == kMostStalled) return DenseStatus::converged;
            moved_px += step.motion_px;
            damping = std::max(damping / kDampingStep, kLeastDamping);
            lengthen(step);
        }
        return least < kStillSmall ? DenseStatus::converged : DenseStatus::out_of_steps;
    }

    /// Without the noise of the render.
    Result<Matrix6> bound() {
        render(e_.T_camera_body);
        differentiate();
        PhotometricImages images = view_.images(pixels_averaged());
        images.signal_variance = {};
        const auto all =
            equations(images, sensor_, {}, o_.exposure, {1, std::numeric_limits<double>::infinity(), 0});
        const Matrix6 information = all.pose_information();
        if (!tells_all(information)) return Error{"too few pixels tell of the target to say all of its pose"};
        return Matrix6(information.inverse());
    }

    /// What the images tell of the pose where they were rendered last.
    void conclude() {
        const Stopwatch watch(e_.solve_ms);
        const PhotometricImages images = view_.images(pixels_averaged());
        e_.covariance = equations(images, sensor_, e_.exposure, o_.exposure, robust_).pose_covariance();
        const PhotometricCost now = cost(images, sensor_, e_.exposure, o_.exposure, robust_);
        e_.pixels = now.pixels;
        e_.residual_scale = robust_.scale;
        if (robust_.scale > kNoFit) e_.status = DenseStatus::does_not_fit;
        e_.chi2_per_pixel = now.chi2 / static_cast<double>(std::max<std::size_t>(now.pixels, 1));
    }

private:
    struct Step {
        Vector6 pose = Vector6::Zero();
        double sigmas = 0, motion_px = 0;
        double size = 0;       ///< below 1: small enough to end with
        bool trusted = false;  ///< so small that noise decides whether the cost falls
    };

    static FrameSettings settings_of(const DenseOptions& o) {
        FrameSettings s;
        s.seed = o.seed;
        s.method = o.method;
        s.max_depth = o.max_depth;
        s.budget.kind = FrameBudget::Kind::rays;
        return s;
    }
    [[nodiscard]] double pixels_averaged() const { return static_cast<double>(factor_) * factor_; }

    /// The guess may be off by more than a derivative reaches: first, sideways by whole pixels.
    void shift() {
        const int most = std::min({kMostShift_px, view_.window().width / 4, view_.window().height / 4});
        const auto [dx, dy] = best_shift(view_.images(pixels_averaged()), sensor_, most);
        if (dx == 0 && dy == 0) return;
        Vector6 sideways = Vector6::Zero();
        const double z = std::abs(e_.T_camera_body.t.z);
        sideways[3] = dx * z / camera_.fx, sideways[4] = dy * z / camera_.fy;
        e_.T_camera_body = displaced(e_.T_camera_body, sideways);
        render(e_.T_camera_body);
    }
    void render(const Rigid3& T) {
        const Stopwatch watch(e_.render_ms);
        const double window = static_cast<double>(view_.window().width) * view_.window().height;
        if (target_px_ == 0) target_px_ = kFirstPart * window;
        // A coarse pixel's noise is to be less, as the sensor's is. All pixels get their middles first.
        settings_.budget.rays = static_cast<std::uint64_t>(2 * window + rays_ * factor_ * factor_ * target_px_);
        view_.render(T, sensor_, settings_);
    }
    void differentiate() {
        const Stopwatch watch(e_.derivative_ms);
        view_.differentiate(e_.T_camera_body, sensor_, settings_, fineness_);
    }
    /// False where not all of the pose follows from the image.
    bool linearise() {
        const Stopwatch watch(e_.solve_ms);
        const PhotometricImages images = view_.images(pixels_averaged());
        robust_.scale = residual_scale(images, sensor_, e_.exposure, robust_.model_dn2);
        robust_.cauchy = o_.cauchy;
        cost_ = cost(images, sensor_, e_.exposure, o_.exposure, robust_);
        equations_ = equations(images, sensor_, e_.exposure, o_.exposure, robust_);
        target_px_ = static_cast<double>(cost_.pixels);
        return cost_.pixels >= kFewestPixels && tells_all(equations_.pose_information());
    }
    static bool tells_all(const Matrix6& information) {
        const Vector6 sizes = information.diagonal();
        if (!(sizes.minCoeff() > 0) || !sizes.allFinite()) return false;
        const Vector6 unit = sizes.cwiseSqrt().cwiseInverse();
        const Matrix6 scaled = unit.asDiagonal() * information * unit.asDiagonal();
        return Eigen::SelfAdjointEigenSolver<Matrix6>(scaled, Eigen::EigenvaluesOnly).eigenvalues()[0] >
               kLeastInformation;
    }
    [[nodiscard]] Step next_step(double damping) const {
        const Matrix6 information = equations_.pose_information();
        Matrix6 damped = information;
        damped.diagonal() *= 1 + damping;
        Step s;
        s.pose = stride_ * damped.ldlt().solve(equations_.pose_gradient());
        s.sigmas = std::sqrt(std::max(s.pose.dot(information * s.pose), 0.0)) / robust_.scale;
        s.motion_px = motion_px(s.pose, camera_, e_.T_camera_body, extent_px(view_.window()));
        s.size = coarse_ ? s.motion_px / kCoarseStep_px : s.sigmas / o_.sigmas;
        s.trusted = stride_ == 1 && s.motion_px < (coarse_ ? kCoarseTrust_px : kFineTrust_px);
        return s;
    }
    /// Where details are further off than they reach, they make steps short that broader features ask for: while
    /// these go the same way, they are lengthened.
    void lengthen(const Step& step) {
        const Matrix6 information = equations_.pose_information();
        const double along = step.pose.dot(information * last_step_);
        const double lengths =
            std::sqrt(step.pose.dot(information * step.pose) * last_step_.dot(information * last_step_));
        stride_ = coarse_ && along > kSameWay * lengths ? std::min(2 * stride_, kLongestStride) : 1;
        last_step_ = step.pose;
    }
    /// Takes the step if it is no worse.
    bool try_step(const Step& step) {
        const Rigid3 there = displaced(e_.T_camera_body, step.pose);
        if (!is_pose(there) || !window_about(tracer_, camera_, target_, there)) return false;
        const Eigen::Vector2d e = equations_.exposure_step(step.pose);
        const Exposure exposure{std::max(e_.exposure.gain + e[0], kLeastGain), e_.exposure.offset_dn + e[1]};
        render(there);
        const Stopwatch watch(e_.solve_ms);
        const PhotometricCost now = cost(view_.images(pixels_averaged()), sensor_, exposure, o_.exposure, robust_);
        const bool better = step.trusted || now.robust <= cost_.robust * (1 + kSlack);
        if (better) {
            e_.T_camera_body = there;
            e_.exposure = exposure;
            cost_ = now;
        }
        note(step.sigmas, better);
        return better;
    }
    void note(double sigmas, bool better) {
        const double pixels = static_cast<double>(view_.window().width) * view_.window().height;
        e_.steps.push_back(
            {factor_, cost_.robust / (robust_.scale * robust_.scale * pixels), sigmas, e_.T_camera_body, better});
    }

    const Camera& camera_;
    const SensorModel& sensor_;
    const Tracer& tracer_;
    const std::size_t target_;
    const int factor_;
    LevelView& view_;
    const DenseOptions& o_;
    DenseEstimate& e_;
    FrameSettings settings_;
    const bool coarse_ = factor_ > o_.finest;
    const double rays_ = o_.rays_per_pixel * (coarse_ ? kCoarseRays : 1);  ///< for each pixel of the target
    const int fineness_ = coarse_ ? std::max(1, o_.fineness / kCoarseFineness) : o_.fineness;
    double target_px_ = 0;  ///< pixels that tell of the target; 0: not known yet

    Robustness robust_{};
    PhotometricCost cost_{};
    PhotometricEquations equations_{};
    Vector6 last_step_ = Vector6::Zero();
    double stride_ = 1;  ///< by which steps are lengthened
};

/// Means over factor x factor pixels have this variance.
std::vector<float> coarser_variance(std::span<const float> variance, const Camera& camera, int factor) {
    if (variance.empty()) return {};
    MeasuredImage mean = coarser_image({camera.width, camera.height, {variance.begin(), variance.end()}}, factor);
    for (float& v : mean.dn) v /= static_cast<float>(factor * factor);
    return std::move(mean.dn);
}

Status check_input(const Camera& camera, const MeasuredImage& frame, std::span<const float> frame_variance,
                   std::size_t bodies, const Placement& at, const Rigid3& guess) {
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

DenseAlignment::DenseAlignment(const Tracer& tracer, const Camera& camera, std::size_t target)
    : impl_(std::make_unique<Impl>(tracer, camera, target)) {}
DenseAlignment::~DenseAlignment() = default;

Result<DenseEstimate> DenseAlignment::align(const MeasuredImage& frame, const Placement& at,
                                            const Rigid3& T_camera_body_guess, const DenseOptions& options,
                                            std::span<const float> frame_variance) {
    Impl& i = *impl_;
    if (const Status good = check(options); !good) return good.error();
    if (const Status good =
            check_input(i.camera, frame, frame_variance, i.tracer.scene().bodies.size(), at, T_camera_body_guess);
        !good)
        return good.error();
    DenseEstimate e;
    e.T_camera_body = T_camera_body_guess;
    const std::optional<Window> about = window_about(i.tracer, i.camera, i.target, T_camera_body_guess);
    if (!about) {
        e.status = DenseStatus::left_the_picture;
        return e;
    }
    int factor = options.coarsest;
    while (factor > options.finest && extent_px(*about) / factor < kLeastExtent_px) factor /= 2;
    for (bool first = true; factor >= options.finest; factor /= 2, first = false) {
        const Camera camera = coarser_camera(i.camera, factor);
        std::optional<Window> window = window_about(i.tracer, camera, i.target, e.T_camera_body);
        if (!window) {
            e.status = DenseStatus::left_the_picture;
            return e;
        }
        // From a guess the target may have far to go.
        if (first && factor > 1) window = Window{0, 0, camera.width, camera.height};
        LevelView& view = i.view_of(factor, camera, *window, at);
        view.measure(coarser_image(frame, factor), coarser_variance(frame_variance, i.camera, factor));
        Descent descent(camera, i.sensor, i.tracer, i.target, factor, view, options, e);
        e.status = descent.run(first);
        if (factor == options.finest && e.status == DenseStatus::converged) descent.conclude();
    }
    return e;
}

Result<Matrix6> DenseAlignment::bound(const Placement& at, const Rigid3& T_camera_body, const DenseOptions& options,
                                      std::span<const float> frame_variance) {
    Impl& i = *impl_;
    if (const Status good = check(options); !good) return good.error();
    const MeasuredImage none{
        i.camera.width, i.camera.height,
        std::vector<float>(static_cast<std::size_t>(i.camera.width) * static_cast<std::size_t>(i.camera.height))};
    if (const Status good =
            check_input(i.camera, none, frame_variance, i.tracer.scene().bodies.size(), at, T_camera_body);
        !good)
        return good.error();
    const int factor = options.finest;
    const Camera camera = coarser_camera(i.camera, factor);
    const std::optional<Window> window = window_about(i.tracer, camera, i.target, T_camera_body);
    if (!window) return Error{"the target is not in the image"};
    LevelView& view = i.view_of(factor, camera, *window, at);
    view.measure(coarser_image(none, factor), coarser_variance(frame_variance, i.camera, factor));
    DenseEstimate e;
    e.T_camera_body = T_camera_body;
    Descent descent(camera, i.sensor, i.tracer, i.target, factor, view, options, e);
    return descent.bound();
}

}  // namespace narpa
