/// tracking/stereo_tracker.h - the pose of a target from one pair of frames to the next, of two cameras that expose
/// at the same time, with the truth beside it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "estimator/stereo/stereo_alignment.h"
#include "protocols/ledger.h"
#include "tracking/target_tracker.h"

namespace narpa {

/// A frame as a camera put it out.
struct TakenFrame {
    const FrameLedger& ledger;
    std::span<const std::uint8_t> bytes;
};

/// Mid-exposures of a pair differ by at most this.
inline constexpr std::int64_t kSimultaneous_ns = 10'000;

/// Errors: one camera twice; cameras on different bodies, at one place, or with a rolling shutter.
[[nodiscard]] Status check_stereo(const World& world, std::size_t left, std::size_t right);

/// The cameras and frames of a pair.
struct StereoImages {
    StereoPair pair;
    MeasuredImage left, right;
};
/// Errors: exposures at different times, bytes that are not the camera's, a part of the image or binned pixels.
[[nodiscard]] Result<StereoImages> stereo_images(const World& world, std::size_t left_camera,
                                                 std::size_t right_camera, const TakenFrame& left,
                                                 const TakenFrame& right, const BodyPoses& at);

class StereoTracker {
public:
    /// `world` outlives it. Errors: those of check_stereo; no such target, no body to estimate; a search. Options
    /// of methods for frames of one camera have no effect.
    static Result<std::unique_ptr<StereoTracker>> create(const World& world, std::size_t left, std::size_t right,
                                                         const TrackerOptions& options);

    [[nodiscard]] std::size_t target() const noexcept { return target_; }

    /// The pose is in the left camera's frame. `at`: where the bodies were in mid-exposure; of it only the cameras'
    /// own poses are used, and the truth for the first guess and the errors. Runs on the calling thread's TBB
    /// arena.
    TrackedFrame take(const TakenFrame& left, const TakenFrame& right, const BodyPoses& at);
    /// Cameras and images of the last pair; none where it could not be read.
    [[nodiscard]] const std::optional<StereoImages>& images() const noexcept { return images_; }

private:
    StereoTracker(const World& world, std::size_t left, std::size_t right, std::size_t target,
                  const TrackerOptions& options);
    void measure(const Quat& q_frame_chaser, TrackedFrame& out);
    /// The chaser is the body that carries the cameras, or the left camera itself.
    [[nodiscard]] Rigid3 T_chaser_camera() const;

    const World& world_;
    std::size_t left_, right_, target_;
    TargetTracker tracker_;
    StereoAlignment alignment_;
    std::optional<StereoImages> images_;
};

}  // namespace narpa
