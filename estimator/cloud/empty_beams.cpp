#include "estimator/cloud/empty_beams.h"

#include <algorithm>
#include <cmath>

#include "estimator/cloud/beam_association.h"
#include "renderer/lidar/lidar_shot.h"

namespace narpa {
namespace {

constexpr double kInsideSigmas = 5;
constexpr float kSteepEnough = 0.342F;  ///< cosine of 70 degrees
/// Fewer never refute a pose: even 3 in one stretch need 245 beams with a return.
constexpr std::size_t kFewestEmpty = 3;

double log_choose(double n, double k) {
    return std::lgamma(n + 1) - std::lgamma(k + 1) - std::lgamma(n - k + 1);
}

}  // namespace

double chance_of_stretches(std::size_t empty, std::size_t returned, std::size_t stretches) {
    const auto n = static_cast<double>(empty), m = static_cast<double>(returned);
    double sum = 0;
    for (double r = 1; r <= static_cast<double>(stretches) && r <= n && r <= m + 1; ++r)
        sum += std::exp(log_choose(n - 1, r - 1) + log_choose(m + 1, r) - log_choose(n + m, n));
    return empty == 0 ? 1 : std::min(1.0, sum);
}

struct EmptyBeams::At {
    Rigid3 T;
    Matrix6 covariance;
};

void EmptyBeams::take(std::span<const RangePoint> points, std::span<const EmptyBeam> empty,
                      const ApparentMotion& motion) {
    points_ = points, empty_ = empty, motion_ = motion;
    if (!empty.empty()) inside_.reserve(points.size() + empty.size());
}

EmptyBeamCount EmptyBeams::count(const Rigid3& T, const Matrix6& covariance) {
    EmptyBeamCount out;
    if (empty_.empty() || !(certain_.farthest_m > certain_.nearest_m) || !covariance.allFinite()) return out;
    const At at{T, covariance};
    inside_.clear();
    find_inside(at, empty_, true);
    out.empty = inside_.size();
    if (out.empty < kFewestEmpty) return out;
    find_inside(at, points_, false);
    std::ranges::sort(inside_);
    // Count a beam with two echoes once.
    inside_.erase(std::unique(inside_.begin(), inside_.end()), inside_.end());
    out.empty = static_cast<std::size_t>(std::ranges::count(inside_, true, &std::pair<float, bool>::second));
    out.returned = inside_.size() - out.empty;
    for (std::size_t i = 0; i < inside_.size(); ++i)
        out.stretches += inside_[i].second && (i == 0 || !inside_[i - 1].second);
    out.chance = chance_of_stretches(out.empty, out.returned, out.stretches);
    return out;
}

/// Appends those beams that meet the model well inside its outline.
template <class Beam>
void EmptyBeams::find_inside(const At& at, std::span<const Beam> beams, bool empty) {
    const double reach2 = std::pow(tracer_.bounding_radius_m(target_), 2);
    RayBatch rays;
    Lanes<float> place{};
    const auto trace = [&] {
        for_each_lane(well_inside(at, rays), [&](std::size_t lane) { inside_.emplace_back(place[lane], empty); });
        rays.n = 0;
    };
    for (const Beam& beam : beams) {
        const Vec3 to_target = at.T.t + beam.t_s * motion_.velocity_m_s - beam.origin_m;
        const double along = dot(to_target, beam.direction);
        if (along < 0 || dot(to_target, to_target) - along * along > reach2) continue;
        const Quat q = conjugate(moved(at.T, motion_, beam.t_s).q);
        place[rays.n] = place_of(beam.direction);
        rays.put(rays.n++, {q * -to_target, q * beam.direction});
        if (rays.n == kLanes) trace();
    }
    if (rays.n > 0) trace();
}

/// Returns the mask of rays that meet a surface which certainly has a return, and their ranges.
std::uint32_t EmptyBeams::certain(const RayBatch& rays, Lanes<double>& range_m) const noexcept {
    Lanes<LidarReturn> returns{};
    shoot(tracer_, at_rest_, rays, {.range_max_m = certain_.farthest_m, .bodies = {&target_, 1}}, returns);
    std::uint32_t out = 0;
    for (std::size_t lane = 0; lane < rays.n; ++lane) {
        const LidarReturn& r = returns[lane];
        range_m[lane] = r.range_m;
        const double light = static_cast<double>(r.reflectivity) / (r.range_m * r.range_m);
        if (r.range_m > certain_.nearest_m && r.cos_incidence > kSteepEnough && light > certain_.min_light_1_m2)
            out |= 1u << lane;
    }
    return out;
}

std::uint32_t EmptyBeams::well_inside(const At& at, const RayBatch& axes) const noexcept {
    Lanes<double> range_m{}, other_m{};
    Lanes<double> tangent{};
    std::uint32_t inside = certain(axes, range_m);
    for_each_lane(inside, [&](std::size_t lane) {
        // Motion of the surface by an error of the pose (pose_estimate.h), in target axes; only the part across the
        // beam matters.
        const Vec3 d = axes.direction[lane], s = axes.origin[lane] + range_m[lane] * d;
        Eigen::Matrix<double, 3, 6> J;
        J << -skew(to_eigen(at.T.q * s)), Eigen::Matrix3d::Identity();
        const Eigen::Matrix3d moves = J * at.covariance * J.transpose();
        const Eigen::Vector3d along = to_eigen(at.T.q * d);
        const double across2 = moves.trace() - along.dot(moves * along);
        tangent[lane] = std::tan(0.55 * noise_.footprint_rad) +
                        kInsideSigmas * std::sqrt(std::max(0.0, across2) / std::pow(range_m[lane], 2) +
                                                  std::pow(noise_.pointing_rad, 2));
        if (!(tangent[lane] * range_m[lane] < tracer_.bounding_radius_m(target_))) inside &= ~(1u << lane);
    });
    RayBatch rays;
    rays.n = axes.n;
    for (int k = 0; k < kConeRays && inside != 0; ++k) {
        for (std::size_t lane = 0; lane < axes.n; ++lane) rays.put(lane, ray_in_cone(axes[lane], tangent[lane], k));
        inside &= certain(rays, other_m);
    }
    return inside;
}

}  // namespace narpa
