/// protocols/can/messages/lidar_beam.h - one shot of a LiDAR: what velocimeters and altimeters report.
#pragma once

#include "protocols/can/codec.h"
#include "protocols/lidar_beam.h"

namespace narpa {

inline constexpr std::uint32_t kLidarBeamBaseId = 0x7A0;
inline constexpr std::array<std::string_view, 4> kLidarBeamFrames{"LidarBeamNumber", "LidarBeamTime",
                                                                  "LidarBeamRange", "LidarBeamVelocity"};
inline constexpr auto kLidarBeamSignals = place_fd_signals(std::to_array<Signal>({
    {"Lidar", "", "Index of the LiDAR in the scene", 1, false, {0, 0, 8}},
    {"Beam", "", "Number of the beam", 1, false, {0, 8, 16}},
    {"Time", "ns", "Time of the shot: simulation clock modulo 2^48 ns", 1, false, {1, 0, 48}},
    {"Range", "m", "Range along the beam; not available: no echo", 1e6, true, {2, 0, 48}},
    {"Velocity", "m/s", "Radial velocity, receding is positive; not available: none", 1e6, true, {3, 0, 48}},
}));
inline constexpr SetLayout kLidarBeamLayout =
    describe_set("LidarBeam", "LiDAR beam", "Measurement of one shot of a LiDAR", kLidarBeamBaseId, kFromNarpa,
                 kLidarBeamFrames, kLidarBeamSignals);

template <>
struct Codec<LidarBeamReport> {
    static constexpr const SetLayout& layout = kLidarBeamLayout;
    static void fields(auto& m, const auto& each) noexcept {
        each(m.lidar, m.beam, m.t_ns, m.range_m, m.velocity_m_s);
    }
    /// Range and velocity may be missing.
    static DecodeStatus check(const RawSignals& raw) noexcept { return check_signals(layout.signals, raw, true); }
};

}  // namespace narpa
