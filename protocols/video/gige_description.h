/// protocols/video/gige_description.h - what a GigE Vision client is told of the camera: pixel formats, and the
/// GenICam description of its features.
///
/// Source: GenICam Pixel Format Naming Convention (codes), GenICam Standard Features Naming Convention (names).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "base/pixel_format.h"
#include "base/result.h"

namespace narpa {

struct GigePixelFormat {
    std::string_view name;  ///< "Mono12"
    std::uint32_t code;
};
/// Error: GigE Vision has no code for the frames of this format.
[[nodiscard]] Result<GigePixelFormat> gige_pixel_format(const VideoFormat& format);

/// Addresses of registers that the description names.
struct GigeRegisters {
    std::uint32_t width, height, pixel_format, sensor_width, sensor_height, acquisition;
};
/// The features: all but the start of the acquisition are fixed by the scene.
[[nodiscard]] std::string gige_description(const VideoFormat& format, const GigePixelFormat& pixels,
                                           const GigeRegisters& at);

}  // namespace narpa
