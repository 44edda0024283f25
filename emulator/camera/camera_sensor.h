/// emulator/camera/camera_sensor.h - a camera in the loop: frames from its unit to sinks, logs, ledgers and
/// estimator.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/spsc_ring.h"
#include "drivers/video/video_sink.h"
#include "emulator/camera/camera_control.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/log/contact_sheet.h"
#include "emulator/log/histogram.h"
#include "emulator/log/row_log.h"
#include "emulator/sensor_kind.h"
#include "emulator/sinks.h"

namespace narpa {

struct CameraStats {
    std::uint64_t frames = 0;       ///< exposed
    std::uint64_t handed_over = 0;  ///< taken by a sink
    std::uint64_t not_taken = 0;    ///< dropped by all sinks at once, counted there
    std::uint64_t skipped = 0;      ///< never exposed: the one before took too long
    std::uint64_t deadline_missed = 0;
    std::uint64_t stale = 0;                               ///< frames that show a body without a fresh command
    std::uint64_t repeated = 0, blanked = 0;               ///< handed over in place of late frames
    std::uint64_t ledgers_lost = 0, states_lost = 0;       ///< the CAN thread did not keep up
    std::array<std::uint64_t, kStepNames.size()> steps{};  ///< frames by the step that they reached
    Histogram wake_late, render, hand_over;  ///< after it was due; duration; from mid-exposure to hand-over
    Histogram radiance, sensor, send;        ///< durations of parts of a frame
    SignedHistogram late;  ///< from deadline to hand-over, or to the end of a late frame that is dropped
    Histogram error_1e9, samples_1e3;  ///< expected error, 1e-9 of full scale; samples per pixel, 1e-3
};

class McapSource;

class CameraSensor final : public Sensor {
public:
    /// `late_max`: RunOptions::late_max.
    CameraSensor(const World& world, std::size_t camera, std::vector<std::unique_ptr<VideoSink>> sinks,
                 std::optional<double> late_max = {});

    /// Keeps each frame's ledger for send_telemetry.
    void keep_ledgers() noexcept { keeps_ledgers_ = true; }
    /// Gives each frame that is handed over to this feed too, which must outlive the run.
    void feed(FrameFeed& feed) { feeds_.push_back(&feed); }

    [[nodiscard]] std::string_view kind() const noexcept override { return "camera"; }
    [[nodiscard]] std::string_view name() const noexcept override { return unit_.camera().name; }
    [[nodiscard]] SensorThread thread() const noexcept override { return {"narpa-camera", 50, true}; }
    [[nodiscard]] std::vector<std::string> outputs() const override { return descriptions(sinks_); }
    /// Truth (trajectory CSV), ledger (CSV) and contact sheet.
    Status log_to(const std::string& folder, bool wait_when_full) override;
    void record_to(McapLog& log) override;
    void start_at(std::int64_t t_ns) noexcept override;
    void plan() noexcept override;
    [[nodiscard]] std::int64_t schedule_holds_ns() const noexcept override {
        return control_ ? 500'000 : Sensor::schedule_holds_ns();
    }
    /// The middle of the next exposure; its end where the camera has a shutter. Clock::kNever: nothing triggers it.
    [[nodiscard]] std::int64_t last_pose_ns() const noexcept override {
        return unit_.camera().shutter ? due_ns() : t_mid_ns_;
    }
    /// The end of the next exposure.
    [[nodiscard]] std::int64_t due_ns() const noexcept override {
        return t_mid_ns_ == Clock::kNever ? t_mid_ns_ : t_mid_ns_ + (unit_.exposure_ns() + 1) / 2;
    }
    /// Two frames of maximum work, the faster of which calibrates the renderer; then one as in the run, which
    /// measures the time from radiance to hand-over.
    void warm_up() override;
    void make_next(const Clock& clock) override;
    /// Keeps ledgers.
    void connect(CanNode& can) override;
    void send_telemetry(CanNode& can, std::int64_t t_ns, Heartbeat& faults) noexcept override;
    [[nodiscard]] std::uint64_t drops() const noexcept override;
    [[nodiscard]] std::uint64_t made() const noexcept override { return stats_.frames; }
    [[nodiscard]] std::string progress() const override;
    [[nodiscard]] std::string failure() const override;
    [[nodiscard]] std::string advice() const override;
    Status finish() override;
    [[nodiscard]] nlohmann::json report() const override;
    [[nodiscard]] std::string to_text(bool lockstep) const override;

