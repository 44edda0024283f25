/// estimator/view/measured_image.h - a camera's frame in digital numbers, and the noise model of its pixels.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/radiance_image.h"
#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// One value for each pixel, row-major, height x width: linear, in the digital numbers of SensorModel.
struct MeasuredImage {
    int width = 0, height = 0;
    std::vector<float> dn;
    /// Not 0 where a value that the pixel is made of may have been clipped (SensorModel::clips_dn): the light was
    /// at least what `dn` says. Empty: nowhere.
    std::vector<std::uint8_t> clipped{};

    [[nodiscard]] std::size_t index(int x, int y) const {
        return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
    }
    [[nodiscard]] float at(int x, int y) const { return dn[index(x, y)]; }
};

/// From radiance to digital numbers: DN = black + sum over bands of dn_per_radiance * L, clipped to 0 .. top, with
/// the variance of read noise, shot noise and rounding. Of the camera's detector (renderer/detector/detector.h), or
/// of an ideal sensor without one. In DN of the converter, whatever bits of it the format keeps.
struct SensorModel {
    std::array<double, 3> dn_per_radiance{};  ///< DN per W m^-2 sr^-1 in the red, green, blue band
    double black_dn = 0;                      ///< without light: the black level and the mean dark current
    double top_dn = 255;                      ///< largest value of a pixel: full well or end of the converter
    double clips_dn = 255;                    ///< least value of a saturated pixel, with its read noise
    double read_dn2 = 0;                      ///< variance without light: read noise, dark current, DSNU
    double shot_dn = 0;                       ///< variance per DN above black; 0: no shot noise
    double prnu2 = 0;                         ///< variance per square of the DN above black
    double rounding_dn2 = 0;                  ///< variance of rounding to the format's step: step^2 / 12

    [[nodiscard]] double signal(const Rgb& radiance) const;  ///< expected DN above black, not clipped
    [[nodiscard]] double dn(const Rgb& radiance) const;      ///< expected, at most top_dn
    [[nodiscard]] double variance_dn2(double expected_dn) const;
};

/// RGB24 is read as the mean of its bands, YUYV as its luma. With a Bayer mosaic each pixel is the weighted mean of
/// 3 x 3, a quarter of red and blue and half of green; their noise is correlated, and the variance is that of white
/// noise with the same mean over many pixels. Hot, dead and blinking pixels, cosmic rays and blooming are not
/// modelled.
[[nodiscard]] SensorModel sensor_model(const Camera& camera);

/// A frame's bytes in the camera's format (renderer/detector/detector.h) as DN, with a mask of pixels that may be
/// clipped (YUYV: by luma). With an embedded line the image has one row fewer, as the last holds no light. Errors:
/// the number of bytes is not the format's.
[[nodiscard]] Result<MeasuredImage> measured_image(const Camera& camera, std::span<const std::uint8_t> bytes);

/// The DN above black that measured_image would read of this radiance, without noise, clipping and embedded line.
[[nodiscard]] std::vector<float> expected_signal(const Camera& camera, const RadianceImage& radiance);

/// An Error if the image does not have the camera's size, less the embedded line, or has a pixel that is not
/// finite. `what`: name of the image for the message.
[[nodiscard]] Status check_image(const Camera& camera, const MeasuredImage& image, const std::string& what);

/// A pyramid level: the same camera with 1 / factor of the pixels each way. Incomplete pixels at the right and
/// bottom are left out.
[[nodiscard]] Camera coarser_camera(const Camera& camera, int factor);
/// Means over factor x factor pixels: the image of coarser_camera, with 1 / factor^2 of the variance. Clipped where
/// one of them is.
[[nodiscard]] MeasuredImage coarser_image(const MeasuredImage& image, int factor);
/// Variances, DN^2, of the pixels of coarser_image, from those of the camera's independent pixels; empty if
/// `variance` is.
[[nodiscard]] std::vector<float> coarser_variance(std::span<const float> variance, const Camera& camera,
                                                  int factor);

}  // namespace narpa
