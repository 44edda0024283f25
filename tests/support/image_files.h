/// tests/support/image_files.h - image files of tests, by the codecs that the product loads.
#pragma once

#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "renderer/assets/images/image_codecs.h"

namespace narpa::test {

/// In the format of the name's extension; as cv::imwrite.
inline void write_image_file(const std::string& path, const cv::Mat& image) {
    std::vector<unsigned char> bytes;
    const std::string extension = path.substr(path.rfind('.'));
    if (!image_codecs(path)->imencode(extension, image, bytes, {})) throw std::runtime_error("no " + path);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

/// All channels and bits as they are; empty where there is no image.
inline cv::Mat read_image_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(in), {}};
    return bytes.empty() ? cv::Mat() : image_codecs(path)->imdecode(bytes, cv::IMREAD_UNCHANGED);
}

}  // namespace narpa::test
