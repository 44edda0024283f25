/// tracking/target_tracker.h - what trackers of frames and of sweeps share: where to start, and the filter of the
/// poses.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <string_view>

#include "base/result.h"
#include "emulator/world.h"
#include "estimator/filter/pose_filter.h"
#include "estimator/method/camera_method.h"
#include "estimator/pose/apparent_motion.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "protocols/estimate.h"

namespace narpa {

struct TrackerOptions {
    std::string target;  ///< name of the body; empty: the first with a mesh that does not carry the camera
    const CameraMethod* method = &camera_methods().front();  ///< those that can start from where features lead
    double start_deg = 2, start_percent = 2;  ///< how far the first guess is off: attitude, and part of the range
    /// Each frame and sweep starts from the truth displaced, not from the filter, which a wrong model misleads.
    bool guesses_from_truth = false;
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
    double range_noise_m = 0;  ///< of a LiDAR's ranges, standard deviation; 0: that of its scene, or of RangeNoise
    std::uint64_t seed = 1;    ///< of the first guess's direction
    int spp = 4;               ///< of the renders that frames are compared with
    /// Process noise of the relative motion, beyond a constant velocity and rate: power spectral densities, m^2
    /// s^-3 and rad^2 s^-3. The defaults suit a chaser that brakes with some cm s^-2.
    double acceleration_psd = 1e-3, angular_acceleration_psd = 1e-5;
};

/// The body whose pose is estimated by a sensor on the body `mount`. Errors list the names of all bodies.
[[nodiscard]] Result<std::size_t> target_of(const World& world, int mount, std::string_view sensor,
                                            const std::string& name);
/// Covariance of displaced_truth: the directions are random.
[[nodiscard]] Matrix6 start_covariance(const TrackerOptions& options, double range_m);
/// The truth displaced by the start errors of the options, in directions drawn at random.
[[nodiscard]] Rigid3 displaced_truth(const Rigid3& truth, const TrackerOptions& options, std::mt19937_64& random);

/// The result of one frame or sweep. Poses are T_sensor_target, errors and covariances as in
/// estimator/pose/pose_estimate.h.
struct TrackedFrame {
    std::uint32_t frame = 0;  ///< its number, or that of the sweep
    std::int64_t t_ns = 0;
    EstimateState state = EstimateState::lost;
    std::string why;                                ///< why it gave no pose, or one that the filter rejected
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

    /// Takes the answer of an estimator and, where it is usable, the pose and its covariance.
    void take(const Answer& estimated, const Rigid3& pose, const Matrix6& its_covariance, const Matrix6& of_model);
    [[nodiscard]] EstimateReport report(std::uint8_t camera) const;
};

/// The target's motion relative to the chaser, the body that carries the sensor, from pose to pose. Attitudes of
/// the chaser are known exactly.
class TargetTracker {
public:
    explicit TargetTracker(const TrackerOptions& options);

    [[nodiscard]] const TrackerOptions& options() const noexcept { return options_; }
    [[nodiscard]] std::mt19937_64& random() noexcept { return random_; }
    /// There is a pose to predict from.
    [[nodiscard]] bool started() const noexcept { return tracker_.started(); }
    /// The next guess is the filter's prediction.
    [[nodiscard]] bool predicts() const noexcept { return started() && !options_.guesses_from_truth; }
    /// Requires started().
    [[nodiscard]] const PoseFilter& filter() const noexcept { return tracker_.filter(); }

    /// Predicts to this time. A target that is then known too badly to start an estimate from is lost.
    void predict(std::int64_t t_ns, const Quat& q_frame_chaser);
    /// Where an estimate starts: the prediction; before there is one the given guess, or the truth displaced.
    [[nodiscard]] Rigid3 guess(const Rigid3& T_chaser_sensor, const Quat& q_frame_chaser, const Rigid3& truth);
    /// Covariance of the guess's error, sensor axes.
    [[nodiscard]] Matrix6 guess_covariance(const Rigid3& T_chaser_sensor, const Quat& q_frame_chaser,
                                           const Rigid3& guess) const;
    /// For estimates of points: how far the guess may be off at the target's surface, whose bounding radius is
    /// `reach_m`; 0: so little that no search is needed.
    [[nodiscard]] double search_radius_m(double range_m, double reach_m) const;
    /// The target's motion in the sensor's axes during a measurement of this length about a pose in its middle, as
    /// the filter knows it. `q_frame_chaser`: at begin, middle and end.
    [[nodiscard]] ApparentMotion motion(const Rigid3& T_chaser_sensor, const Rigid3& T_sensor_target,
                                        const std::array<Quat, 3>& q_frame_chaser, double length_s) const;
    /// Updates the filter with the pose, if there is one, and sets state and filtered pose. `knows_guess`: along
    /// motions that were not observed, the pose is the guess with its covariance, from which the filter may start.
    void update(const Rigid3& T_chaser_sensor, const Quat& q_frame_chaser, bool knows_guess, TrackedFrame& out);

private:
    TrackerOptions options_;
    std::mt19937_64 random_;
    PoseTracker tracker_;
    /// Of the newest measurement that the filter took. This part is common to all measurements, so the filter must
    /// not average it.
    Matrix6 covariance_of_model_ = Matrix6::Zero();
};

}  // namespace narpa
