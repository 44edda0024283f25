#include "estimator/cloud/range_points.h"

#include <fmt/format.h>

#include <cmath>

#include "renderer/scene/scene.h"

namespace narpa {
namespace {

template <class Beam>
Status check_beams(std::span<const Beam> beams, const char* what) {
    for (std::size_t i = 0; i < beams.size(); ++i) {
        const Beam& b = beams[i];
        if (!is_finite(b.origin_m) || !is_finite(b.direction) || !std::isfinite(b.t_s))
            return Error{fmt::format("{} {} of the sweep: origin, direction or time is not finite", what, i)};
        if (std::abs(dot(b.direction, b.direction) - 1) > 1e-6)
            return Error{fmt::format("{} {} of the sweep: expected a direction of length 1, not {:f}", what, i,
                                     norm(b.direction))};
    }
    return Ok{};
}

}  // namespace

/// Distance of the centroid of a beam's few sample rays from its axis, per axis, as a part of the beam's angle. For
/// eight rays; 32 have 0.006.
constexpr double kFootprintCentre = 0.02;

RangeNoise range_noise_of(const Lidar& lidar) {
    RangeNoise noise;
    const LidarReceiverModel& r = lidar.receiver;
    const double modelled_m = std::hypot(r.range_noise_m, r.range_noise_at_limit_m);
    if (modelled_m > 0)
        noise.range_m = std::hypot(modelled_m, lidar.model->spec().range_resolution_m / std::sqrt(12.0));
    noise.footprint_rad = r.beam_divergence_rad;
    noise.pointing_rad = std::hypot(noise.pointing_rad, kFootprintCentre * r.beam_divergence_rad);
    return noise;
}

CertainReturn certain_return_of(const Lidar& lidar, const Scene& scene) {
    if (scene.atmosphere) return {};
    /// kMaterials: uncertainty factor of the materials; kSigmas: margin of an echo above the detection limit.
    constexpr double kMaterials = 3, kSigmas = 4;
    const LidarReceiverModel& r = lidar.receiver;
    const bool stated = r.range_at_10_percent_m > 0;
    const double detected = 0.1 / std::pow(stated ? r.range_at_10_percent_m : 0.5 * lidar.range_max_m, 2);
    const double noise = std::sqrt(1 + r.sunlight_noise);  // of a white surface that faces the Sun
    const double margin = r.detection_snr > 0 ? 1 + kSigmas / r.detection_snr : 1;
    return {r.range_min_m, lidar.range_max_m, kMaterials * noise * margin * detected};
}

void SweepReader::append(std::span<const std::uint8_t> packet, std::int64_t packet_after_ns, LidarSweep& out) {
    const auto after_s = [&](std::int64_t t_offset_ns) {
        return 1e-9 * static_cast<double>(packet_after_ns + t_offset_ns);
    };
    for (const LidarPoint& p : std::span(points_).first(unit_.points(packet, points_)))
        out.points.push_back({p.origin_m, p.direction, p.range_m, after_s(p.t_offset_ns)});
    for (const LidarAxis& a : std::span(empty_).first(unit_.empty_shots(packet, empty_)))
        out.empty.push_back({a.origin_m, a.direction, after_s(a.t_offset_ns)});
}

Status check_sweep(std::span<const RangePoint> points, std::span<const EmptyBeam> empty) {
    if (auto good = check_beams(empty, "beam without return"); !good) return good;
    if (auto good = check_beams(points, "point"); !good) return good;
    for (std::size_t i = 0; i < points.size(); ++i)
        if (!(points[i].range_m > 0 && std::isfinite(points[i].range_m)))
            return Error{
                fmt::format("point {} of the sweep: expected a range > 0, not {:f} m", i, points[i].range_m)};
        else if (!(points[i].sigma_m >= 0 && std::isfinite(points[i].sigma_m)))
            return Error{fmt::format("point {} of the sweep: expected a standard deviation >= 0, not {:f} m", i,
                                     points[i].sigma_m)};
    return Ok{};
}

}  // namespace narpa
