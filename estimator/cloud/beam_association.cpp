#include "estimator/cloud/beam_association.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/constants.h"

namespace narpa {
namespace {

/// Beams with a flatter angle of incidence (cosine below this) are not used.
constexpr double kGrazingCosine = 0.05;

/// A ray of the footprint is on another surface if its hit is further than this from the tangent plane at the
/// axis's hit, in standard deviations of the range. Smaller steps, averaged over the footprint, do not bias the
/// pose of even a thousand points.
constexpr double kOnPlane = 0.1;
/// Another surface: its normal differs by more than the angle with cosine kOtherSurface; a point lies on it within
/// kOnOther standard deviations.
constexpr double kOtherSurface = 0.87, kOnOther = 3;
/// Radius of the cone that is searched for edges, over the footprint's radius.
constexpr double kWider = 1.1;

/// Sixteen evenly distributed points on the unit disc, the first at its centre.
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

float place_of(const Vec3& direction) noexcept {
    constexpr double kBands_1_rad = 200;
    return static_cast<float>(8 * std::floor(kBands_1_rad * std::asin(std::clamp(direction.z, -1.0, 1.0))) +
                              std::atan2(direction.x, direction.y));
}

Ray ray_in_cone(const Ray& beam, double tangent, int k) noexcept {
    constexpr int kRim = kConeRays / 2;
    const Vec3& d = beam.direction;
    const Vec3 x = normalized(std::abs(d.x) < 0.7 ? cross(d, Vec3{1, 0, 0}) : cross(d, Vec3{0, 1, 0}));
    // Even k: hexagon circumscribed about the rim; odd k: at half of its radius.
    const double turn = kPi * k / kRim, radius = (k % 2 == 0 ? 1 : 0.5) * tangent / std::cos(kPi / kRim);
    return {beam.origin, normalized(d + radius * (std::cos(turn) * x + std::sin(turn) * cross(d, x)))};
}

BeamAssociation::BeamAssociation(const Tracer& tracer, std::size_t target)
    : tracer_(tracer), at_rest_(tracer.scene().bodies.size()), target_(static_cast<std::uint32_t>(target)) {}

void BeamAssociation::take(std::span<const RangePoint> points, const ApparentMotion& motion) {
    turning_ = !(motion.rate_rad_s == Vec3{});
    order_.clear();
    for (std::size_t i = 0; i < points.size(); ++i)
        order_.emplace_back(place_of(points[i].direction), static_cast<std::uint32_t>(i));
    std::ranges::sort(order_);
    beams_.clear();
    nearest_m_ = points.empty() ? 0 : std::ranges::min_element(points, {}, &RangePoint::range_m)->range_m;
    for (const RangePoint& p : points) {
        Beam b{{}, p.origin_m - p.t_s * motion.velocity_m_s, p.direction, p.range_m, p.sigma_m};
        if (turning_) {
            b.turn = exp_rotation(p.t_s * motion.rate_rad_s);
            b.origin_m = conjugate(b.turn) * b.origin_m;
            b.direction = conjugate(b.turn) * b.direction;
        }
        beams_.push_back(b);
    }
}

Ray BeamAssociation::in_model(const Rigid3& T, const Beam& beam) const noexcept {
    const Vec3 target_m = turning_ ? conjugate(beam.turn) * T.t : T.t;
    const Quat q = conjugate(T.q);
    return {q * (beam.origin_m - target_m) / scale_, q * beam.direction};
}

void BeamAssociation::associate(const Rigid3& T, const RangeNoise& noise, double search_m, std::size_t stride,
                                std::vector<PointToPlane>& out) const {
    out.clear();
    if (search_m > 0)
        around_beams(T, search_m, stride, out);
    else
        along_beams(T, stride, out);
    for (std::size_t k = 0; k < out.size(); ++k) {
        PointToPlane& p = out[k];
        if (p.fate != BeamClass::met) continue;
        const Beam& beam = beams_[k * stride];
        const double cosine = -dot(p.normal, conjugate(T.q) * beam.direction);
        if (search_m > 0) {
            p.sigma_m = std::hypot(range_sigma_m(beam, noise), 0.25 * search_m);
            continue;
        }
        if (!(cosine >= kGrazingCosine)) {
            p.fate = BeamClass::grazing;
            continue;
        }
        const double along = range_sigma_m(beam, noise) * cosine;
        const double across = beam.range_m * noise.pointing_rad * std::sqrt(std::max(0.0, 1 - cosine * cosine));
        p.sigma_m = std::sqrt(along * along + across * across);
    }
}

void BeamAssociation::along_beams(const Rigid3& T, std::size_t stride, std::vector<PointToPlane>& out) const {
    out.resize((beams_.size() + stride - 1) / stride);
    RayBatch rays;
    HitBatch hits;
    Lanes<std::size_t> index{};
    for (auto next = order_.begin(); next != order_.end();) {
        for (rays.n = 0; rays.n < kLanes && next != order_.end(); ++next) {
            if (next->second % stride != 0) continue;
            index[rays.n] = next->second;
            rays.put(rays.n++, in_model(T, beams_[next->second]));
        }
        tracer_.intersect(at_rest_, rays, {&target_, 1}, hits);
        for (std::size_t lane = 0; lane < rays.n; ++lane) {
            const Beam& beam = beams_[index[lane]];
            PointToPlane& p = out[index[lane] / stride] = {};
            if (beam.edge) p.fate = BeamClass::edge;
            if (beam.edge || !is_set(hits.met, lane)) continue;
            p.fate = BeamClass::met;
            p.surface_m = scale_ * hits.position[lane];
            p.normal = hits.geometric_normal[lane];
            p.distance_m = dot(p.normal, rays.direction[lane]) * (beam.range_m - scale_ * hits.range_m[lane]);
        }
    }
}

void BeamAssociation::find_edges(const Rigid3& T, const RangeNoise& noise) {
    RayBatch axes;
    HitBatch hits;
    for (std::size_t first = 0; first < order_.size(); first += kLanes) {
        std::uint32_t edges = 0;
        axes.n = std::min(kLanes, order_.size() - first);
        if (noise.footprint_rad > 0) {
            for (std::size_t lane = 0; lane < axes.n; ++lane)
                axes.put(lane, in_model(T, beams_[order_[first + lane].second]));
            tracer_.intersect(at_rest_, axes, {&target_, 1}, hits);
            edges = meeting_edges(axes, hits, noise);
        }
        for (std::size_t lane = 0; lane < axes.n; ++lane)
            beams_[order_[first + lane].second].edge = is_set(edges, lane);
    }
}

/// Traces rays around the rim of each footprint and at half of its radius. A hit off the tangent plane of the
/// axis's hit, or a hit where the axis misses (or vice versa), shows an edge.
std::uint32_t BeamAssociation::meeting_edges(const RayBatch& axes, const HitBatch& met,
                                             const RangeNoise& noise) const {
    const double tangent = kWider * std::tan(0.5 * noise.footprint_rad);
    RayBatch rays;
    HitBatch hits;
    rays.n = axes.n;
    std::uint32_t edges = 0;
    for (int k = 0; k < kConeRays; ++k) {
        for (std::size_t lane = 0; lane < axes.n; ++lane) rays.put(lane, ray_in_cone(axes[lane], tangent, k));
        tracer_.intersect(at_rest_, rays, {&target_, 1}, hits);
        for (std::size_t lane = 0; lane < axes.n; ++lane) {
            const bool here = is_set(hits.met, lane), there = is_set(met.met, lane);
            const bool same =
                here == there &&
                (!here || std::abs(dot(met.geometric_normal[lane], hits.position[lane] - met.position[lane])) <
                              kOnPlane * noise.range_m / scale_);
            edges |= same ? 0u : 1u << lane;
        }
    }
    return edges;
}

Vec3 BeamAssociation::trace_around(const Rigid3& T, const Beam& beam, double radius_m, HitBatch& hits) const {
    const Ray axis = in_model(T, beam);
    const Vec3 point = axis.origin + beam.range_m / scale_ * axis.direction;
    const Vec3& d = axis.direction;
    const Vec3 across = normalized(std::abs(d.x) < 0.7 ? cross(d, Vec3{1, 0, 0}) : cross(d, Vec3{0, 1, 0}));
    const Vec3 other = cross(d, across);
    RayBatch rays;
    rays.n = kLanes;
    for (std::size_t k = 0; k < kLanes; ++k) {
        const auto& [u, v] = disc()[k];
        rays.put(k, {axis.origin, normalized(point + radius_m / scale_ * (u * across + v * other) - axis.origin)});
    }
    tracer_.intersect(at_rest_, rays, {&target_, 1}, hits);
    return point;
}

void BeamAssociation::around_beams(const Rigid3& T, double search_m, std::size_t stride,
                                   std::vector<PointToPlane>& out) const {
    HitBatch hits;
    for (std::size_t i = 0; i < beams_.size(); i += stride) {
        const Vec3 point = trace_around(T, beams_[i], search_m, hits);
        PointToPlane& p = out.emplace_back();
        double nearest = std::numeric_limits<double>::infinity();
        for_each_lane(hits.met, [&](std::size_t lane) {
            const Vec3 away = scale_ * (point - hits.position[lane]);
            if (!(dot(away, away) < nearest)) return;
            nearest = dot(away, away);
            p.fate = BeamClass::met;
            p.surface_m = scale_ * hits.position[lane];
            p.normal = hits.geometric_normal[lane];
            p.distance_m = dot(p.normal, away);
        });
        // Beside the model a tangent plane would not hold the point laterally: use the distance to the nearest hit.
        if (nearest > 0 && p.fate == BeamClass::met && !is_set(hits.met, 0)) {
            p.distance_m = std::sqrt(nearest);
            p.normal = (scale_ * point - p.surface_m) / p.distance_m;
        }
    }
}

bool BeamAssociation::may_be_on_other_surface(const Rigid3& T, const RangeNoise& noise, double radius_m,
                                              std::size_t i, const PointToPlane& p) const {
    const Beam& beam = beams_[i];
    const Vec3 direction = conjugate(T.q) * beam.direction;
    HitBatch hits;
    const Vec3 point = trace_around(T, beam, radius_m, hits);
    bool elsewhere = false;
    for_each_lane(hits.met, [&](std::size_t lane) {
        const Vec3 normal = hits.geometric_normal[lane];
        const double cosine = std::abs(dot(normal, direction));
        if (dot(normal, p.normal) > kOtherSurface || cosine < kGrazingCosine) return;
        const double distance_m = scale_ * dot(normal, point - hits.position[lane]);
        elsewhere |= std::abs(distance_m) < kOnOther * range_sigma_m(beam, noise) * cosine;
    });
    return elsewhere;
}

Vector6 BeamAssociation::derivative(const Rigid3& T, std::size_t i, const PointToPlane& p) const {
    // The surface moves with the target: a rotation w and a translation d of the pose move it by turn (w x q s +
    // d).
    const Vec3 turning = T.q * cross(p.surface_m, p.normal);
    const Vec3 normal = T.q * p.normal;
    const Vec3 shifting = turning_ ? beams_[i].turn * normal : normal;
    Vector6 J;
    J << -turning.x, -turning.y, -turning.z, -shifting.x, -shifting.y, -shifting.z;
    return J;
}

}  // namespace narpa
