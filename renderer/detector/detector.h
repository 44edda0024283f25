/// renderer/detector/detector.h - linear radiance -> electrons -> digital numbers -> the bytes of a pixel format.
///
/// Photons of band b on a pixel = pi L_b fraction_b / (4 N^2) * pitch^2 * t * lambda_b / (h c), with the band's
/// share of sunlight and its mean wavelength from solar_bands.h; losses in the lens are already applied to the
/// radiance (image_optics.h). A monochrome format (GREY, Y16) sums the bands in one pixel; a colour format (YUYV,
/// RGB24) gives each band an ideal pixel of its own; in a Bayer mosaic each pixel has the band of its filter.
/// Electrons = photons * quantum efficiency, with Poisson noise, clipped at the full well; read noise is added; DN
/// = black level + electrons / gain, rounded and clamped to 0 .. 2^bits - 1. All noise is added before rounding.
/// Signals are double, noise is single precision (noise.h); pixels without light draw their DN from a table
/// (dark_levels.h).
///
/// Dark current, differences between pixels and other stages that a scene may name are in sensor_array.h; if it
/// names none of them, none of that code runs.
///
/// DN to bytes: GREY the top 8 bits; Y16 little-endian, left-justified; Bayer mosaics the same; RGB24 the top 8
/// bits of each band; YUYV from these by BT.601, limited range, chroma averaged over each pair. Values stay linear:
/// no gamma.
#pragma once

#include <cstdint>
#include <span>

#include "base/radiance_image.h"
#include "renderer/detector/detector_settings.h"

namespace narpa {

class SensorArray;

/// Exposes the radiance image and writes the frame's bytes in `sensor.format`. Noise depends on (seed, frame,
/// pixel) and nothing else: same bytes on any number of threads and on each instruction set. Without a detector: DN
/// = full scale * radiance / white_radiance, clamped; monochrome takes the mean of the bands. `out` holds
/// frame_bytes(format) bytes, and the image's size fits the format. Allocates nothing; runs on the calling
/// thread's TBB arena. `array`: of SensorArray::create for this sensor and seed, which may be null.
void expose(const ImageSensor& sensor, const RadianceImage& radiance, std::uint64_t seed, std::uint32_t frame,
            std::span<std::uint8_t> out, SensorArray* array) noexcept;
/// The same for a single frame: creates the sensor array for it, if the detector needs one.
void expose(const ImageSensor& sensor, const RadianceImage& radiance, std::uint64_t seed, std::uint32_t frame,
            std::span<std::uint8_t> out);

/// Electrons that radiance 1 W m^-2 sr^-1 in one band (0 red, 1 green, 2 blue) collects in one exposure.
[[nodiscard]] double electrons_per_radiance(const Detector& detector, int band) noexcept;

/// Mean electrons of dark current in one exposure, for a pixel without a defect.
[[nodiscard]] double dark_electrons(const Detector& detector) noexcept;
/// Time for which dark current would flow at the reference temperature to give the charge of one exposure.
[[nodiscard]] double dark_seconds(const Detector& detector) noexcept;

/// Electrons per DN: the detector's own, or the one that puts the full well at the top of the scale.
[[nodiscard]] double gain_e_per_dn(const Detector& detector) noexcept;

}  // namespace narpa
