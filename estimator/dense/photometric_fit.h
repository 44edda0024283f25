/// estimator/dense/photometric_fit.h - photometric residuals between a measured and a predicted image, their
/// weights, and the normal equations of the pose with gain and offset marginalised.
///
/// I(x) = black + gain * S(x; pose) + offset + noise. Each pixel weighs 1 / s^2, s^2 = the sensor's variance at the
/// predicted DN + gain^2 times the variance of the prediction + the frame's own variance + that of the model's
/// error. Gain and offset have Gaussian priors and are eliminated by the Schur complement.
///
/// A clipped pixel is a lower limit of the light: its residual is the amount by which the prediction is too dark,
/// and none where the prediction is as bright (censored data; J. Tobin, Econometrica 26, 1958). Predictions are
/// never clipped, so a dark pixel cannot be explained by light beyond the end of the scale.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/dense/image_derivative.h"

namespace narpa {

struct Exposure {
    double gain = 1, offset_dn = 0;
};
/// Prior standard deviations about gain 1 and offset 0. Zero: exact.
struct ExposurePrior {
    double gain_sigma = 0.05, offset_sigma_dn = 2;
};

/// Images of one camera, row-major, width x height.
struct PhotometricImages {
    int width = 0, height = 0;
    const SensorModel& sensor;
    std::span<const float> measured;           ///< DN; empty: as predicted, and clipped (for the bound)
    std::span<const float> measured_variance;  ///< DN^2 beside the sensor's noise; empty: none
    std::span<const float> signal;             ///< predicted DN above black, not clipped
    std::span<const float> signal_variance;    ///< of the prediction's sampling noise, DN^2; empty: none
    std::span<const PixelDerivative> derivative;
    double pixels_averaged = 1;  ///< number of sensor pixels averaged in each pixel
    ExposurePrior prior{};
    std::span<const std::uint8_t> measured_clipped{};  ///< MeasuredImage::clipped; empty: nowhere
    /// Mask: not 0 for the pixels that determine the pose (informative_pixels). The others have no derivative and
    /// fewer samples; gain, offset and the residuals' scale use all. Empty: all.
    std::span<const std::uint8_t> chosen{};
    /// Mask: not 0 for pixels that are not compared. Empty: none.
    std::span<const std::uint8_t> ignored{};
    /// Sampling variance of prediction and frame over `signal_variance`: 1 where the frame's is in
    /// `measured_variance` (sampling_noise.h).
    double sampling_factor = 1;
    double model_part = 0;  ///< standard deviation of the prediction's model error, as a part of the signal
    /// Variance of the details that the model lacks, which neighbouring pixels share, in all pixels; 0: none.
    double detail_dn2 = 0;
};

struct PhotometricCost {
    double robust = 0;  ///< sum of Cauchy's loss, (k s)^2 ln(1 + (r / k s)^2), of normalised residuals, + prior
    double chi2 = 0;    ///< sum of squared residuals of the same pixels
    std::size_t pixels = 0;      ///< that show the target: signal or Jacobian not zero
    std::size_t all_pixels = 0;  ///< that `robust` is the sum of

    PhotometricCost& operator+=(const PhotometricCost& b);
    /// `robust` minus its expected value for noise, with the default Robustness.
    [[nodiscard]] double excess() const;
};

/// `scale`: size of the residuals in units of their noise (1: the model holds); `cauchy`: scale of the loss in
/// units of that; infinite: least squares. `model_dn2`: variance of the model error, the same in all pixels.
struct Robustness {
    double scale = 1, cauchy = 3, model_dn2 = 0;
};

/// Standard deviation of normalised residuals of the target's pixels by their median absolute deviation; at
/// least 1.
[[nodiscard]] double residual_scale(const PhotometricImages& images, const Exposure& exposure, double model_dn2);
[[nodiscard]] PhotometricCost cost(const PhotometricImages& images, const Exposure& exposure,
                                   const Robustness& robust);

/// Mean square of the signal where there is any, DN^2.
[[nodiscard]] double signal_power(const PhotometricImages& images);
/// The shift (right, down) of the predicted image that fits the measured one best: least squares over all shifts of
/// up to `most` pixels each way.
[[nodiscard]] std::array<int, 2> best_shift(const PhotometricImages& images, int most);

/// Gauss-Newton's equations in pose (0..5), gain (6), offset (7): information * step = gradient.
struct PhotometricEquations {
    Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 1> gradient = Eigen::Matrix<double, 8, 1>::Zero();
    /// Empirical covariance of the gradient, from the residuals, plus the prior: for independent pixels, and for
    /// blocks of pixels whose residuals share a model error: of 8 x 8, or of the size that makes it largest if the
    /// model lacks details.
    Eigen::Matrix<double, 8, 8> scatter = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 8> block_scatter = Eigen::Matrix<double, 8, 8>::Zero();
    /// Mean second derivative of the loss over its weight, as the pixels determine the pose: the gradient changes
    /// by this part of what `information` says, where weights fall as residuals rise. 1 for least squares.
    double curvature = 1;

    PhotometricEquations& operator+=(const PhotometricEquations& b);
    /// Information of the pose with gain and offset marginalised.
    [[nodiscard]] Matrix6 pose_information() const;
    /// True if the least eigenvalue of the pose's information, scaled to a unit diagonal, is above rounding.
    [[nodiscard]] bool observes_pose() const;
    [[nodiscard]] Vector6 pose_gradient() const;
    /// Variance of the pose over that of the inverse information, mean of all unknowns; at least 1.
    [[nodiscard]] double overconfidence() const;
    /// Inverse information where residuals are no larger than their noise; else the sandwich estimator (P. J.
    /// Huber, "The behavior of maximum likelihood estimates under nonstandard conditions", 5th Berkeley Symposium,
    /// 1967), of independent pixels or of blocks (K.-Y. Liang, S. Zeger, Biometrika 73, 1986), whichever is larger,
    /// over the square of the curvature.
    [[nodiscard]] Matrix6 pose_covariance() const;
    /// RMS residual over that expected from noise, weighted by the pixels' information about the pose.
    [[nodiscard]] double residual() const;
    /// Step of the pose for a change of the measured image with this `response`.
    [[nodiscard]] Vector6 pose_step(const Eigen::Matrix<double, 8, 1>& response) const;
    /// Step of gain and offset for a step of the pose (back substitution).
    [[nodiscard]] Eigen::Vector2d exposure_step(const Vector6& pose_step) const;
};
/// scatter = false: the scatter is the prior's alone, which takes a third of the time; sufficient for steps.
[[nodiscard]] PhotometricEquations equations(const PhotometricImages& images, const Exposure& exposure,
                                             const Robustness& robust, bool scatter = true);
/// The fewest pixels that together hold this part of the information about the pose, all motions alike: those of
/// the largest leverage (D. C. Hoaglin, R. E. Welsch, The American Statistician 32, 1978), at the noise of sensor
/// and frame. Depends on the measured image only through its clipped pixels.
[[nodiscard]] std::vector<std::uint8_t> informative_pixels(const PhotometricImages& images,
                                                           const Exposure& exposure, double part);
/// Gradient that results if the measured image changes by `change`, DN of predicted signal per pixel.
[[nodiscard]] Eigen::Matrix<double, 8, 1> response(const PhotometricImages& images, const Exposure& exposure,
                                                   const Robustness& robust, std::span<const float> change);

}  // namespace narpa
