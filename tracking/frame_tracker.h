/// tracking/frame_tracker.h - the pose of a target from frame to frame, as a navigation computer would know it,
/// with the truth beside it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "emulator/world.h"
#include "estimator/filter/pose_filter.h"
#include "estimator/method/camera_method.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "protocols/estimate.h"
#include "protocols/ledger.h"

namespace narpa {

struct DenseOptions;
class PoseSearch;

struct TrackerOptions {
    std::string target;  ///< name of the body; empty: the first with a mesh that does not carry the camera
    const CameraMethod* method = &camera_methods().front();  ///< those that can start from where features lead
    double start_deg = 2, start_percent = 2;  ///< how far the first guess is off: attitude, and part of the range
    bool search = false;       ///< without an initial pose, from a range known to 30 % (estimator/search)
    double range_guess_m = 0;  ///< for the search; 0: the truth, off by up to 30 %, or the guess
    /// T_camera_target of the first frame where there is no truth. The target's pose in `at` then only gives its
    /// illumination and the range of a search. Dense and search take the illumination from the camera's attitude
    /// instead.
    std::optional<Rigid3> guess{};
    ModelUncertainty model{};
    /// Standard deviation of further noise of the frames, besides the detector's, for the methods that compare
    /// pixels; 0: none, as with a real camera. Empty: unknown, as with renders of few samples.
    std::optional<double> frame_noise_dn{};
    std::uint64_t seed = 1;  ///< of the first guess's direction
    int spp = 4;             ///< of the renders that frames are compared with
    /// Process noise of the relative motion, beyond a constant velocity and rate: power spectral densities, m^2
    /// s^-3 and rad^2 s^-3. The defaults suit a chaser that brakes with some cm s^-2.
    double acceleration_psd = 1e-3, angular_acceleration_psd = 1e-5;
};

/// The body whose pose is estimated by a sensor on the body `mount`. Errors list the names of all bodies.
[[nodiscard]] Result<std::size_t> target_of(const World& world, int mount, std::string_view sensor,
                                            const std::string& name);
/// The truth displaced by the start errors of the options, in directions drawn at random.
[[nodiscard]] Rigid3 displaced_truth(const Rigid3& truth, const TrackerOptions& options, std::mt19937_64& random);

/// The result of one frame. Poses are T_camera_target, errors and covariances as in estimator/pose/pose_estimate.h.
struct TrackedFrame {
    std::uint32_t frame = 0;
    std::int64_t t_ns = 0;
    EstimateState state = EstimateState::lost;
    std::string why;                                ///< why the frame gave no pose
    Answer answer;                                  ///< of this frame alone
    Rigid3 truth{};                                 ///< with TrackerOptions::guess: the given pose
    Rigid3 guess{};                                 ///< the pose of the first render
    std::optional<Rigid3> measured;                 ///< by this frame alone, where the answer is usable
    Matrix6 covariance = Matrix6::Zero();           ///< of `measured`
    Matrix6 covariance_of_model = Matrix6::Zero();  ///< its part by the model's uncertainty
    Matrix6 bound = Matrix6::Zero();  ///< Cramer-Rao, for the sensor's noise and the method's measurements
    Rigid3 filtered{};                ///< by all frames so far; where the state is not lost
    Matrix6 filtered_covariance = Matrix6::Zero();
    double nis = 0;   ///< normalised innovation squared of `measured`; 0 for the first
    double ms = 0;    ///< wall time that the frame took
    int matches = 0;  ///< points, or pixels
    int renders = 0;  ///< of the model

    [[nodiscard]] EstimateReport report(std::uint8_t camera) const;
};

class FrameTracker {
public:
    /// `world` outlives it. Errors: no such target, no body to estimate, options.
    static Result<std::unique_ptr<FrameTracker>> create(const World& world, std::size_t camera,
                                                        const TrackerOptions& options);
    ~FrameTracker();

    [[nodiscard]] std::size_t target() const noexcept { return target_; }
    [[nodiscard]] const TrackerOptions& options() const noexcept { return options_; }

    /// Takes a frame as the camera put it out, with the exposure and gain of its ledger; a frame of a part of the
    /// image or of binned pixels gives no pose. `at`: where the bodies were; of it only the light on the target,
    /// the bodies beside it, the camera's own attitude during the exposure, and the truth for the errors are used.
    /// Until a frame has given a pose, guesses are the truth displaced as the options state, or each frame is
    /// searched. Runs on the calling thread's TBB arena.
    TrackedFrame take(const FrameLedger& ledger, std::span<const std::uint8_t> bytes, const BodyPoses& at);

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
    /// The pose is accurate enough to start an alignment of a render.
    [[nodiscard]] bool is_tracked(const Quat& q_frame_chaser) const;
    /// The chaser is the body that carries the camera, or the camera itself.
    [[nodiscard]] Rigid3 T_chaser_camera() const { return camera_.mount < 0 ? Rigid3{} : camera_.T_mount_camera; }

    const World& world_;
    Camera camera_;
    std::size_t index_, target_;
    TrackerOptions options_;
    std::mt19937_64 random_;
    std::unique_ptr<FrameEstimator> estimator_;
    std::unique_ptr<PoseSearch> search_;  ///< where the options ask for it
    PoseTracker tracker_;
    /// Of the newest measurement that the filter took. This part is common to all measurements, so the filter must
    /// not average it.
    Matrix6 covariance_of_model_ = Matrix6::Zero();
};

}  // namespace narpa
