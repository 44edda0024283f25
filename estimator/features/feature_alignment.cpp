#include "estimator/features/feature_alignment.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "estimator/pose/median.h"

namespace narpa {
namespace {

/// Half the window over which a match's noise is summed: that of the optical flow.
constexpr int kHalfWindow_px = 10;
/// A match whose residual exceeds this many times the median is an outlier.
constexpr double kOutlier = 4;
/// Median of the length of a residual of unit variance in u and in v: Rayleigh's.
constexpr double kRayleighMedian = 1.17741;
/// Neighbouring rays this far off must meet the surface that the feature's own ray met.
constexpr double kNeighbour_px = 1.5;
/// They may lie off its tangent plane by this many pixels' worth of depth: a bend is a corner, a step is an
/// outline.
constexpr double kStep_px = 6;

/// Fewer degrees of freedom of the residuals say nothing of their scatter.
constexpr double kFewestFreedom = 3;
/// Steps of a smaller normalised square are noise: each view selects other features.
constexpr double kSettledSquared = 9;
/// Side of the blocks in which the target is searched.
constexpr int kBlock_px = 6;

/// Infinite where the point has no image.
Pixel project(const CameraModel& camera, const Vec3& p) {
    const auto image = camera.project(p);
    return image ? Pixel{image->x, image->y} : Pixel{kInfinity, kInfinity};
}

/// Part of a window's side that it shares with another so far away.
double overlap(double distance_px) {
    return std::max(0.0, 1 - std::abs(distance_px) / (2 * kHalfWindow_px + 1));
}

double root_mean_square(const std::vector<double>& lengths) {
    const Eigen::Map<const Eigen::VectorXd> all(lengths.data(), static_cast<Eigen::Index>(lengths.size()));
    return lengths.empty() ? 0 : std::sqrt(all.squaredNorm() / static_cast<double>(lengths.size()));
}

/// More than half of a match's window is clipped in the frame: its gradients are not the light's.
bool is_clipped(const MeasuredImage& frame, double u, double v) {
    if (frame.clipped.empty()) return false;
    const int x0 = static_cast<int>(std::lround(u)), y0 = static_cast<int>(std::lround(v));
    int clipped = 0, all = 0;
    for (int y = std::max(0, y0 - kHalfWindow_px); y <= std::min(frame.height - 1, y0 + kHalfWindow_px); ++y)
        for (int x = std::max(0, x0 - kHalfWindow_px); x <= std::min(frame.width - 1, x0 + kHalfWindow_px); ++x) {
            clipped += frame.clipped[frame.index(x, y)] != 0;
            ++all;
        }
    return 2 * clipped > all;
}

/// Standard deviation of residuals in u and in v, from the median of their lengths.
double scale_of(std::vector<double> lengths) {
    return upper_median(std::span(lengths)) / kRayleighMedian;
}

}  // namespace

std::string_view name(FeatureStatus status) noexcept {
    constexpr std::array<std::string_view, 4> names{"settled", "unsettled", "few matches", "no pose"};
    return names[static_cast<std::size_t>(status)];
}

/// Correspondences of one view.
struct FeatureAlignment::Points {
    std::vector<Vec3> body_m;
    std::vector<Pixel> pixels;
    std::vector<Eigen::Matrix2d> noise;  ///< of the sensor alone

    /// Of a match, where all scatter by `floor_px` beyond the sensor's noise.
    [[nodiscard]] Eigen::Matrix2d match_covariance(std::size_t i, double floor_px) const {
        return noise[i] + floor_px * floor_px * Eigen::Matrix2d::Identity();
    }
    [[nodiscard]] std::vector<PixelCovariance> covariances(double floor_px) const {
        std::vector<PixelCovariance> all;
        all.reserve(size());
        for (std::size_t i = 0; i < size(); ++i) {
            const Eigen::Matrix2d S = match_covariance(i, floor_px);
            all.push_back({S(0, 0), S(0, 1), S(1, 1)});
        }
        return all;
    }
    [[nodiscard]] std::size_t size() const { return body_m.size(); }