    /// In the scene.
    [[nodiscard]] std::size_t index() const noexcept { return index_; }
    [[nodiscard]] const CameraUnit& unit() const noexcept { return unit_; }
    /// Null where the scene has no `control`.
    [[nodiscard]] CameraControl* control() noexcept { return control_ ? &*control_ : nullptr; }
    [[nodiscard]] const CameraControl* control() const noexcept { return control_ ? &*control_ : nullptr; }
    [[nodiscard]] const CameraStats& stats() const noexcept { return stats_; }
    [[nodiscard]] const std::vector<std::unique_ptr<VideoSink>>& sinks() const noexcept { return sinks_; }
    /// For the run that follows; this one has ended.
    [[nodiscard]] std::vector<std::unique_ptr<VideoSink>> take_sinks() noexcept { return std::move(sinks_); }
    SpscRing<FrameLedger, 64>& ledgers() noexcept { return ledgers_; }

private:
    /// Hands over the frame just rendered, by the late policy, and completes its ledger.
    void hand_over(FrameLedger& ledger, const Clock& clock) noexcept;
    /// Deadline of the next frame's hand-over: the end of the time budget, or the middle of the exposure after it.
    [[nodiscard]] std::int64_t deadline_ns() const noexcept;
    /// The next frame was exposed or skipped. `level`: CameraControl::advance.
    void advance(std::optional<double> level) noexcept;
    [[nodiscard]] Delivery deliver(const FrameLedger& ledger) noexcept;
    /// False: no sink took it.
    bool send(std::span<const std::uint8_t> bytes, const FrameStamp& stamp) noexcept;
    void take_requests(CanNode& can, std::int64_t t_ns) noexcept;
    void account(const FrameLedger& ledger) noexcept;
    /// Skips the frames whose successors are due already: the stream keeps step with the clock.
    void skip_missed(const Clock& clock) noexcept;
    void log(const FrameLedger& ledger) noexcept;

    const World& world_;
    std::size_t index_;
    CameraUnit unit_;
    std::vector<std::unique_ptr<VideoSink>> sinks_;
    std::optional<CameraControl> control_;
    std::uint32_t next_ = 0;
    std::int64_t t_mid_ns_ = 0;        ///< of the next frame
    std::vector<std::uint8_t> spare_;  ///< `repeat`: the last frame in time; `blank`: black; else empty
    SpscRing<FrameLedger, 64> ledgers_;
    SpscRing<CameraState, 64> states_;  ///< of a camera that is operated
    bool keeps_ledgers_ = false;
    std::uint8_t requests_ = 0;  ///< made by readers so far; used by the CAN thread
    std::vector<FrameFeed*> feeds_;
    McapSource* mcap_ = nullptr;
    CameraStats stats_;
    /// What `progress` shows of the last frame and of all.
    struct Shown {
        std::atomic<std::uint64_t> late{0}, skipped{0};
        std::atomic<float> samples_per_pixel{0}, expected_error{-1};
    } shown_;
    const std::optional<double> late_max_;  ///< RunOptions::late_max

    std::string folder_;
    std::unique_ptr<RowLog> truth_log_, ledger_log_;
    std::unique_ptr<ContactSheet> sheet_;
};

/// SensorKind::open.
Status open_cameras(const World& world, const RunOptions& options, OpenSensors& out);

}  // namespace narpa
