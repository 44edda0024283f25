#include "estimator/cloud/beam_association.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace narpa {
namespace {

/// Beams that meet a surface at a flatter angle are not used.
constexpr double kGrazingCosine = 0.05;

/// Sixteen places of even density on a disc of radius 1, the first in its middle.
const std::array<std::array<double, 2>, kLanes>& disc() {
    static const auto places = [] {
        std::array<std::array<double, 2>, kLanes> d{};
        for (std::size_t k = 0; k < kLanes; ++k) {
            const double r = std::sqrt(static_cast<double>(k) / (kLanes - 1)),
                         a = 2.39996322972865332 * static_cast<double>(k);
            d[k] = {r * std::cos(a), r * std::sin(a)};
        }
        return d;
    }();
    return places;
}

}  // namespace

BeamAssociation::BeamAssociation(const Tracer& tracer, std::size_t target)
    : tracer_(tracer), at_rest_(tracer.scene().bodies.size()), target_(static_cast<std::uint32_t>(target)) {}

void BeamAssociation::take(std::span<const RangePoint> points, const ApparentMotion& motion) {
    turning_ = !(motion.rate_rad_s == Vec3{});
    beams_.clear();
    for (const RangePoint& p : points) {
        Beam b{{}, p.origin_m - p.t_s * motion.velocity_m_s, p.direction, p.range_m};
        if (turning_) {
            b.turn = exp_rotation(p.t_s * motion.rate_rad_s);
            b.origin_m = conjugate(b.turn) * b.origin_m;
            b.direction = conjugate(b.turn) * b.direction;
        }
        beams_.push_back(b);
    }
}

Ray BeamAssociation::in_target(const Rigid3& T, const Beam& beam) const noexcept {
    const Vec3 target_m = turning_ ? conjugate(beam.turn) * T.t : T.t;
    const Quat q = conjugate(T.q);
    return {q * (beam.origin_m - target_m), q * beam.direction};
}

void BeamAssociation::associate(const Rigid3& T, const RangeNoise& noise, double search_m, std::size_t stride,
                                std::vector<PointToPlane>& out) const {
    out.clear();
    if (search_m > 0)
        around_beams(T, search_m, stride, out);
    else
        along_beams(T, noise, stride, out);
    for (std::size_t k = 0; k < out.size(); ++k) {
        PointToPlane& p = out[k];
        if (p.fate != BeamFate::met) continue;
        const Beam& beam = beams_[k * stride];
        const double cosine = -dot(p.normal, conjugate(T.q) * beam.direction);
        if (search_m > 0) {
            p.sigma_m = std::hypot(noise.range_m, 0.25 * search_m);
            continue;
        }
        if (!(cosine >= kGrazingCosine)) {
            p.fate = BeamFate::grazing;
            continue;
        }
        const double along = noise.range_m * cosine;
        const double across = beam.range_m * noise.pointing_rad * std::sqrt(std::max(0.0, 1 - cosine * cosine));
        p.sigma_m = std::sqrt(along * along + across * across);
    }
}

void BeamAssociation::along_beams(const Rigid3& T, const RangeNoise& noise, std::size_t stride,
                                  std::vector<PointToPlane>& out) const {
    RayBatch rays;
    HitBatch hits;
    Lanes<double> range_m{};
    for (std::size_t i = 0; i < beams_.size();) {
        for (rays.n = 0; rays.n < kLanes && i < beams_.size(); ++rays.n, i += stride) {
            rays.put(rays.n, in_target(T, beams_[i]));
            range_m[rays.n] = beams_[i].range_m;
        }
        tracer_.intersect(at_rest_, rays, {&target_, 1}, hits);
        for (std::size_t lane = 0; lane < rays.n; ++lane) {
            PointToPlane& p = out.emplace_back();
            if (!is_set(hits.met, lane)) continue;
            p.fate = BeamFate::met;
            p.surface_m = hits.position[lane];
            p.normal = hits.geometric_normal[lane];
            p.distance_m = dot(p.normal, rays.direction[lane]) * (range_m[lane] - hits.range_m[lane]);
        }
        if (noise.footprint_rad > 0) find_edges(rays, noise, std::span(out).last(rays.n));
    }
}

