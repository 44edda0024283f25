/// estimator/cloud/range_points.h - a LiDAR's sweep as measurements.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa {

struct Lidar;
struct Scene;

/// One return, in the LiDAR's frame: the beam as it was fired and the range that was read.
struct RangePoint {
    Vec3 origin_m{};     ///< where the beam starts
    Vec3 direction{};    ///< unit
    double range_m = 0;  ///< along the beam, > 0
    double t_s = 0;      ///< when it was fired, relative to the time of the pose
    double sigma_m = 0;  ///< standard deviation of the range; 0: RangeNoise::range_m
    /// Shifts of the range by one standard deviation of each error that all points of the sweep have in common.
    std::array<double, 2> common_m{};

    [[nodiscard]] Vec3 position_m() const { return origin_m + range_m * direction; }
};

/// A fired beam without return.
struct EmptyBeam {
    Vec3 origin_m{}, direction{};  ///< as RangePoint
    double t_s = 0;
};

struct LidarSweep {
    std::vector<RangePoint> points;
    std::vector<EmptyBeam> empty;  ///< only from packets that report them

    void clear() { points.clear(), empty.clear(); }
};

/// An Error at a beam that is not finite, whose direction is not of unit length, or whose range is not positive.
[[nodiscard]] Status check_sweep(std::span<const RangePoint> points, std::span<const EmptyBeam> empty);

/// Standard deviations of a return. With the angle of incidence i, the error along the surface's normal is
/// sqrt((range cos i)^2 + (distance * pointing * sin i)^2): the effect of pointing and footprint width on the range
/// grows as tan i.
struct RangeNoise {
    double range_m = 0.02;         ///< including the rounding in the packet: resolution / sqrt(12)
    double pointing_rad = 5.1e-5;  ///< of the beam's direction: an azimuth rounded to 0.01 deg
    /// Full angle of the beam. Where a surface ends within it, the range is that of the part hit, or a mean of two
    /// surfaces: such points are left out. 0: an ideal line.
    double footprint_rad = 0;
};

/// Noise of a LiDAR's returns as its scene models it; where the scene models none, the defaults above.
[[nodiscard]] RangeNoise range_noise_of(const Lidar& lidar);

/// Limits within which a surface of the model certainly has a return, unless the LiDAR loses it by chance.
struct CertainReturn {
    double nearest_m = 0, farthest_m = 0;  ///< equal: nowhere
    double min_light_1_m2 = 0;             ///< reflectivity / range^2 along the beam (renderer/lidar/lidar_shot.h)
};

/// For surfaces that reflect a third of what the scene's materials do. If the scene states no detection limit: that
/// of a surface of 10 % at half of the largest range. Nowhere in an atmosphere, whose absorption is unknown.
[[nodiscard]] CertainReturn certain_return_of(const Lidar& lidar, const Scene& scene);

/// Decodes packets of one unit into sweeps.
class SweepReader {
public:
    explicit SweepReader(const LidarModel& unit)
        : unit_(unit), points_(unit.spec().points_per_packet), empty_(unit.spec().shots_per_packet) {}

    /// Appends the content of a data packet. `packet_after_ns`: time of the packet's first shot minus the time of
    /// the pose.
    void append(std::span<const std::uint8_t> packet, std::int64_t packet_after_ns, LidarSweep& out);

private:
    const LidarModel& unit_;
    std::vector<LidarPoint> points_;
    std::vector<LidarAxis> empty_;
};

}  // namespace narpa
