/// tracking/frame_tracker.h - the pose of a target from a camera's frame to frame, as a navigation computer would
/// know it, with the truth beside it.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "protocols/ledger.h"
#include "tracking/target_tracker.h"

namespace narpa {

struct DenseOptions;
class PoseSearch;

/// Sets exposure and gain of an operated camera to those of a frame. An Error where the frame is a part of the
/// image or of binned pixels.
[[nodiscard]] Status set_to_frame(const FrameLedger& ledger, const Camera& as_in_the_scene, Camera& camera);

class FrameTracker {
public:
    /// `world` outlives it. Errors: no such target, no body to estimate, options.
    static Result<std::unique_ptr<FrameTracker>> create(const World& world, std::size_t camera,
                                                        const TrackerOptions& options);
    ~FrameTracker();

    [[nodiscard]] std::size_t target() const noexcept { return target_; }
    [[nodiscard]] const TrackerOptions& options() const noexcept { return tracker_.options(); }

    /// Takes a frame as the camera put it out, with the exposure and gain of its ledger; a frame of a part of the
    /// image or of binned pixels gives no pose. `at`: where the bodies were; of it only the light on the target,
    /// the bodies beside it, the camera's own attitude during the exposure, and the truth for the errors are used.
    /// Until a frame has given a pose, guesses are the truth displaced as the options state, or each frame is
    /// searched. Runs on the calling thread's TBB arena.
    TrackedFrame take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at);
    /// Points that the pose of the last frame rests on; null: the method finds none.
    [[nodiscard]] const PointObservations* points() const noexcept { return estimator_->points(); }

private:
    FrameTracker(const World& world, std::size_t camera, std::size_t target, const TrackerOptions& options);
    /// Sets `camera_` to the settings of the frame. An Error where its pixels are not the scene's.
    [[nodiscard]] Status set(const FrameLedger& ledger);
    /// Motion of the target in camera axes during the exposure, from the filter and the camera's own attitude; 0
    /// without a shutter.
    [[nodiscard]] ApparentMotion motion(const FrameLedger& ledger, const BodyPoses& at, const Rigid3& guess) const;
    [[nodiscard]] bool searches() const;  ///< the next frame is searched: there is no pose yet
    void measure(const FrameInput& frame, const Rigid3& T_world_camera, TrackedFrame& out);
    /// Without a guess. Assumes that the target stands still during the exposure.
    void measure_by_search(const FrameInput& frame, const Rigid3& T_world_camera, TrackedFrame& out);
    /// Of the search and its bound.
    [[nodiscard]] DenseOptions dense_options() const;
    [[nodiscard]] std::vector<float> frame_variance() const;  ///< of each pixel; empty: not known
    /// The chaser is the body that carries the camera, or the camera itself.
    [[nodiscard]] Rigid3 T_chaser_camera() const { return camera_.mount < 0 ? Rigid3{} : camera_.T_mount_camera; }

    const World& world_;
    Camera camera_;
    std::size_t index_, target_;
    TargetTracker tracker_;
    std::unique_ptr<FrameEstimator> estimator_;
    std::unique_ptr<PoseSearch> search_;  ///< where the options ask for it
};

}  // namespace narpa