    [[nodiscard]] std::vector<double> residuals_px(const CameraModel& camera, const Rigid3& T) const {
        std::vector<double> lengths;
        lengths.reserve(size());
        for (std::size_t i = 0; i < size(); ++i) {
            const Pixel p = project(camera, T * body_m[i]);
            lengths.push_back(std::hypot(p.u - pixels[i].u, p.v - pixels[i].v));
        }
        return lengths;
    }
    void keep(const std::vector<std::uint8_t>& wanted) {
        std::size_t n = 0;
        for (std::size_t i = 0; i < size(); ++i)
            if (wanted[i] != 0) body_m[n] = body_m[i], pixels[n] = pixels[i], noise[n] = noise[i], ++n;
        body_m.resize(n), pixels.resize(n), noise.resize(n);
    }
    /// Of the matches' Jacobians in units of their errors: w w', and overlap_ij w_i w_j' of all pairs whose windows
    /// overlap, by which part their errors are the same.
    struct Sums {
        Matrix6 information = Matrix6::Zero(), shared = Matrix6::Zero();
    };
    [[nodiscard]] Sums sums(const CameraModel& camera, const Rigid3& T, double floor_px) const {
        std::vector<Eigen::Matrix<double, 6, 2>> whitened;
        whitened.reserve(size());
        for (std::size_t i = 0; i < size(); ++i)
            whitened.emplace_back(match_covariance(i, floor_px)
                                      .llt()
                                      .matrixL()
                                      .solve(reprojection_jacobian(camera, T, body_m[i]))
                                      .transpose());
        Sums out;
        for (std::size_t i = 0; i < size(); ++i) {
            out.information += whitened[i] * whitened[i].transpose();
            for (std::size_t j = 0; j < i; ++j) {
                const double part = overlap(pixels[i].u - pixels[j].u) * overlap(pixels[i].v - pixels[j].v);
                if (part <= 0) continue;
                const Matrix6 pair = part * whitened[i] * whitened[j].transpose();
                out.shared += pair + pair.transpose();
            }
        }
        return out;
    }
    /// Expected chi^2 of the residuals: the pose takes up more than six numbers' worth of errors that matches
    /// share.
    [[nodiscard]] double freedom(const CameraModel& camera, const Rigid3& T, double floor_px) const {
        const Sums s = sums(camera, T, floor_px);
        return 2 * static_cast<double>(size()) - 6 - s.information.ldlt().solve(s.shared).trace();
    }
    /// How much larger the errors of the pose may be than `covariance` says, in variance, at least 1: by the
    /// scatter of the pulls of parts of the target, whose matches share errors of model and light (clustered
    /// residuals: K.-Y. Liang, S. Zeger, Biometrika 73, 1986). C: the inverse of the matches' information.
    [[nodiscard]] double inflation(const CameraModel& camera, const Rigid3& T, const Matrix6& C,
                                   const Matrix6& covariance, double floor_px) const {
        constexpr int kParts = 4;  // each way
        double left = kInfinity, top = kInfinity, right = -kInfinity, bottom = -kInfinity;
        for (const Pixel& p : pixels)
            left = std::min(left, p.u), right = std::max(right, p.u), top = std::min(top, p.v),
            bottom = std::max(bottom, p.v);
        const double side = std::max({right - left, bottom - top, 1.0}) * (1 + 1e-9) / kParts;
        std::array<Vector6, kParts * kParts> pulls;
        std::array<int, kParts * kParts> members{};
        pulls.fill(Vector6::Zero());
        for (std::size_t i = 0; i < size(); ++i) {
            const auto part = static_cast<std::size_t>((pixels[i].v - top) / side) * kParts +
                              static_cast<std::size_t>((pixels[i].u - left) / side);
            const Eigen::Matrix2d S = match_covariance(i, floor_px);
            const Pixel p = project(camera, T * body_m[i]);
            const Eigen::Vector2d r(pixels[i].u - p.u, pixels[i].v - p.v);
            pulls[part] += reprojection_jacobian(camera, T, body_m[i]).transpose() * S.inverse() * r;
            ++members[part];
        }
        Matrix6 scatter = Matrix6::Zero();
        for (const Vector6& pull : pulls) scatter += pull * pull.transpose();
        const auto parts = static_cast<double>(std::ranges::count_if(members, [](int n) { return n > 0; }));
        constexpr double kUnknowns = 6;
        const double few = parts / std::max(1.0, parts - kUnknowns);
        return std::max(1.0, few * (covariance.inverse() * C * scatter * C).trace() / kUnknowns);
    }
    /// The excess error of a match beyond the sensor's noise that makes chi^2 equal to its degrees of freedom; 0
    /// where the noise suffices.
    [[nodiscard]] double floor_px(const CameraModel& camera, const Rigid3& T, double freedom) const {
        const auto chi2 = [&](double floor) {
            double sum = 0;
            for (std::size_t i = 0; i < size(); ++i) {
                const Pixel p = project(camera, T * body_m[i]);
                const Eigen::Vector2d r(p.u - pixels[i].u, p.v - pixels[i].v);
                sum += r.dot(match_covariance(i, floor).inverse() * r);
            }
            return sum;
        };
        double low = 0, high = 10;
        if (chi2(low) <= freedom) return 0;
        for (int k = 0; k < 40; ++k) (chi2(0.5 * (low + high)) > freedom ? low : high) = 0.5 * (low + high);
        return high;
    }
};

FeatureAlignment::FeatureAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                                   const BodyPoses& at, const FeatureSettings& settings)
    : view_(render_scene, camera, target, at),
      sensor_(sensor_model(camera)),
      times_(row_times(camera)),
      settings_(settings) {}