/// Around the rim of each footprint: a ray that leaves the plane of the axis's hit, or meets what the axis misses,
/// shows an edge.
void BeamAssociation::find_edges(const RayBatch& axes, const RangeNoise& noise,
                                 std::span<PointToPlane> points) const {
    constexpr int kRim = 6;
    // A hexagon about the footprint.
    const double tangent = std::tan(0.5 * noise.footprint_rad) / std::cos(3.14159265358979323846 / kRim);
    RayBatch rays;
    HitBatch hits;
    rays.n = axes.n;
    for (int k = 0; k < kRim; ++k) {
        const double turn = 2 * 3.14159265358979323846 * k / kRim;
        for (std::size_t lane = 0; lane < axes.n; ++lane) {
            const Vec3 d = axes.direction[lane];
            const Vec3 x = normalized(std::abs(d.x) < 0.7 ? cross(d, Vec3{1, 0, 0}) : cross(d, Vec3{0, 1, 0}));
            const Vec3 off = std::cos(turn) * x + std::sin(turn) * cross(d, x);
            rays.put(lane, {axes.origin[lane], normalized(d + tangent * off)});
        }
        tracer_.intersect(at_rest_, rays, {&target_, 1}, hits);
        for (std::size_t lane = 0; lane < axes.n; ++lane) {
            PointToPlane& p = points[lane];
            const bool met = is_set(hits.met, lane);
            if (p.fate == BeamFate::met) {
                const bool on_plane =
                    met && std::abs(dot(p.normal, hits.position[lane] - p.surface_m)) < noise.range_m;
                if (!on_plane) p.fate = BeamFate::edge;
            } else if (met) {
                p.fate = BeamFate::edge;
            }
        }
    }
}

void BeamAssociation::around_beams(const Rigid3& T, double search_m, std::size_t stride,
                                   std::vector<PointToPlane>& out) const {
    RayBatch rays;
    HitBatch hits;
    rays.n = kLanes;
    for (std::size_t i = 0; i < beams_.size(); i += stride) {
        const Ray beam = in_target(T, beams_[i]);
        const Vec3 point = beam.origin + beams_[i].range_m * beam.direction;
        const Vec3& d = beam.direction;
        const Vec3 across = normalized(std::abs(d.x) < 0.7 ? cross(d, Vec3{1, 0, 0}) : cross(d, Vec3{0, 1, 0}));
        const Vec3 other = cross(d, across);
        for (std::size_t k = 0; k < kLanes; ++k) {
            const auto& [u, v] = disc()[k];
            rays.put(k, {beam.origin, normalized(point + search_m * (u * across + v * other) - beam.origin)});
        }
        tracer_.intersect(at_rest_, rays, {&target_, 1}, hits);
        PointToPlane& p = out.emplace_back();
        double nearest = std::numeric_limits<double>::infinity();
        for_each_lane(hits.met, [&](std::size_t lane) {
            const Vec3 away = point - hits.position[lane];
            if (!(dot(away, away) < nearest)) return;
            nearest = dot(away, away);
            p.fate = BeamFate::met;
            p.surface_m = hits.position[lane];
            p.normal = hits.geometric_normal[lane];
            p.distance_m = dot(p.normal, away);
        });
        // Beside the model a tangent plane would let the point slide; the nearest place holds it.
        if (nearest > 0 && p.fate == BeamFate::met && !is_set(hits.met, 0)) {
            p.distance_m = std::sqrt(nearest);
            p.normal = (point - p.surface_m) / p.distance_m;
        }
    }
}

Vector6 BeamAssociation::derivative(const Rigid3& T, std::size_t i, const PointToPlane& p) const {
    // The surface goes with the target: a turn w and a shift d of the pose move it by turn (w x q s + d).
    const Vec3 turning = T.q * cross(p.surface_m, p.normal);
    const Vec3 normal = T.q * p.normal;
    const Vec3 shifting = turning_ ? beams_[i].turn * normal : normal;
    Vector6 J;
    J << -turning.x, -turning.y, -turning.z, -shifting.x, -shifting.y, -shifting.z;
    return J;
}

}  // namespace narpa
