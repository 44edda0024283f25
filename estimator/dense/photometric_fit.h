/// estimator/dense/photometric_fit.h - a measured image against the expected one: residuals, their weights, and the
/// normal equations of the pose with exposure and black level projected out.
///
/// I(x) = black + gain * S(x; pose) + offset + noise. Each pixel weighs 1 / s^2, s^2 = the sensor's variance at the
/// DN expected + gain^2 times the expected image's own variance + what is known of the frame's. Gain and offset are
/// known beforehand to some sigma and otherwise free: their rows are eliminated (Schur complement), so that the
/// pose's step and covariance are those that remain when they are not known.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "estimator/dense/image_derivative.h"

namespace narpa {

/// All of one camera, row-major, width x height.
struct PhotometricImages {
    int width = 0, height = 0;
    std::span<const float> measured;           ///< DN
    std::span<const float> measured_variance;  ///< DN^2 beside the sensor's noise; empty: none
    std::span<const float> signal;             ///< expected DN above black, not clipped
    std::span<const float> signal_variance;    ///< of its own noise, DN^2; empty: none
    std::span<const PixelDerivative> derivative;
    double pixels_averaged = 1;  ///< each pixel is the mean of so many of the sensor's
};

struct Exposure {
    double gain = 1, offset_dn = 0;
};
/// Standard deviations of what is known of the exposure beforehand: gain 1, offset 0. Zero: exactly so.
struct ExposurePrior {
    double gain_sigma = 0.05, offset_sigma_dn = 2;
};

struct PhotometricCost {
    double robust = 0;  ///< sum of Cauchy's loss, (k s)^2 ln(1 + (r / k s)^2), of normalised residuals, + prior
    double chi2 = 0;    ///< of the same pixels, plain
    std::size_t pixels = 0;  ///< that tell of the target: where it shines or a derivative is
};

/// `scale`: residuals are so many times as large as their noise (1: the model holds); `cauchy`: in units of that,
/// where a residual begins to lose its say; infinite: least squares.
/// `model_dn2`: variance that the model itself may be off by, the same in all pixels.
struct Robustness {
    double scale = 1, cauchy = 3, model_dn2 = 0;
};

/// Median absolute residual of pixels that tell of the target, as the standard deviation of normal ones; at
/// least 1.
[[nodiscard]] double residual_scale(const PhotometricImages& images, const SensorModel& sensor,
                                    const Exposure& exposure, double model_dn2);
[[nodiscard]] PhotometricCost cost(const PhotometricImages& images, const SensorModel& sensor,
                                   const Exposure& exposure, const ExposurePrior& prior, const Robustness& robust);

/// Mean square of the signal where there is any, DN^2.
[[nodiscard]] double signal_power(const PhotometricImages& images);
/// By how many pixels (right, down) the expected image lies best on the measured one: least squares over all shifts
/// of up to `most` pixels each way.
[[nodiscard]] std::array<int, 2> best_shift(const PhotometricImages& images, const SensorModel& sensor, int most);

/// Gauss-Newton's equations in pose (0..5), gain (6), offset (7): information * step = gradient.
struct PhotometricEquations {
    Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 1> gradient = Eigen::Matrix<double, 8, 1>::Zero();
    /// Covariance of the gradient as the residuals themselves tell it, and the prior.
    Eigen::Matrix<double, 8, 8> scatter = Eigen::Matrix<double, 8, 8>::Zero();

    /// What is known of the pose where the exposure is not.
    [[nodiscard]] Matrix6 pose_information() const;
    [[nodiscard]] Vector6 pose_gradient() const;
    /// What noise makes of the pose: the inverse of the information where residuals are as small as their noise, or
    /// smaller; else by their own scatter (P. J. Huber, "The behavior of maximum likelihood estimates under
    /// nonstandard conditions", 5th Berkeley Symposium, 1967), which holds whatever makes them so large as long as
    /// it is not common to many pixels.
    [[nodiscard]] Matrix6 pose_covariance() const;
    /// The exposure's step that goes with a step of the pose.
    [[nodiscard]] Eigen::Vector2d exposure_step(const Vector6& pose_step) const;
};
[[nodiscard]] PhotometricEquations equations(const PhotometricImages& images, const SensorModel& sensor,
                                             const Exposure& exposure, const ExposurePrior& prior,
                                             const Robustness& robust);

}  // namespace narpa
