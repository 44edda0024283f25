/// emulator/online_estimator.h - estimates poses during the run from the frames of one camera. In real time it has
/// a thread of its own and skips the frames that arrive while it is busy; in lockstep it processes every frame at
/// once.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/spsc_ring.h"
#include "base/stop.h"
#include "emulator/frame_tracker.h"
#include "emulator/log/row_log.h"
#include "protocols/ledger.h"

namespace narpa {

class OnlineEstimator {
public:
    OnlineEstimator(std::unique_ptr<FrameTracker> tracker, const World& world, std::size_t camera, bool lockstep);

    /// Writes CAMERA.estimate.csv and CAMERA.estimate.png to this folder.
    Status log_to(const std::string& folder);
    /// Keeps reports for the CAN thread.
    void keep_reports() noexcept { keeps_reports_ = true; }

    /// From the camera's thread. In real time: copies the frame if the estimator is idle; never waits. In lockstep:
    /// processes the frame before it returns.
    void take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at);
    /// The estimator's thread: processes frames until `stop` is set and `wake` was called.
    void run(const StopFlag& stop);
    void wake() noexcept;

    SpscRing<EstimateReport, 64>& reports() noexcept { return reports_; }
    /// After the run; the first kMaxKept frames.
    [[nodiscard]] const std::vector<TrackedFrame>& frames() const noexcept { return frames_; }
    /// Frames that arrived while the estimator was busy.
    [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }
    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    Status finish();

    static constexpr std::size_t kMaxKept = 100'000;

private:
    enum Slot : int { empty, full };
    void process(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at);

    std::unique_ptr<FrameTracker> tracker_;
    Camera camera_;
    std::uint8_t index_;
    std::string target_, title_;
    bool lockstep_;
    std::atomic<int> slot_{empty};
    FrameLedger ledger_;
    std::vector<std::uint8_t> bytes_;
    BodyPoses at_;
    std::uint64_t skipped_ = 0;  ///< the camera's thread only, until the end of the run
    bool keeps_reports_ = false;
    SpscRing<EstimateReport, 64> reports_;
    std::vector<TrackedFrame> frames_;
    std::string stem_;
    std::unique_ptr<RowLog> log_;
};

}  // namespace narpa
