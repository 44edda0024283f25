/// estimator/dense/dense_alignment.h - the pose at which the rendered image is the measured one.
///
/// Render and compare, dense: Levenberg-Marquardt on the photometric residuals of all pixels about the target
/// (photometric_fit.h) with the analytic derivative of the render (image_derivative.h), robust (Cauchy), coarse to
/// fine. Each level sees a part of the image that holds the target and some room to move. The image is rendered
/// anew at each step with the same seed, so that the noise of its samples hardly changes from step to step, and
/// with the rays of a budget where the edges are, so that it stays below the sensor's.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "estimator/dense/photometric_fit.h"

namespace narpa {

/// What the rays of the last step bring, measured on the docking scene twelve and sixty metres off with frames that
/// have nothing but the detector's noise, as RMS error over the bound: 64 rays a pixel 3 to 5.5, 512 rays 1.5
/// to 1.6. Its many details smaller than a pixel ask for them; a smooth body comes to the bound with 100. Frames of
/// 16 samples a pixel have more noise of their own than that: with their variance told, 128 rays come to the bound.
struct DenseOptions {
    ExposurePrior exposure{};
    double cauchy = 3;             ///< in standard deviations, where residuals begin to lose their say
    double sigmas = 0.2;           ///< converged: the step is less than so many standard deviations of the pose
    int iterations = 16;           ///< at most, on each level
    int coarsest = 8, finest = 1;  ///< sensor pixels, each way, in a pixel of the first and of the last level
    double rays_per_pixel = 16;    ///< of the finest level's images, on average over pixels that show the target;
                                   ///< those of the last step take eight times as many
    int fineness = 6;              ///< of the last derivative: rays each way in a pixel where the light changes
    RenderSettings::Method method = RenderSettings::Method::direct;
    int max_depth = 8;  ///< of method path
    std::uint64_t seed = 1;
};
/// Errors name the field, what it is and what it may be.
[[nodiscard]] Status check(const DenseOptions& options);

enum class DenseStatus : std::uint8_t {
    converged,
    out_of_steps,      ///< still moving after the last iteration that was allowed
    diverged,          ///< no step made it better, or the target went behind the camera
    does_not_fit,      ///< it settled, but residuals are many times their noise: a false minimum or a wrong model
    left_the_picture,  ///< at the guess or at a step the target is not in the image
    too_few_pixels,    ///< what is seen does not tell all six
};
[[nodiscard]] std::string_view name(DenseStatus status) noexcept;

struct DenseStep {
    int factor = 1;     ///< of the level: sensor pixels, each way, in one of its pixels
    double cost = 0;    ///< robust, in units of this level's residual scale, a pixel
    double sigmas = 0;  ///< length of the step that led here, in standard deviations of the pose
    Rigid3 T_camera_body{};
    bool better = false;  ///< the step was taken
};

struct DenseEstimate {
    DenseStatus status = DenseStatus::converged;
    Rigid3 T_camera_body{};
    Matrix6 covariance = Matrix6::Zero();  ///< PhotometricEquations::pose_covariance; zero unless it settled
    Exposure exposure{};
    double residual_scale = 1;  ///< median residual over what noise makes of it, at least 1
    double chi2_per_pixel = 0;  ///< about 1 where the model holds
    std::size_t pixels = 0;     ///< of the last level that tell of the target
    std::vector<DenseStep> steps;
    double render_ms = 0, derivative_ms = 0, solve_ms = 0;
};

class DenseAlignment {
public:
    /// `render_scene` outlives it; `target`: index of the body whose pose is looked for.
    DenseAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target);
    ~DenseAlignment();

    /// `at`: where every body is at the time of the frame; the target's attitude there tells how the light falls on
    /// it, its position and the camera's do not matter. `frame_variance`: DN^2 that the frame has beside the
    /// sensor's noise, or empty. Memory is kept from frame to frame as far as the target's place in the image
    /// allows. Errors: sizes, options or a guess that cannot be used.
    [[nodiscard]] Result<DenseEstimate> align(const MeasuredImage& frame, const BodyPoses& at,
                                              const Rigid3& T_camera_body_guess, const DenseOptions& options,
                                              std::span<const float> frame_variance = {});

    /// The least covariance that an unbiased estimate from one frame of this pose can have (Cramer, Rao): the
    /// inverse of sum g g' / s^2, s^2 the sensor's and the frame's as in `align`, with the exposure as unknown as
    /// the options have it. The information in the noise's own strength is left out: it is less by the number of
    /// electrons in a pixel.
    [[nodiscard]] Result<Matrix6> bound(const BodyPoses& at, const Rigid3& T_camera_body,
                                        const DenseOptions& options, std::span<const float> frame_variance = {});

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace narpa
