#include "estimator/features/feature_alignment.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "estimator/least_squares/median.h"
#include "estimator/least_squares/symmetric.h"
#include "estimator/uncertainty/response.h"
#include "estimator/uncertainty/unobserved.h"
#include "estimator/uncertainty/untold.h"

namespace narpa {
namespace {

/// A match whose residual exceeds this many times the median is an outlier.
constexpr double kOutlier_medians = 4;
/// A feature is on a smooth surface if rays this far beside it meet the same surface,
constexpr double kNeighbour_px = 1.5;
/// off its tangent plane by at most this many pixels' worth of depth: a bend is a corner, a step is an outline.
constexpr double kStep_px = 6;

/// With fewer degrees of freedom the residuals do not determine their scatter.
constexpr double kFewestFreedom = 3;
/// Steps with a smaller squared Mahalanobis length are noise, as each view selects other features.
constexpr double kSettled_chi2 = 9;
/// RMS motion in the image by which the response is measured.
constexpr double kMoved_px = 2;
/// With at least this many matches most are of points on the body, and the response is not measured.
constexpr int kManyMatches = 30;
/// If the matches are nearer to the guess than this (RMS), no second start is needed.
constexpr double kNear_px = 2 * kMoved_px;
/// Fewer flows do not determine a motion.
constexpr std::size_t kFewestFlows = 5;
/// Answers from two starts with a larger squared Mahalanobis distance are two poses.
constexpr double kSamePose_chi2 = 30;
/// Views whose light differs from the frame's by more than this part are scaled to it, as optical flow takes any
/// difference for motion. A match with a ratio above kMaxGain is wrong.
constexpr double kSameLight = 0.01, kMaxGain = 3;
/// Side of the blocks in which the target is searched.
constexpr int kBlock_px = 6;

/// True if more than half of a match's window is clipped in the frame, so that its gradients are not the light's.
bool is_clipped(const MeasuredImage& frame, double u, double v) {
    if (frame.clipped.empty()) return false;
    const int x0 = static_cast<int>(std::lround(u)), y0 = static_cast<int>(std::lround(v));
    int clipped = 0, all = 0;
    for (int y = std::max(0, y0 - kFlowHalfWindow_px); y <= std::min(frame.height - 1, y0 + kFlowHalfWindow_px);
         ++y)
        for (int x = std::max(0, x0 - kFlowHalfWindow_px); x <= std::min(frame.width - 1, x0 + kFlowHalfWindow_px);
             ++x) {
            clipped += frame.clipped[frame.index(x, y)] != 0;
            ++all;
        }
    return 2 * clipped > all;
}

/// The motion of the target that best explains these flows between two views, if all are of points on the body.
/// Zero for too few of them.
Vector6 motion_shown(const ModelMatches& points, const std::vector<Matrix26>& jacobians, double floor_px,
                     std::vector<FeatureMatch> flows) {
    constexpr int kRounds = 3;  // the first two find outliers
    Vector6 motion = Vector6::Zero();
    const auto flow = [](const FeatureMatch& m) {
        return Eigen::Vector2d(m.frame_u - m.view_u, m.frame_v - m.view_v);
    };
    for (int round = 0; round < kRounds && flows.size() >= kFewestFlows; ++round) {
        Matrix6 H = Matrix6::Zero();
        Vector6 gradient = Vector6::Zero();
        for (const FeatureMatch& m : flows) {
            const Eigen::Matrix<double, 6, 2> weighted =
                jacobians[m.point].transpose() * points.match_covariance(m.point, floor_px).inverse();
            H += weighted * jacobians[m.point];
            gradient += weighted * flow(m);
        }
        motion = ldlt_solve(H, gradient);
        std::vector<double> lengths;
        for (const FeatureMatch& m : flows) lengths.push_back((jacobians[m.point] * motion - flow(m)).norm());
        const double max_px = kOutlier_medians * scale_of(lengths);
        std::erase_if(
            flows, [&](const FeatureMatch& m) { return (jacobians[m.point] * motion - flow(m)).norm() > max_px; });
    }
    return motion;
}

}  // namespace

std::string_view name(FeatureStatus status) noexcept {
    constexpr std::array<std::string_view, 4> names{"settled", "unsettled", "few matches", "no pose"};
    return names[static_cast<std::size_t>(status)];
}

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

/// True if the rays of lanes 1 to 4 meet the surface that lane 0 meets.
bool FeatureAlignment::on_smooth_surface(const HitBatch& hits) const {
    const Hit hit = hits[0];
    const double step_m = kStep_px * hit.range_m / view_.camera().model->pixels_per_radian();
    for (std::size_t i = 1; i < 5; ++i) {
        if (hits.body[i] != hit.body) return false;
        const Vec3 between = hits.position[i] - hit.position;
        if (std::min(std::abs(dot(between, hit.geometric_normal)),
                     std::abs(dot(between, hits.geometric_normal[i]))) >= step_m)
            return false;
    }
    return true;
}

/// Marks the blocks of pixels in which features are searched: those whose centre shows the target.
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

double FeatureAlignment::gain_about(const std::vector<FeatureMatch>& matches, const MeasuredImage& frame) const {
    const RadianceImage& view = view_.radiance();
    std::vector<double> gains;
    for (const FeatureMatch& m : matches) {
        if (is_clipped(frame, m.frame_u, m.frame_v)) continue;
        const auto sum = [&](double u, double v, auto&& light) {
            double out = 0;
            const int x = static_cast<int>(std::lround(u)), y = static_cast<int>(std::lround(v));
            for (int dy = -kFlowHalfWindow_px; dy <= kFlowHalfWindow_px; ++dy)
                for (int dx = -kFlowHalfWindow_px; dx <= kFlowHalfWindow_px; ++dx)
                    out += light(frame.index(std::clamp(x + dx, 0, frame.width - 1),
                                             std::clamp(y + dy, 0, frame.height - 1))) -
                           sensor_.black_dn;
            return out;
        };
        const double in_frame =
            sum(m.frame_u, m.frame_v, [&](std::size_t p) { return static_cast<double>(frame.dn[p]); });
        const double in_view = sum(m.view_u, m.view_v, [&](std::size_t p) { return sensor_.dn(view.pixels[p]); });
        if (in_view > 0) gains.push_back(std::clamp(in_frame / in_view, 1 / kMaxGain, kMaxGain));
    }
    return gains.empty() ? 1 : upper_median(std::span(gains));
}

bool FeatureAlignment::gather(const MeasuredImage& frame, const ByteImage& frame_bytes, const ByteScale& scale,
                              bool is_near, double& gain, ModelMatches& points) {
    points = {};
    const auto target = static_cast<int>(view_.target());
    find_target();
    // The frame's last row may have been its embedded line.
    const auto pixels = static_cast<std::size_t>(frame.height) * static_cast<std::size_t>(frame.width);
    on_target_.resize(pixels);
    ByteImage view_bytes;
    const auto match = [&] {
        view_bytes = scale.scaled(view_.radiance(), gain);
        view_bytes.height = frame.height, view_bytes.pixels.resize(pixels);
        return match_corners(view_bytes, frame_bytes, on_target_, settings_.features, is_near);
    };
    CornerMatches corners = match();
    if (const double found = gain_about(corners.matches, frame); std::abs(found / gain - 1) > kSameLight)
        gain = found, corners = match();
    const Rigid3 T_target_world = inverse(view_.T_world_target());
    HitBatch hits;
    for (const FeatureMatch& m : corners.matches) {
        const double u = m.view_u, v = m.view_v;
        view_.trace_pixels(std::array<ImagePoint, 5>{{{u, v},
                                                      {u + kNeighbour_px, v},
                                                      {u - kNeighbour_px, v},
                                                      {u, v + kNeighbour_px},
                                                      {u, v - kNeighbour_px}}},
                           hits);
        if (hits.body[0] != target || !on_smooth_surface(hits) || is_clipped(frame, m.frame_u, m.frame_v)) continue;
        const Eigen::Matrix2d C = flow_covariance(view_bytes, frame_bytes, m);
        if (!(C(0, 0) > 0 && C(1, 1) > 0)) continue;
        points.body_m.push_back(T_target_world * hits.position[0]);
        points.in_view.push_back({u, v});
        points.pixels.push_back({m.frame_u, m.frame_v});
        points.noise.push_back(C);
    }
    return corners.coarse_levels_mislead;
}

/// Response of the matches to the least observed motions, from the pose of the last view: the identity if all are
/// of points on the body. Outlines and shading do not move with the body, and matches slide along edges.
Matrix6 FeatureAlignment::response(const ModelMatches& points, const ByteScale& scale,
                                   const FrameSettings& settings, const Rigid3& T_camera_target,
                                   const Matrix6& covariance, double floor_px) {
    const std::vector<Matrix26> jacobians = points.jacobians(*view_.camera().model, T_camera_target);
    const ByteImage here = scale.scaled(view_.radiance());
    const auto shown = [&](int, const Vector6& motion) -> Vector6 {
        double squares = 0;
        for (const Matrix26& J : jacobians) squares += (J * motion).squaredNorm();
        const double sigmas = kMoved_px / std::sqrt(squares / static_cast<double>(points.size()));
        view_.render(displaced(T_camera_target, sigmas * motion), settings, false);
        const auto flows = track_points(here, scale.scaled(view_.radiance()), points.in_view);
        return motion_shown(points, jacobians, floor_px, flows) / sigmas;
    };
    return response_to_weakest(observability_of(covariance, norm(T_camera_target.t)), shown);
}

PoseShifts FeatureAlignment::shifts_by_light(const ModelMatches& points, const ByteScale& scale,
                                             const FrameSettings& settings, const Rigid3& T_camera_target,
                                             const BodyPoses& at, const ApparentMotion& motion, double floor_px) {
    PoseShifts shifts(6, 3);
    const std::vector<Matrix26> jacobians = points.jacobians(*view_.camera().model, T_camera_target);
    view_.render(T_camera_target, settings, false);
    const ByteImage here = scale.scaled(view_.radiance());
    for (int axis = 0; axis < 3; ++axis) {
        Vec3 turn{};
        turn[axis] = settings_.model.light_rad;
        BodyPoses turned = at;
        turned.T_world_body[view_.target()].q = normalized(at.T_world_body[view_.target()].q * exp_rotation(turn));
        view_.begin_frame(turned, motion, times_);
        view_.render(T_camera_target, settings, false);
        const auto flows = track_points(here, scale.scaled(view_.radiance()), points.in_view);
        shifts.col(axis) = motion_shown(points, jacobians, floor_px, flows);
    }
    view_.begin_frame(at, motion, times_);
    return shifts;
}

/// Outlines, and edges along which a match can slide, hold answers near their start. So a second start, the guess
/// mirrored in the answer, must lead to it too; the distance between the two answers is part of the error.
void FeatureAlignment::compare_with_mirrored(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                                             const ApparentMotion& motion, FeatureEstimate& e, Fit& fit) {
    if (e.rounds.front().before_px < kNear_px) return;
    const Vector6 moved = error_between(guess, e.T_camera_target);
    const FeatureEstimate other = estimate(frame, at, displaced(e.T_camera_target, moved), motion);
    if (!other.has_pose()) {
        fit.failed = fmt::format("the guess mirrored in the answer leads to no pose: {}", name(other.status));
        return;
    }
    const Vector6 apart = error_between(e.T_camera_target, other.T_camera_target);
    if (normalised_error_squared(apart, e.covariance + other.covariance) > kSamePose_chi2)
        fit.rivals.push_back({other.T_camera_target, 0});
    e.covariance += 0.5 * apart * apart.transpose();
}

void FeatureAlignment::keep_guess_where_unobserved(const Rigid3& guess, FeatureEstimate& e, Fit& fit) {
    const Observability o = fit.observability;
    e.T_camera_target =
        with_guess_where_unobserved(e.matches, *view_.camera().model, o, e.T_camera_target, guess, e.floor_px);
    e.covariance = e.covariance_of_model +
                   with_guess(o, e.covariance - e.covariance_of_model, GuessError{}, norm(e.T_camera_target.t));
    observe(e.T_camera_target, e.covariance, fit);
}

FeatureEstimate FeatureAlignment::align(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                                        const ApparentMotion& motion) {
    FeatureEstimate e = estimate(frame, at, guess, motion);
    Fit fit;
    if (!e.has_pose())
        fit.failed =
            fmt::format("{} in {} render{}", name(e.status), e.rounds.size(), e.rounds.size() == 1 ? "" : "s");
    else if (e.floor_px > settings_.floor_max_px)
        fit.failed = fmt::format("matches scatter by {:.3g} px, expected at most {:.3g}", e.floor_px,
                                 settings_.floor_max_px);
    else
        compare_with_mirrored(frame, at, guess, motion, e, fit);
    e.covariance_of_model =
        covariance_by(joined(image_shifts(settings_.model, e.T_camera_target, motion, e.by_focal), e.by_light));
    // With a rolling shutter that is told, matches of renders over time have errors of their own that grow with the
    // row.
    if (fit.failed.empty() && e.has_pose() && times_.row_s == 0 &&
        refuses(e.rows.sigmas, e.rows.shift, e.covariance)) {
        if (normalised_error_squared(e.rows.shift, e.covariance) > kWidenedShift_chi2)
            fit.failed = why_untold(kProgressiveRows, e.rows.sigmas, e.rows.shift, e.covariance);
        else
            e.covariance += e.rows.shift * e.rows.shift.transpose();
    }
    e.covariance += e.covariance_of_model, e.bound += e.covariance_of_model;
    if (e.has_pose()) {
        observe(e.T_camera_target, e.covariance, fit);
        if (fit.failed.empty() && fit.observability.unobserved > 0) keep_guess_where_unobserved(guess, e, fit);
        compare_with_guess(e.T_camera_target, guess, fit);
    }
    e.answer = judge(std::move(fit));
    return e;
}

FeatureEstimate FeatureAlignment::estimate(const MeasuredImage& frame, const BodyPoses& at, const Rigid3& guess,
                                           const ApparentMotion& motion) {
    FeatureEstimate estimate;
    estimate.T_camera_target = guess;
    view_.begin_frame(at, motion, times_);
    const CameraModel& camera = *view_.camera().model;
    const ByteScale scale(frame, sensor_);
    const ByteImage frame_bytes = scale.scaled(frame);
    FrameSettings render_settings;
    render_settings.spp = times_.exposure_s > 0 ? settings_.spp_over_time : settings_.spp;
    render_settings.seed = settings_.seed;
    PnpRefiner refiner(static_cast<std::size_t>(settings_.features));
    double gain = 1, floor_px = 1;  // until there are matches
    ModelMatches points;
    Rigid3 T_of_view = guess;
    bool is_near = false;  // the pose of the view: its matches agree
    for (int k = 0; k < settings_.renders_max; ++k) {
        FeatureRound& round = estimate.rounds.emplace_back();
        view_.render(estimate.T_camera_target, render_settings, false);
        bool misled = gather(frame, frame_bytes, scale, is_near, gain, points);
        if (misled && !is_near && points.size() < kFewestMatches)
            gather(frame, frame_bytes, scale, true, gain, points), misled = false;
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
            const PnpInput input{&camera, points.body_m, points.pixels, 1, covariances};
            return PnpFit(refiner.refine(input, estimate.T_camera_target, options));
        };
        const std::vector<double> before = points.residuals_px(camera, estimate.T_camera_target);
        floor_px = std::max(floor_px, scale_of(before));
        PnpFit fit = solve(Loss::cauchy);
        for (int tries = 0; tries < 2 && fit.ok(); ++tries) {
            const std::vector<double> residuals = points.residuals_px(camera, fit.T_camera_body);
            const double outlier_px = kOutlier_medians * scale_of(residuals);
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
        const double moved_px = points.moved_px(camera, estimate.T_camera_target, fit.T_camera_body);
        estimate.agreeing = static_cast<int>(points.size());
        round.before_px = root_mean_square(points.residuals_px(camera, estimate.T_camera_target));
        round.after_px = root_mean_square(points.residuals_px(camera, fit.T_camera_body));
        const Vector6 step = error_between(estimate.T_camera_target, fit.T_camera_body);
        T_of_view = estimate.T_camera_target;
        estimate.T_camera_target = fit.T_camera_body;
        const double freedom = points.freedom(camera, fit.T_camera_body, floor_px);
        if (!(freedom >= kFewestFreedom)) {
            estimate.status = FeatureStatus::few_matches;
            return estimate;
        }
        floor_px = points.floor_px(camera, fit.T_camera_body, freedom);
        const Matrix6& C = fit.covariance;
        estimate.covariance = C + C * points.sums(camera, fit.T_camera_body, floor_px).shared * C;
        // Student's t: the scatter is estimated from few residuals (Student 1908).
        estimate.covariance *= freedom / (freedom - 2);
        estimate.covariance *= points.inflation(camera, fit.T_camera_body, C, estimate.covariance, floor_px);
        estimate.status = FeatureStatus::unsettled;
        const bool leaves_points_out = misled && !is_near;
        is_near = floor_px <= settings_.floor_max_px;
        if (!leaves_points_out && (moved_px < settings_.settled_px ||
                                   normalised_error_squared(step, estimate.covariance) < kSettled_chi2)) {
            estimate.status = FeatureStatus::settled;
            break;
        }
        // After the last view the pose's remaining motion is part of its error.
        if (k == settings_.renders_max - 1) estimate.covariance += step * step.transpose();
    }
    estimate.floor_px = floor_px;
    estimate.rows = progressive_rows(points, camera, estimate.T_camera_target, floor_px);
    estimate.matches = points;
    estimate.points = points.observations();
    if (estimate.agreeing < kManyMatches) {
        const Matrix6 before = estimate.covariance;
        estimate.covariance = covariance_by_response(
            estimate.covariance,
            response(points, scale, render_settings, T_of_view, estimate.covariance, floor_px));
        estimate.points.inflation =
            std::max(1.0, ldlt_solve(before, estimate.covariance).trace() / static_cast<double>(before.rows()));
    }
    if (settings_.model.light_rad > 0)
        estimate.by_light = shifts_by_light(points, scale, render_settings, T_of_view, at, motion, floor_px);
    const std::vector<PixelCovariance> as_weighed = points.covariances(floor_px), of_noise = points.covariances(0);
    estimate.by_focal =
        shift_by_focal({&camera, points.body_m, points.pixels, 1, as_weighed}, estimate.T_camera_target);
    estimate.bound =
        refiner.refine({&camera, points.body_m, points.pixels, 1, of_noise}, estimate.T_camera_target).covariance;
    return estimate;
}

}  // namespace narpa
