/// base/pixel_format.h - the pixel formats that narpa puts out, by their V4L2 names.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace narpa {

/// GREY: 8-bit luma. Y16: 16-bit little-endian luma, the ADC's bits left-justified. YUYV: 4:2:2, BT.601 limited
/// range. RGB24: 8-bit R, G, B.
enum class PixelFormat : std::uint8_t { grey, y16, yuyv, rgb24 };

struct VideoFormat {
    int width = 0, height = 0;
    PixelFormat pixel = PixelFormat::grey;
    std::int64_t period_ns = 100'000'000;  ///< 1 / frame rate
};

[[nodiscard]] constexpr std::size_t bytes_per_pixel(PixelFormat f) {
    switch (f) {
        case PixelFormat::grey: return 1;
        case PixelFormat::y16:
        case PixelFormat::yuyv: return 2;
        case PixelFormat::rgb24: return 3;
    }
    return 1;
}
[[nodiscard]] constexpr std::size_t frame_bytes(const VideoFormat& f) {
    return static_cast<std::size_t>(f.width) * static_cast<std::size_t>(f.height) * bytes_per_pixel(f.pixel);
}
[[nodiscard]] constexpr std::string_view name(PixelFormat f) {
    constexpr std::array<std::string_view, 4> names{"GREY", "Y16", "YUYV", "RGB24"};
    return names[static_cast<std::size_t>(f)];
}
[[nodiscard]] constexpr std::optional<PixelFormat> pixel_format_from(std::string_view text) {
    for (int i = 0; i < 4; ++i)
        if (name(static_cast<PixelFormat>(i)) == text) return static_cast<PixelFormat>(i);
    return std::nullopt;
}

}  // namespace narpa
