/// bench/lidar_cost.h - time of a LiDAR's sub-rays on one core, and the range error that they leave.
///
/// One turn of the instrument is measured, from exact poses to packets, with every number of sub-rays in the same
/// run. Times are CPU times of the one thread that fires, medians over turns; all candidates take turns. Each is
/// compared with two lower bounds: the tracer's own calls on the same rays, and plain Embree calls on them
/// (raw_embree_scene.h), without processing the hits.
///
/// The error of a range is against a beam of many more sub-rays, both without receiver noise.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "emulator/world.h"

namespace narpa {

struct LidarCostSettings {
    std::size_t lidar = 0;  ///< index in the scene
    double beam_divergence_rad = 0;
    std::vector<int> sub_rays{1, 8, 16, 32, 64};
    int reference_sub_rays = 4096;
    int turns = 7;             ///< that give a median
    std::int64_t from_ns = 0;  ///< the turn's start
};

/// The error of the strongest echo's range.
struct RangeError {
    std::size_t shots = 0;          ///< that return here and in the reference
    std::size_t lost = 0;           ///< return only in the reference
    std::size_t extra = 0;          ///< return only here
    std::size_t other = 0;          ///< of `shots`, those more than a pulse's length off: of another surface
    double rms_m = 0;               ///< over all `shots`
    double same_surface_rms_m = 0;  ///< over all but `other`
    double p50_m = 0, p99_m = 0;    ///< quantiles of its absolute value
};

/// With one number of sub-rays. Times are CPU seconds of one turn.
struct LidarCostRow {
    int sub_rays = 1;
    double fire_s = 0;                 ///< from poses to packets
    double tracer_s = 0;               ///< Tracer::intersect on the rays
    std::optional<double> embree_s{};  ///< plain Embree on them; none where a body is no mesh
    RangeError error{};
};

struct LidarCost {
    std::string make;
    double rate_hz = 0, beam_divergence_rad = 0, pulse_length_m = 0;
    std::size_t packets = 0, shots = 0, returns = 0;  ///< of the turn; returns with the first row's sub-rays
    double covers_s = 0;                              ///< time in which the instrument sends them
    int reference_sub_rays = 0;
    double reference_s = 0;  ///< CPU time of the reference's turn
    std::vector<LidarCostRow> rows;

    [[nodiscard]] double shots_per_s(const LidarCostRow& r) const { return static_cast<double>(shots) / r.fire_s; }
    /// Share of one core at the instrument's own rate.
    [[nodiscard]] double load(const LidarCostRow& r) const { return r.fire_s / covers_s; }
};

/// `load`: called with the world, to load trajectories and the like. `progress` is called with each step.
[[nodiscard]] Result<LidarCost> measure_lidar_cost(Scene scene, const LidarCostSettings& settings,
                                                   const std::function<Status(World&)>& load,
                                                   const std::function<void(const std::string&)>& progress);

/// Largest allowed load of one core by a VLP-16 at up to 10 Hz.
struct LidarLoadBound {
    int sub_rays;
    double load_max;
};
inline constexpr std::array<LidarLoadBound, 2> kLidarLoadMost{{{1, 0.05}, {16, 0.25}}};
/// Bounds that are missed, one sentence each; instruments that have none have no faults.
[[nodiscard]] std::vector<std::string> lidar_cost_faults(const LidarCost& cost);

}  // namespace narpa
