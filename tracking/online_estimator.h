/// tracking/online_estimator.h - estimates poses during a run from the frames of one camera: `narpa run
/// --estimate`.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/spsc_ring.h"
#include "emulator/frame_observer.h"
#include "emulator/log/row_log.h"
#include "estimator/features/feature_matcher.h"
#include "tracking/frame_tracker.h"

namespace narpa {

class McapSource;

class OnlineEstimator final : public FrameObserver {
public:
    OnlineEstimator(std::unique_ptr<FrameTracker> tracker, const World& world, std::size_t camera, bool lockstep);

    [[nodiscard]] std::string_view name() const noexcept override { return "estimate"; }
    [[nodiscard]] std::string description() const override;
    [[nodiscard]] std::size_t camera() const noexcept override { return index_; }
    /// CAMERA.estimate.csv, and after the run CAMERA.estimate.png.
    Status log_to(const std::string& folder, bool wait_when_full) override;
    void record_to(McapLog& log) override;
    void observe(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) override;
    void send_telemetry(CanNode& can, std::int64_t t_ns) noexcept override;
    Status finish() override;
    [[nodiscard]] nlohmann::json report(std::uint64_t skipped) const override;
    [[nodiscard]] std::string to_text(std::uint64_t skipped) const override;

    /// After the run; the first kMaxKept frames.
    [[nodiscard]] const std::vector<TrackedFrame>& frames() const noexcept { return frames_; }

    static constexpr std::size_t kMaxKept = 100'000;

private:
    void record(const TrackedFrame& tracked, std::int64_t t_publish_ns);

    std::unique_ptr<FrameTracker> tracker_;
    std::size_t index_;
    std::string camera_, target_, title_;
    std::string camera_frame_, target_frame_;
    McapSource* mcap_ = nullptr;
    std::uint16_t estimate_channel_ = 0, pose_channel_ = 0;
    /// In real time: OpenCV's workers with the sensors' priority would delay the sensors.
    std::optional<SingleThreadedOpenCv> single_threaded_;
    SpscRing<EstimateReport, 64> reports_;
    std::vector<TrackedFrame> frames_;
    std::string stem_;
    std::unique_ptr<RowLog> log_;
};

/// For RunOptions::observers. `camera`: its name; empty: the first that has a sink. `made`: if not null, set to the
/// estimator, which lives as long as the run's Emulator.
[[nodiscard]] OpenFrameObserver estimate_from(const std::string& camera, const TrackerOptions& options,
                                              const OnlineEstimator** made = nullptr);

}  // namespace narpa
