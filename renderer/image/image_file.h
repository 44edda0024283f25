/// renderer/image/image_file.h - a frame as an image file.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/radiance_image.h"
#include "base/result.h"
#include "renderer/scene/scene.h"

namespace cv {
class Mat;
}

namespace narpa {

/// A frame before and after the detector; each file format stores what it can hold.
struct RenderedFrame {
    const Camera& camera;
    const RadianceImage& radiance;
    const Aovs* aovs = nullptr;             ///< EXR writes those that are not empty
    std::span<const std::uint8_t> bytes{};  ///< what `expose` wrote: needed by .png and .raw
};

/// In place of a path: a PNG on standard output.
inline constexpr std::string_view kStandardOutput = "-";

/// Error: `path` has an extension that write_image does not know.
Status check_image_name(const std::string& path);

/// Writes by the extension of `path`:
///   .exr  linear radiance R, G, B (W m^-2 sr^-1) and beside it, where `aovs` has them, depth.Z and range (m,
///         infinite where nothing is hit), normal.X/Y/Z and position.X/Y/Z (world, m), body (index, -1 none),
///         albedo.R/G/B, variance; all 32-bit floats. OpenEXR has no doubles, so depth, range and position
///         have a second channel with the rounding error of the first (depth.Z.rest, range.rest, position.X.rest
///         ...): their sum is accurate to 2^-48, 1e-7 m at the distance of the Moon.
///   .pfm  linear radiance, little-endian, rows from the bottom
///   .png  the camera's own output: GREY 8-bit, Y16 16-bit grey, RGB24 and YUYV 8-bit colour, Bayer mosaics
///         as they are, 8-bit or 16-bit grey
///   .raw  the camera's own output, byte for byte as written to a video device
///   kStandardOutput  as .png
/// Errors: an unknown extension; a path that cannot be written.
Status write_image(const std::string& path, const RenderedFrame& frame);

/// Reads a frame as the camera outputs it: from .raw byte for byte, or from another image (decode_image) with the
/// camera's size and the channels of its format. Samples of full scale are the largest of the format, so a PGM
/// whose maxval is 4095 is scaled; files of 16 bits hold samples of 9 to 15 bits in the upper bits, as write_image
/// writes them. Errors: a file that cannot be read; a size or pixel type that is not the camera's; YUYV, whose
/// bytes an image file does not hold. `warnings`: where sentences go about what the file declares and is not used.
Result<std::vector<std::uint8_t>> read_frame(const std::string& path, const Camera& camera,
                                             std::vector<std::string>* warnings = nullptr);

/// Writes one 32-bit float a pixel as a grey PFM, little-endian, rows from the bottom. `values`: row by row from
/// the top. Error: a path that cannot be written.
Status write_pfm(const std::string& path, int width, int height, std::span<const double> values);

/// Writes grey or colour (blue first) of 8 or 16 bits as PNG. Errors: a path that cannot be written; no codecs.
Status write_png(const std::string& path, const cv::Mat& image);

}  // namespace narpa
