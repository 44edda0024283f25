/// estimator/dense/dense_alignment.h - dense photometric pose estimation by rendering and comparing.
///
/// Levenberg-Marquardt on the photometric residuals of all pixels about the target (photometric_fit.h) with the
/// analytic Jacobian of the rendered image (image_derivative.h), Cauchy loss, coarse to fine over an image pyramid.
/// Each level works in a window about the target. The image is rendered at each step with the same seed, so that
/// its sampling noise hardly changes between steps.
///
/// The last steps use only the pixels that hold most of the information about the pose (informative_pixels), about
/// an eighth. They are chosen by a derivative with few lines, and all get equally many samples, so that each one's
/// variance is known from its own samples. With a sample budget that follows the contrast between pixels, residuals
/// at details smaller than a pixel were 1.7 times their stated noise.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/result.h"
#include "estimator/dense/level_view.h"
#include "estimator/dense/model_suspects.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/model_uncertainty.h"

namespace narpa {

class LevelSolver;

/// RMS error over the bound, docking scene at 16.6 m in 320 x 240 pixels, frames of 64 samples a pixel whose
/// variance is given: 1.6 in attitude and 0.8 in position (4 frames). The scene has many details smaller than a
/// pixel.
struct DenseOptions {
    int iterations = 16;            ///< at most, on each level
    int coarsest = 16, finest = 1;  ///< sensor pixels per pixel of the first and the last level, each way
    int samples_per_pixel = 8;      ///< of the finest level's images; the last steps take 6 or 8 times as many
    int fineness = 4;               ///< lines each way across a pixel, for the last derivative
    RenderSettings::Method method = RenderSettings::Method::direct;
    int max_depth = 8;  ///< of method path
    std::uint64_t seed = 1;
    ApparentMotion motion{};   ///< the target's, in camera axes: during the exposure, for cameras with a shutter
    GuessError guess_error{};  ///< answers further from the guess are refused
    ModelUncertainty model{};
    /// The camera's pose in the world, if the light is known in camera axes: the pose then determines the target's
    /// attitude relative to the light, so that its shading holds information about the attitude. Empty: the light
    /// is known in target axes, from the target's attitude in `at`.
    std::optional<Rigid3> T_world_camera{};
    /// Largest number of mirrored starts; 0: no test. An answer is accepted if two starts lead to it: the guess,
    /// and the guess mirrored in the first answer. This approaches false minima, and valleys in which steps end
    /// early, from both sides. If the answer is far from the guess, the guess without the coarsest levels must not
    /// lead to a better one.
    int rivals = 2;
    /// Largest accepted residual (DenseEstimate::residual): if the model is exact and the frame's noise given, or
    /// the size of the details that are lacking is told; if the noise is estimated; if the model is not exact.
    double residual_max = 1.15, residual_max_noise_estimated = 1.3, residual_max_model_inexact = 6;
};

enum class DenseStatus : std::uint8_t {
    converged,
    out_of_steps,      ///< still moving after the last iteration
    diverged,          ///< no step reduces the cost, or the target is behind the camera
    does_not_fit,      ///< converged, but residuals are many times their noise: a false minimum or a wrong model
    left_the_picture,  ///< at the guess or at a step the target is not in the image
    too_few_pixels,    ///< the pose is not observable
};
[[nodiscard]] std::string_view name(DenseStatus status) noexcept;

struct DenseEstimate {
    DenseStatus status = DenseStatus::converged;
    Rigid3 T_camera_body{};
    /// PhotometricEquations::pose_covariance, widened where renders show a weaker response to the least observed
    /// motions than the Jacobian predicts (response.h), plus the model's uncertainty; zero unless converged.
    Matrix6 covariance = Matrix6::Zero();
    Matrix6 covariance_of_model = Matrix6::Zero();  ///< part of the model's uncertainty
    Exposure exposure{};
    std::size_t pixels = 0;  ///< pixels of the last level that show the target
    std::size_t chosen = 0;  ///< of these, pixels that the last steps use
    int renders = 0;         ///< images compared with the frame
    double misfit = 0;       ///< loss beyond that of noise, per target pixel: Robustness{1, 3, 0}
    /// RMS residual over that expected from noise: of the target's pixels, or of those that determine the pose
    /// (PhotometricEquations::residual), whichever is larger. If the frame's noise is estimated or details are
    /// lacking: of the latter with Cauchy's weights, as some details smaller than a pixel have far more noise than
    /// stated.
    double residual = 0;
    /// Factor by which a chi-square of the residuals is too large, if they are not independent: where the model
    /// lacks details; else 1.
    double overconfidence = 1;
    double excess_loss = 0;  ///< loss beyond that of noise, sum over `window`, about a chi-square
    Window window{};         ///< of the last level
    /// PhotometricImages::sampling_factor with the samples of the last image; 1 if the frame's noise is known.
    double sampling_factor = 1;
    /// Tests for errors of the model, of answers that pass all others.
    std::vector<Suspicion> suspicions{};
    Answer answer;

