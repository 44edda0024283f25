/// protocols/lidar/pattern_lidar.h - a LiDAR described by data: any instrument that repeats one pattern of shots
/// from one point. A flash LiDAR, a raster scanner, a spinning one and a velocimeter differ in their shots alone.
///
/// Frame f starts f periods, in whole nanoseconds, after simulation time 0; its packets (point_packet.h) are sent
/// evenly over the frame, each as soon as its shots are fired.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa {

struct PatternShot {
    double azimuth_rad = 0, elevation_rad = 0;  ///< clockwise from y; above the plane of x and y
    double phase = 0;                           ///< share of the frame's period at which it fires, in [0, 1)
    int beam = 0;                               ///< 0 to 65535
};

struct LidarPattern {
    std::string name;
    double rate_hz_min = 0, rate_hz_max = 0, rate_hz_default = 0;  ///< frames a second
    double range_m_default = 0;                                    ///< the rated range
    double range_resolution_m = 1e-3;                              ///< whole micrometres
    double velocity_resolution_m_s = 0;  ///< whole micrometres a second; 0: velocities are not measured
    bool dual = false;
    double latency_s = 0;  ///< from a packet's last shot until it is sent
    std::uint16_t data_port = 2370;
    std::vector<PatternShot> shots;  ///< of a frame, in firing order
    LidarField lit{};                ///< by each pulse

    static constexpr std::size_t kMaxShots = 1'000'000;
    /// Most for the frame and the latency together, because poses are kept for about this long.
    static constexpr double kLongest_s = 0.9;
};

/// Errors, without file: which member is outside of its limits, which shot is out of order.
[[nodiscard]] Result<LidarMake> make_of(std::shared_ptr<const LidarPattern> pattern);

}  // namespace narpa
