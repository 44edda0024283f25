/// rehearsal/navigation/sensor_inputs.h - opens the sources of frames and packets that the scenario navigates by.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/lidar/packet_source.h"
#include "drivers/video/video_source.h"
#include "estimator/cloud/range_points.h"
#include "protocols/lidar/lidar_model.h"
#include "rehearsal/navigation/estimation/scene_model.h"
#include "rehearsal/navigation/node.h"
#include "renderer/scene/scene.h"

namespace narpa::rehearsal {

class SweepBuffer {
public:
    /// `epoch_unix_ns`: UTC of simulation time 0.
    SweepBuffer(const Lidar& lidar, std::int64_t epoch_unix_ns);

    /// Keeps a datagram; `reference_ns`: simulation time within half an hour of it. False, and counted as bad, if
    /// it is no data packet of the LiDAR's model.
    bool take(std::span<const std::uint8_t> bytes, std::int64_t reference_ns);
    /// True if no packet that is complete by t_ns is missing at the end.
    [[nodiscard]] bool complete_to(std::int64_t t_ns) const noexcept;
    /// The turn that ends at t_ns, from complete packets in order of arrival; times count from t_ns.
    void turn(std::int64_t t_ns, LidarSweep& out) const;

    [[nodiscard]] std::uint64_t received() const noexcept { return received_; }
    [[nodiscard]] std::uint64_t bad() const noexcept { return bad_; }

private:
    struct Packet {
        std::int64_t t_ns;  ///< of its first shot
        std::vector<std::uint8_t> bytes;
    };
    /// The packet's exact start: its time stamp is rounded down.
    [[nodiscard]] std::int64_t start_ns(std::int64_t stamp_ns) const noexcept;

    std::shared_ptr<const LidarModel> model_;
    std::int64_t turn_ns_, period_ns_, epoch_unix_ns_;
    std::deque<Packet> packets_;
    std::uint64_t received_ = 0, bad_ = 0;
};

struct CameraInput {
    std::size_t camera = 0;  ///< index in the scene
    std::unique_ptr<VideoSource> source;
    std::size_t frame_bytes = 0;
};

struct LidarInput {
    std::unique_ptr<PacketSource> source;
    SweepBuffer buffer;
};

struct SensorInputs {
    std::vector<CameraInput> cameras;  ///< in the order of the scenario's
    std::vector<LidarInput> lidars;
};

/// Errors: a source for a sensor that the scenario does not navigate by, a sensor without a source or with two, the
/// drivers'.
Result<SensorInputs> open_sensor_inputs(const Scenario& scenario, const SceneModel& model, const SourceList& video,
                                        const SourceList& lidar);

}  // namespace narpa::rehearsal
