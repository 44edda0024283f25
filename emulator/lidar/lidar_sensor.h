/// emulator/lidar/lidar_sensor.h - a LiDAR in the loop: packets from its unit to sinks at the instrument's own
/// rate.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "base/spsc_ring.h"
#include "drivers/lidar/packet_sink.h"
#include "emulator/lidar/lidar_unit.h"
#include "emulator/log/histogram.h"
#include "emulator/log/sweep_log.h"
#include "emulator/sensor_kind.h"
#include "emulator/sinks.h"
#include "protocols/lidar_beam.h"

namespace narpa {

struct LidarStats {
    std::uint64_t packets = 0;
    std::uint64_t skipped = 0;  ///< never fired: the sensor was more than kMaxLagNs behind
    std::uint64_t late = 0;     ///< sent after the next packet was complete
    std::uint64_t shots = 0, returns = 0;
    Histogram wake_late, fire, hand_over;  ///< after it was due; duration; from due to sent
};

class McapSource;

class LidarSensor final : public Sensor {
public:
    using OnPacket = std::function<void(const LidarUnit&, std::int64_t packet)>;
    /// `log_shots`, `on_packet`: RunOptions; both need the truth of each shot.
    LidarSensor(const World& world, std::size_t lidar, std::vector<std::unique_ptr<PacketSink>> sinks,
                bool log_shots = false, OnPacket on_packet = {});

    /// Keeps each shot's report for send_telemetry. At most kMaxBeams_hz shots a second.
    void keep_beams() noexcept { keeps_beams_ = true; }
    static constexpr double kMaxBeams_hz = 1000;

    [[nodiscard]] std::string_view kind() const noexcept override { return "lidar"; }
    [[nodiscard]] std::string_view name() const noexcept override { return unit_.lidar().name; }
    [[nodiscard]] SensorThread thread() const noexcept override { return {"narpa-lidar", 55, false}; }
    [[nodiscard]] std::vector<std::string> outputs() const override;
    /// Sweeps, and shots where it was made to log them.
    Status log_to(const std::string& folder, bool wait_when_full) override;
    void record_to(McapLog& log) override;
    void start_at(std::int64_t t_ns) noexcept override;
    /// All shots of the packet come before it is complete.
    [[nodiscard]] std::int64_t last_pose_ns() const noexcept override { return due_ns() - 1; }
    /// When the packet is complete and goes out.
    [[nodiscard]] std::int64_t due_ns() const noexcept override { return unit_.t_sent_ns(next_); }
    void warm_up() override { unit_.fire(next_); }
    void make_next(const Clock& clock) override;
    void send_telemetry(CanNode& can, std::int64_t t_ns, Heartbeat& faults) noexcept override;
    [[nodiscard]] std::uint64_t drops() const noexcept override;
    [[nodiscard]] std::uint64_t made() const noexcept override { return stats_.packets; }
    Status finish() override;
    [[nodiscard]] nlohmann::json report() const override;
    [[nodiscard]] std::string to_text(bool lockstep) const override;

    /// In the scene.
    [[nodiscard]] std::size_t index() const noexcept { return lidar_; }
    [[nodiscard]] const LidarStats& stats() const noexcept { return stats_; }
    [[nodiscard]] double sweeps() const noexcept {
        return static_cast<double>(stats_.packets) * static_cast<double>(unit_.packet_period_ns()) * 1e-9 *
               unit_.spec().rate_hz;
    }
    [[nodiscard]] const std::vector<std::unique_ptr<PacketSink>>& sinks() const noexcept { return sinks_; }
    /// For the run that follows; this one has ended.
    [[nodiscard]] std::vector<std::unique_ptr<PacketSink>> take_sinks() noexcept { return std::move(sinks_); }

    static constexpr std::int64_t kMaxLagNs = 100'000'000;

private:
    const World& world_;
    std::uint8_t lidar_;  ///< index in the scene
    LidarUnit unit_;
    std::vector<std::unique_ptr<PacketSink>> sinks_;
    [[nodiscard]] std::uint64_t lost() const noexcept;
    void report_beams() noexcept;

    std::int64_t next_ = 0;
    LidarStats stats_;
    std::unique_ptr<SweepLog> log_;  ///< null without a log
    McapSource* mcap_ = nullptr;
    bool logs_shots_;
    OnPacket on_packet_;
    bool keeps_beams_ = false;
    SpscRing<LidarBeamReport, 1024> beams_;
    std::uint64_t beams_lost_ = 0;  ///< the CAN thread did not keep up
};

/// SensorKind::open.
Status open_lidars(const World& world, const RunOptions& options, OpenSensors& out);
/// An Error unless each shot of this LiDAR can be reported on the run's CAN bus. `file`: the scene's.
[[nodiscard]] Status check_beams_on_can(const Lidar& lidar, bool has_bus, const std::string& file);

}  // namespace narpa