    /// Without the part of the model's uncertainty.
    [[nodiscard]] Matrix6 covariance_of_image() const { return covariance - covariance_of_model; }
};

class DenseAlignment {
public:
    /// `render_scene` outlives it; `target`: index of the body whose pose is estimated.
    DenseAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target);
    DenseAlignment(const DenseAlignment&) = delete;
    DenseAlignment& operator=(const DenseAlignment&) = delete;

    /// `at`: poses of all bodies in the middle of the exposure; the target's attitude determines its illumination,
    /// its position and the camera's are not used. `frame_variance`: DN^2 of the frame in addition to the sensor's
    /// noise, zeros for a real sensor; empty: there is more noise, and it is not known. Memory is kept between
    /// frames while the target's window stays. Errors: sizes, options or a guess that is unusable.
    [[nodiscard]] Result<DenseEstimate> align(const MeasuredImage& frame, const BodyPoses& at,
                                              const Rigid3& T_camera_body_guess, const DenseOptions& options,
                                              std::span<const float> frame_variance = {});

    /// Exposure and gain of the frames from now on.
    void set_detector(const Detector& detector);

    /// The input checks of `align`.
    [[nodiscard]] Status check(const MeasuredImage& frame, std::span<const float> frame_variance,
                               const BodyPoses& at, const Rigid3& guess) const;

    /// Cramer-Rao bound of the pose from one frame: the inverse of sum g g' / s^2, s^2 the sensor's and the frame's
    /// variance as in `align`, with the priors of the exposure. The information in the variance itself is left out:
    /// it is smaller by the number of electrons in a pixel.
    [[nodiscard]] Result<Matrix6> bound(const BodyPoses& at, const Rigid3& T_camera_body,
                                        const DenseOptions& options, std::span<const float> frame_variance = {});

private:
    /// What align() was given.
    struct Measured {
        const MeasuredImage& frame;
        const BodyPoses& at;
        std::span<const float> variance;
    };
    /// `last`: factor of the last level; if coarser than the finest, only the pose is computed.
    [[nodiscard]] DenseEstimate descend(const Measured& m, const Rigid3& guess, const DenseOptions& options,
                                        int last);
    [[nodiscard]] bool has_independent_noise() const;
    void test_by_mirrored_starts(const Measured& m, const Rigid3& guess, const DenseOptions& options,
                                 DenseEstimate& e, Fit& fit);
    [[nodiscard]] bool is_near(const DenseOptions& options, const Rigid3& guess, DenseEstimate& e);
    [[nodiscard]] bool converges_to(DenseEstimate& e, DenseEstimate& other, const DenseOptions& options);
    void descend_and_compare(const Measured& m, const DenseOptions& options, const Rigid3& start, DenseEstimate& e,
                             Fit& fit);
    void test_by_start_near(const Measured& m, const Rigid3& guess, const DenseOptions& options, DenseEstimate& e,
                            Fit& fit);
    void test_model(const Measured& m, const DenseOptions& options, DenseEstimate& e, Fit& fit);
    [[nodiscard]] std::string solve_shown(LevelSolver& solver, bool lacks_details, DenseEstimate& e) const;
    void keep_guess_where_unobserved(const Measured& m, const Rigid3& guess, const DenseOptions& options,
                                     DenseEstimate& e, Fit& fit);
    void test_weak_motions(const Measured& m, const DenseOptions& options, DenseEstimate& e, Fit& fit);
    /// Evaluates both losses over the same pixels: those about either pose.
    void evaluate_losses_on_common_pixels(const Measured& m, const DenseOptions& options, DenseEstimate& a,
                                          DenseEstimate& b);
    LevelView& level(int factor, const Camera& camera, const Window& window, const Measured& m,
                     const DenseOptions& options);

    const RenderScene& render_scene_;
    Camera camera_;
    const std::size_t target_;
    SensorModel sensor_;  ///< the levels refer to it
    RowTimes times_;
    std::array<std::optional<LevelView>, 7> levels_{};  ///< by the logarithm of their factor
    std::array<bool, 7> hold_frame_{};                  ///< the levels that hold this frame
};

}  // namespace narpa
