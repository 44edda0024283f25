/// renderer/assets/images/image_codecs.h - OpenCV's image codecs and libtiff, loaded when the first image is read
/// or written.
///
/// Debian's libopencv_imgcodecs needs 140 other libraries, GDAL's among them: a program that is linked to it starts
/// in 80 to 110 ms, one that is not in a tenth of that. So a small shared library of narpa's
/// (renderer/image_codecs) is linked to it.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/assets/images/decoded_image.h"

namespace cv {
class _InputArray;
class Mat;
}  // namespace cv

namespace narpa {

struct ImageCodecs {
    // The functions of opencv2/imgcodecs.hpp.
    cv::Mat (*imdecode)(const cv::_InputArray& bytes, int flags) = nullptr;
    bool (*imencode)(const std::string& extension, const cv::_InputArray& image, std::vector<unsigned char>& bytes,
                     const std::vector<int>& parameters) = nullptr;
    /// A TIFF or BigTIFF, whose size the caller has checked. Errors do not name the file.
    Result<DecodedImage> (*decode_tiff)(std::span<const std::uint8_t> bytes) = nullptr;
};

/// The codecs; thread-safe. Errors name `file` and the loader's reason: the library or one of its functions is
/// missing.
Result<ImageCodecs> image_codecs(const std::string& file);

}  // namespace narpa