void FeatureAlignment::set_detector(const Detector& detector) {
    Camera camera = view_.camera();
    camera.detector = detector;
    sensor_ = sensor_model(camera);
    times_ = row_times(camera);
}

/// The rays of lanes 1 to 4 meet the surface that lane 0 meets.
bool FeatureAlignment::on_smooth_surface(const HitBatch& hits) const {
    const Hit hit = hits[0];
    const double step_m = kStep_px * hit.range_m / CameraModelHandle(view_.camera())->pixels_per_radian();
    for (std::size_t i = 1; i < 5; ++i) {
        if (hits.body[i] != hit.body) return false;
        const Vec3 between = hits.position[i] - hit.position;
        if (std::min(std::abs(dot(between, hit.geometric_normal)),
                     std::abs(dot(between, hits.geometric_normal[i]))) >= step_m)
            return false;
    }
    return true;
}

/// Where features are looked for: blocks of pixels whose centre shows the target.
void FeatureAlignment::find_target() {
    const int width = view_.camera().width, height = view_.camera().height;
    constexpr double kCentre = 0.5 * (kBlock_px - 1);
    const int across = (width + kBlock_px - 1) / kBlock_px;
    on_target_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
    std::array<ImagePoint, kLanes> centres;
    HitBatch hits;
    for (int v0 = 0; v0 < height; v0 += kBlock_px)
        for (int first = 0; first < across; first += static_cast<int>(kLanes)) {
            const int n = std::min(static_cast<int>(kLanes), across - first);
            for (int i = 0; i < n; ++i)
                centres[static_cast<std::size_t>(i)] = {(first + i) * kBlock_px + kCentre, v0 + kCentre};
            view_.trace_pixels(std::span(centres).first(static_cast<std::size_t>(n)), hits);
            for (int i = 0; i < n; ++i) {
                if (hits.body[static_cast<std::size_t>(i)] != static_cast<int>(view_.target())) continue;
                const int u0 = (first + i) * kBlock_px, u1 = std::min(u0 + kBlock_px, width);
                for (int v = v0; v < std::min(v0 + kBlock_px, height); ++v)
                    std::fill_n(on_target_.begin() + std::ptrdiff_t{v} * width + u0, u1 - u0, std::uint8_t{255});
            }
        }
}

