#include "estimator/stereo/stereo_alignment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "estimator/least_squares/median.h"

namespace narpa {
namespace {

/// Error along the epipolar line that all matches have in common: what relief and interpolation do to matches
/// alike. Measured on scenes/docking-stereo.toml: 0.007 px over the corners of a pair.
constexpr double kStereoBias_px = 0.01;
/// Matches this close to an edge of the model, as a diameter, are left out: they may be of the surface on either
/// side. On the same scene, over 40 pairs, the mean NEES is 12 with all of them, 5.5 with 2 px, 4.1 with 3 px.
constexpr double kStereoFootprint_px = 3;
/// Radius of the patches: larger ones have less noise, but more relief, which is not noise.
constexpr int kStereoPatch_px = 7;
/// The sphere of the search is larger than the target and the guess's error by this part of the target.
constexpr double kStereoMargin = 0.05;
/// Depths from here on are searched, as a part of the farthest: the camera may be within the sphere.
constexpr double kNearestStereoPart = 0.05;

}  // namespace

StereoSettings stereo_settings_near(const StereoSphere& target) {
    StereoSettings s;
    s.farthest_m = target.centre_m.z + target.radius_m;
    s.nearest_m = std::max(target.centre_m.z - target.radius_m, kNearestStereoPart * s.farthest_m);
    s.within = target;
    s.patch_radius_px = kStereoPatch_px;
    return s;
}

std::vector<RangePoint> range_points_of(const StereoPoints& matches, const StereoPair& pair,
                                        const ModelUncertainty& model) {
    const double focal_px = paraxial_pinhole(*pair.left.model).fx;
    const double bias_px = std::hypot(kStereoBias_px, std::sqrt(2.0) * focal_px * model.boresight_rad);
    std::vector<RangePoint> points;
    for (const StereoPoint& p : matches.points) {
        const double range_m = p.point.point_m.norm();
        points.push_back({.direction = to_vec3(Eigen::Vector3d(p.point.point_m / range_m)),
                          .range_m = range_m,
                          .sigma_m = p.range_sigma_m(),
                          .common_m = {bias_px * p.range_m_per_px, model.focal * range_m}});
    }
    return points;
}

Result<StereoEstimate> StereoAlignment::align(const StereoPair& pair, const MeasuredImage& left,
                                              const MeasuredImage& right, const Rigid3& guess, double search_m,
                                              const std::optional<Matrix6>& start_covariance) const {
    const double reach_m = tracer_.bounding_radius_m(static_cast<std::uint32_t>(target_));
    StereoEstimate out;
    const StereoSphere sphere{guess.t, (1 + kStereoMargin) * reach_m + search_m};
    StereoSettings s = stereo_settings_near(sphere);
    s.points_max = settings_.points_max;
    if (!(s.farthest_m > 0)) {
        out.pose.answer.why = "the target is taken to be behind the left camera";
        return out;
    }
    auto matches = match_stereo(pair, left, right, s);
    if (!matches) return matches.error();
    out.matches = *std::move(matches);
    const std::vector<RangePoint> points = range_points_of(out.matches, pair, settings_.model);
    if (points.size() < kFewestSweepPoints) {
        out.pose.answer.why = fmt::format(
            "{} points of the target were matched, expected at least {}: too little texture, or another view? "
            "Corners: {}",
            points.size(), kFewestSweepPoints, to_text(out.matches.counts));
        return out;
    }
    std::vector<double> sigmas;
    for (const RangePoint& p : points) sigmas.push_back(p.sigma_m);
    IcpSettings icp;
    icp.noise = {.range_m = upper_median(std::span(sigmas)),
                 .pointing_rad = 0,
                 .footprint_rad = kStereoFootprint_px / paraxial_pinhole(*pair.left.model).fx};
    icp.model = settings_.model;
    auto pose = CloudIcp(tracer_, target_, icp).align(points, {}, guess, search_m, {}, start_covariance);
    if (!pose) return pose.error();
    out.pose = *std::move(pose);
    return out;
}

}  // namespace narpa
