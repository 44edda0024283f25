/// estimator/dense/photometric_fit.h - photometric residuals between a measured and a predicted image, their
/// weights, and the normal equations of the pose with gain and offset marginalised.
///
/// I(x) = black + gain * S(x; pose) + offset + noise. Each pixel weighs 1 / s^2, s^2 = the sensor's variance at the
/// predicted DN + gain^2 times the variance of the prediction + the frame's own variance + that of the model's
/// error. Gain and offset have Gaussian priors and are eliminated by the Schur complement.
///
/// A clipped pixel is a lower limit of the light: its residual is what the prediction is too dark by, and it says
/// nothing where the prediction is as bright (censored data; J. Tobin, Econometrica 26, 1958). Predictions are
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

/// All of one camera, row-major, width x height.
struct PhotometricImages {
    int width = 0, height = 0;
    const SensorModel& sensor;
    std::span<const float> measured;           ///< DN; empty: as predicted, and clipped (the bound)
    std::span<const float> measured_variance;  ///< DN^2 beside the sensor's noise; empty: none
    std::span<const float> signal;             ///< predicted DN above black, not clipped
    std::span<const float> signal_variance;    ///< of its own noise, DN^2; empty: none
    std::span<const PixelDerivative> derivative;
    double pixels_averaged = 1;  ///< each pixel is the mean of so many of the sensor's
    ExposurePrior prior{};
    std::span<const std::uint8_t> measured_clipped{};  ///< MeasuredImage::clipped; empty: nowhere
    /// Not 0: pixels that hold the pose (informative_pixels). The others have no derivative and fewer samples;
    /// gain, offset and the size of the residuals follow from all. Empty: all.
    std::span<const std::uint8_t> chosen{};
    double model_part = 0;  ///< standard deviation of the prediction's model error, as a part of the signal
};

struct PhotometricCost {
    double robust = 0;  ///< sum of Cauchy's loss, (k s)^2 ln(1 + (r / k s)^2), of normalised residuals, + prior
    double chi2 = 0;    ///< of the same pixels, plain
    std::size_t pixels = 0;      ///< that show the target: signal or Jacobian not zero
    std::size_t all_pixels = 0;  ///< that `robust` is the sum of

    PhotometricCost& operator+=(const PhotometricCost& b);
    /// `robust` beyond that of noise, with the default Robustness.
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
    /// Empirical covariance of the gradient, from the residuals, and the prior: of pixels that are independent, and
    /// of blocks of pixels whose residuals share an error of the model.
    Eigen::Matrix<double, 8, 8> scatter = Eigen::Matrix<double, 8, 8>::Zero();
    Eigen::Matrix<double, 8, 8> block_scatter = Eigen::Matrix<double, 8, 8>::Zero();

    PhotometricEquations& operator+=(const PhotometricEquations& b);
    /// Information of the pose with gain and offset marginalised.
    [[nodiscard]] Matrix6 pose_information() const;
    /// The least eigenvalue of the pose's information, scaled to a unit diagonal, is not that of rounding.
    [[nodiscard]] bool observes_pose() const;
    [[nodiscard]] Vector6 pose_gradient() const;
    /// Inverse information where residuals are no larger than their noise; else the sandwich estimator (P. J.
    /// Huber, "The behavior of maximum likelihood estimates under nonstandard conditions", 5th Berkeley Symposium,
    /// 1967), of independent pixels or of blocks (K.-Y. Liang, S. Zeger, Biometrika 73, 1986), whichever is larger.
    [[nodiscard]] Matrix6 pose_covariance() const;
    /// Size of the residuals of the pixels that hold the pose, over that which noise makes: root of the mean of
    /// their squares, weighed by information.
    [[nodiscard]] double residual() const;
    /// Step of the pose that answers a change of the measured image whose `response` this is.
    [[nodiscard]] Vector6 pose_step(const Eigen::Matrix<double, 8, 1>& response) const;
    /// Step of gain and offset for a step of the pose (back substitution).
    [[nodiscard]] Eigen::Vector2d exposure_step(const Vector6& pose_step) const;
};
/// Without `scatter` that is the prior's alone, and it takes a third of the time: for steps.
[[nodiscard]] PhotometricEquations equations(const PhotometricImages& images, const Exposure& exposure,
                                             const Robustness& robust, bool scatter = true);
/// The fewest pixels that together hold this part of the information about the pose, all motions alike: those of
/// the largest leverage (D. C. Hoaglin, R. E. Welsch, The American Statistician 32, 1978), at the noise of sensor
/// and frame. Does not depend on the measured image but by what of it is clipped.
[[nodiscard]] std::vector<std::uint8_t> informative_pixels(const PhotometricImages& images,
                                                           const Exposure& exposure, double part);
/// By how many standard deviations the residuals show a blur that the prediction does not have (negative: one that
/// it has too much of): the score of the blur's variance at zero (C. R. Rao, Proc. Cambridge Phil. Soc. 44, 1948),
/// with pose, gain and offset unknown. Its own variance is the sum of its squared terms, so that noise of another
/// size than expected changes nothing. `fit`: the equations there, of least squares at the noise (Robustness{1,
/// inf, 0}).
[[nodiscard]] double blur_score(const PhotometricImages& images, const Exposure& exposure,
                                const PhotometricEquations& fit);
/// The gradient that a change of the predicted signal, DN, of each pixel would make, were it the measured image's.
[[nodiscard]] Eigen::Matrix<double, 8, 1> response(const PhotometricImages& images, const Exposure& exposure,
                                                   const Robustness& robust, std::span<const float> change);

}  // namespace narpa