/// Features of the view as it was rendered last that lie on the target, and where the frame has them.
void FeatureAlignment::gather(const MeasuredImage& frame, const ByteImage& frame_bytes, const ByteScale& scale,
                              Points& points) {
    points = {};
    const auto target = static_cast<int>(view_.target());
    find_target();
    ByteImage view_bytes = scale.scaled(view_.radiance());
    if (view_bytes.height != frame.height) {  // the frame's last row was its embedded line
        view_bytes.height = frame.height;
        const auto pixels = static_cast<std::size_t>(frame.height) * static_cast<std::size_t>(frame.width);
        view_bytes.pixels.resize(pixels), on_target_.resize(pixels);
    }
    const Rigid3 T_target_world = inverse(view_.T_world_target());
    HitBatch hits;
    for (const FeatureMatch& m : match_corners(view_bytes, frame_bytes, on_target_, settings_.features)) {
        const double u = m.view_u, v = m.view_v;
        view_.trace_pixels(std::array<ImagePoint, 5>{{{u, v},
                                                      {u + kNeighbour_px, v},
                                                      {u - kNeighbour_px, v},
                                                      {u, v + kNeighbour_px},
                                                      {u, v - kNeighbour_px}}},
                           hits);
        if (hits.body[0] != target || !on_smooth_surface(hits) || is_clipped(frame, m.frame_u, m.frame_v)) continue;
        const Eigen::Matrix2d C = flow_covariance(view_bytes, frame_bytes, m, kHalfWindow_px);
        if (!(C(0, 0) > 0 && C(1, 1) > 0)) continue;
        points.body_m.push_back(T_target_world * hits.position[0]);
        points.pixels.push_back({m.frame_u, m.frame_v});
        points.noise.push_back(C);
    }
}

FeatureEstimate FeatureAlignment::align(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                                        const ApparentMotion& motion) {
    FeatureEstimate e = estimate(frame, at, guess, motion);
    const PoseShifts by_model = image_shifts(settings_.model, e.T_camera_target, motion);
    const Matrix6 of_model = by_model * by_model.transpose();
    e.covariance += of_model, e.bound += of_model;
    Fit fit;
    if (e.status == FeatureStatus::few_matches || e.status == FeatureStatus::no_pose)
        fit.failed = fmt::format("{} in {} renders", name(e.status), e.rounds.size());
    else
        observe(e.T_camera_target, e.covariance, fit), compare_with_guess(e.T_camera_target, guess, fit);
    if (fit.failed.empty() && e.floor_px > settings_.floor_most_px)
        fit.failed = fmt::format("matches scatter by {:.3g} px, expected at most {:.3g}", e.floor_px,
                                 settings_.floor_most_px);
    e.answer = judge(std::move(fit));
    return e;
}

