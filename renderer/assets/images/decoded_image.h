/// renderer/assets/images/decoded_image.h - the samples of an image file and what the file declares about them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace narpa {

/// How samples relate to light, as far as a file says.
struct TransferCurve {
    enum class Kind : std::uint8_t {
        unspecified,
        srgb,   ///< IEC 61966-2-1
        power,  ///< light = sample ^ exponent
    };
    Kind kind = Kind::unspecified;
    double exponent = 1;
};

struct DecodedImage {
    int width = 0, height = 0;
    int channels = 1;                      ///< 1: grey; 3: red, green, blue
    bool has_alpha = false;                ///< the file has it; the samples here are without
    std::uint32_t largest = 255;           ///< integer sample of full scale, 1 to 65535; samples are at most that
    int significant_bits = 0;              ///< PNG's sBIT, the largest of the channels; 0: not declared
    std::vector<std::uint16_t> samples{};  ///< row by row from the top; empty for files of floating-point samples
    std::vector<float> floats{};           ///< full scale = 1
    TransferCurve transfer{};
    std::string icc_profile{};          ///< TIFF's, not yet judged; decode_image leaves none
    std::vector<std::string> unused{};  ///< what the file declares and no reader here uses: clauses for warnings
};

}  // namespace narpa
