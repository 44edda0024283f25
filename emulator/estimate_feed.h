/// emulator/estimate_feed.h - poses estimated beside the run from the frames of one camera, on a thread of its own
/// at its own pace: what comes while it is busy is passed over. In lockstep every frame is looked at, in its turn.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/stop.h"
#include "emulator/frame_tracker.h"
#include "emulator/log/row_log.h"
#include "emulator/spsc_ring.h"
#include "protocols/ledger.h"

namespace narpa {

class EstimateFeed {
public:
    EstimateFeed(std::unique_ptr<FrameTracker> tracker, const World& world, std::size_t camera);

    /// CAMERA.estimate.csv and CAMERA.estimate.png in this folder.
    Status log_to(const std::string& folder, bool wait_when_full);
    void keep_reports() noexcept { keeps_reports_ = true; }

    /// From the camera's thread: copies the frame where the estimator waits for one, and never waits itself.
    void offer(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at) noexcept;
    /// The estimator's thread: looks at what is offered, until `stop` is set and `wake` was called.
    void run(const StopFlag& stop);
    void wake() noexcept;
    /// Looks at a frame at once: in lockstep.
    void look(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at);

    /// For the CAN thread: kept only where there is one.
    SpscRing<EstimateReport, 64>& reports() noexcept { return reports_; }
    /// After the run; of more than kMostKept frames the first.
    [[nodiscard]] const std::vector<TrackedFrame>& frames() const noexcept { return frames_; }
    [[nodiscard]] std::uint64_t passed_over() const noexcept { return passed_over_; }
    [[nodiscard]] const FrameTracker& tracker() const noexcept { return *tracker_; }
    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] const std::string& target() const noexcept { return target_; }
    Status finish();

    static constexpr std::size_t kMostKept = 100'000;

private:
    enum Slot : int { empty, full };

    std::unique_ptr<FrameTracker> tracker_;
    Camera camera_;
    std::uint8_t index_;
    std::string target_, title_;
    std::atomic<int> slot_{empty};
    FrameLedger ledger_;
    std::vector<std::uint8_t> bytes_;
    BodyPoses at_;
    std::uint64_t passed_over_ = 0;  ///< the camera's thread only, until the run is over
    bool keeps_reports_ = false;
    SpscRing<EstimateReport, 64> reports_;
    std::vector<TrackedFrame> frames_;
    std::string stem_;
    std::unique_ptr<RowLog> log_;
};

}  // namespace narpa