FeatureEstimate FeatureAlignment::estimate(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                                           const ApparentMotion& motion) {
    FeatureEstimate estimate;
    estimate.T_camera_target = guess;
    view_.begin_frame(at, motion, times_);
    const CameraModelHandle model(view_.camera());
    const CameraModel& camera = *model;
    const ByteScale scale(frame, sensor_);
    const ByteImage frame_bytes = scale.scaled(frame);
    FrameSettings render_settings;
    render_settings.spp = times_.exposure_s > 0 ? settings_.spp_over_time : settings_.spp;
    render_settings.seed = settings_.seed;
    PnpRefiner refiner(static_cast<std::size_t>(settings_.features));
    double floor_px = 1;  // until there are matches
    Points points;
    for (int k = 0; k < settings_.renders_max; ++k) {
        FeatureRound& round = estimate.rounds.emplace_back();
        view_.render(estimate.T_camera_target, render_settings, false);
        gather(frame, frame_bytes, scale, points);
        to_mid_exposure(estimate.T_camera_target, motion, times_, points.pixels, points.body_m);
        if (points.size() < kFewestMatches) {
            estimate.status = FeatureStatus::few_matches;
            return estimate;
        }

        // First a robust pose; then least squares on its inliers.
        const auto solve = [&](Loss loss) {
            const std::vector<PixelCovariance> covariances = points.covariances(floor_px);
            RefineOptions options;
            options.loss.kind = loss;
            const PnpInput input{model, points.body_m, points.pixels, 1, covariances};
            return PnpFit(refiner.refine(input, estimate.T_camera_target, options));
        };
        const std::vector<double> before = points.residuals_px(camera, estimate.T_camera_target);
        floor_px = std::max(floor_px, scale_of(before));
        PnpFit fit = solve(Loss::cauchy);
        for (int tries = 0; tries < 2 && fit.ok(); ++tries) {
            const std::vector<double> residuals = points.residuals_px(camera, fit.T_camera_body);
            const double outlier_px = kOutlier * scale_of(residuals);
            std::vector<std::uint8_t> agrees;
            for (const double r : residuals) agrees.push_back(r < outlier_px ? 1 : 0);
            points.keep(agrees);
            if (points.size() < kFewestMatches) {
                estimate.status = FeatureStatus::few_matches;
                return estimate;
            }
            floor_px =
                points.floor_px(camera, fit.T_camera_body, points.freedom(camera, fit.T_camera_body, floor_px));
            fit = solve(Loss::none);
        }
        if (!fit.ok()) {
            estimate.status = FeatureStatus::no_pose;
            return estimate;
        }
        std::vector<double> moved;
        for (const Vec3& p : points.body_m) {
            const Pixel a = project(camera, estimate.T_camera_target * p),
                        b = project(camera, fit.T_camera_body * p);
            moved.push_back(std::hypot(a.u - b.u, a.v - b.v));
        }
        estimate.agreeing = static_cast<int>(points.size());
        round.before_px = root_mean_square(points.residuals_px(camera, estimate.T_camera_target));
        round.after_px = root_mean_square(points.residuals_px(camera, fit.T_camera_body));
        const Vector6 step = error_between(estimate.T_camera_target, fit.T_camera_body);
        estimate.T_camera_target = fit.T_camera_body;
        const double freedom = points.freedom(camera, fit.T_camera_body, floor_px);
        if (!(freedom >= kFewestFreedom)) {
            estimate.status = FeatureStatus::few_matches;
            return estimate;
        }
        floor_px = points.floor_px(camera, fit.T_camera_body, freedom);
        const Matrix6& C = fit.covariance;
        estimate.covariance = C + C * points.sums(camera, fit.T_camera_body, floor_px).shared * C;
        // The scatter is estimated from so many numbers (Student 1908).
        estimate.covariance *= freedom / (freedom - 2);
        estimate.covariance *= points.inflation(camera, fit.T_camera_body, C, estimate.covariance, floor_px);
        estimate.status = FeatureStatus::unsettled;
        if (root_mean_square(moved) < settings_.settled_px ||
            normalised_error_squared(step, estimate.covariance) < kSettledSquared) {
            estimate.status = FeatureStatus::settled;
            break;
        }
        // Where the views end, what the pose still moves by is part of its error.
        if (k == settings_.renders_max - 1) estimate.covariance += step * step.transpose();
    }
    estimate.floor_px = floor_px;
    const std::vector<PixelCovariance> of_noise = points.covariances(0);
    estimate.bound =
        refiner.refine({model, points.body_m, points.pixels, 1, of_noise}, estimate.T_camera_target).covariance;
    return estimate;
}

}  // namespace narpa
