/// rehearsal/navigation/sensor_receiver.h - real time: reads the sources, keeps the newest frames and packets, and
/// finds the exposure time of each frame.
#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "base/stop.h"
#include "rehearsal/navigation/bus_link.h"
#include "rehearsal/navigation/sensor_inputs.h"

namespace narpa::rehearsal {

/// One thread a source.
class SensorReceiver {
public:
    /// Both outlive it.
    SensorReceiver(SensorInputs& inputs, const SceneModel& model);
    ~SensorReceiver();
    SensorReceiver(const SensorReceiver&) = delete;
    SensorReceiver& operator=(const SensorReceiver&) = delete;

    /// Frame notices from the bus, and simulation clock minus CLOCK_MONOTONIC.
    void update(const std::vector<FrameNotice>& notices, std::int64_t offset_ns);

    struct Frame {
        std::int64_t t_mid_ns = 0;
        std::vector<std::uint8_t> bytes;
    };
    /// The newest frame exposed at t_ns or before, unless it was returned before. `camera`: in the scenario's
    /// order.
    [[nodiscard]] std::optional<Frame> newest_frame(std::size_t camera, std::int64_t t_ns);
    /// Points of the turn that ends at t_ns; false: its last packet has not come.
    [[nodiscard]] bool turn(std::size_t lidar, std::int64_t t_ns, std::vector<RangePoint>& out);
    [[nodiscard]] std::uint64_t frames() const;

private:
    struct Arrived {
        std::int64_t t_arrived_ns = 0;  ///< CLOCK_MONOTONIC
        std::vector<std::uint8_t> bytes;
    };
    struct CameraState {
        std::deque<Arrived> arrived;
        std::deque<FrameNotice> notices;
        std::int64_t taken_ns = std::numeric_limits<std::int64_t>::min();
    };
    void read_frames(std::size_t i);
    void read_packets(std::size_t i);
    /// Mid-exposure, from the embedded line or from the notice whose hand-over is nearest to the arrival.
    [[nodiscard]] std::optional<std::int64_t> exposed_ns(const CameraState& state, const Camera& camera,
                                                         const Arrived& frame) const;

    SensorInputs& inputs_;
    const SceneModel& model_;
    StopFlag stop_{false};
    mutable std::mutex mutex_;  ///< guards what follows and the LiDARs' buffers
    std::vector<CameraState> cameras_;
    std::int64_t offset_ns_ = 0;
    std::uint64_t frames_ = 0;
    std::vector<std::thread> threads_;
};

}  // namespace narpa::rehearsal
