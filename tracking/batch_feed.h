/// tracking/batch_feed.h - frames and sweeps of a logged run, tracked one after another, as the input of a batch.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "emulator/replay/sweep_replay.h"
#include "estimator/batch/batch_solver.h"
#include "tracking/frame_tracker.h"
#include "tracking/sweep_tracker.h"

namespace narpa {

/// Chaser and target, world axes, at one time.
struct ChaserSample {
    std::int64_t t_ns = 0;
    Rigid3 T_world_chaser{}, T_world_target{};
};
/// Between two samples: at a constant velocity and rate. Beyond the last: as before it.
class ChaserPath {
public:
    void add(const ChaserSample& sample) { samples_.push_back(sample); }
    /// Needs a sample.
    [[nodiscard]] BatchTime at(std::int64_t t_ns) const;

private:
    [[nodiscard]] ChaserSample between(std::int64_t t_ns) const;
    std::vector<ChaserSample> samples_;  ///< in order of time
};

/// Tracks frames of one camera. A frame enters the batch if it has a usable pose, also one that the filter rejects:
/// with a wrong model, the filter can be wrong.
class BatchFrameFeed {
public:
    /// `model`: the world as the estimator takes it to be. Outlives it. Errors: those of FrameTracker, a method
    /// that finds no points.
    /// `keeps_frames`: for observe_brightness().
    static Result<std::unique_ptr<BatchFrameFeed>> create(const World& model, std::size_t camera,
                                                          const TrackerOptions& options, bool keeps_frames);
    /// `truth`: the world of the run; `at`: its bodies; `stamp_late_ns`: error of the time stamp.
    void take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const World& truth,
              const BodyPoses& at, std::int64_t stamp_late_ns);
    /// Adds a pose of the path for a frame that is not used.
    void pass(const FrameLedger& ledger, const World& truth, const BodyPoses& at);
    [[nodiscard]] const std::vector<TrackedFrame>& tracked() const noexcept { return tracked_; }
    [[nodiscard]] std::size_t target() const noexcept { return tracker_->target(); }
    void finish(BatchInput& input);
    /// After finish(): compares the brightness of the frames with the model's, with the camera and at the poses
    /// that `found`, a solution without their brightness or with one of an earlier light, has found. With the model
    /// as it is, frame and render would be pixels apart.
    void observe_brightness(const BatchResult& found, BatchInput& input) const;

private:
    /// A frame that entered the batch.
    struct Kept {
        FrameLedger ledger;
        std::vector<std::uint8_t> bytes;
        BodyPoses at;
    };
    BatchFrameFeed(const World& model, std::size_t camera, std::unique_ptr<FrameTracker> tracker, bool keeps_frames)
        : model_(model), camera_(camera), keeps_frames_(keeps_frames), tracker_(std::move(tracker)) {}
    /// Null: no projection has these changes.
    [[nodiscard]] static std::shared_ptr<const CameraModel> corrected(const CameraModel& model, BatchValues change);

    const World& model_;
    std::size_t camera_;
    bool keeps_frames_;
    std::unique_ptr<FrameTracker> tracker_;
    std::vector<TrackedFrame> tracked_;
    std::vector<BatchFrame> frames_;
    std::vector<Kept> kept_;
    ChaserPath path_;
};

/// The same for the sweeps of a LiDAR.
class BatchSweepFeed {
public:
    /// `truth`: the world of the replay.
    static Result<std::unique_ptr<BatchSweepFeed>> create(const World& truth, const World& model, std::size_t lidar,
                                                          const TrackerOptions& options);
    /// `longer_m`: added to the ranges.
    void take(const ReplayedSweep& made, std::int64_t stamp_late_ns, double longer_m);
    [[nodiscard]] const std::vector<TrackedFrame>& tracked() const noexcept { return tracked_; }
    void finish(BatchInput& input);

private:
    BatchSweepFeed(const World& truth, const World& model, std::size_t lidar, const TrackerOptions& options,
                   std::unique_ptr<SweepTracker> tracker);
    [[nodiscard]] ChaserSample sample(std::int64_t t_ns) const;

    const World &truth_, &model_;
    std::size_t lidar_;
    RangeNoise noise_;
    std::unique_ptr<SweepTracker> tracker_;
    SweepReader reader_;
    std::vector<TrackedFrame> tracked_;
    std::vector<BatchSweep> sweeps_;
};

}  // namespace narpa
