/// renderer/scene/image_codecs.h - OpenCV's image codecs, loaded when the first image is read or written.
///
/// Debian's libopencv_imgcodecs needs 140 other libraries, GDAL's among them: a program that is linked to it starts
/// in 80 to 110 ms, one that is not in a tenth of that.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"

namespace cv {
class _InputArray;
class Mat;
}  // namespace cv

namespace narpa {

/// The functions of opencv2/imgcodecs.hpp.
struct ImageCodecs {
    cv::Mat (*imdecode)(const cv::_InputArray& bytes, int flags) = nullptr;
    bool (*imencode)(const std::string& extension, const cv::_InputArray& image, std::vector<unsigned char>& bytes,
                     const std::vector<int>& parameters) = nullptr;
};

/// For reading or writing this file; from any thread. Errors name it: the library or one of the functions is not
/// there, with the loader's reason.
Result<ImageCodecs> image_codecs(const std::string& file);

}  // namespace narpa
