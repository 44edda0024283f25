/// renderer/camera/read_out.h - which pixels a camera reads out, and which it bins.
#pragma once

#include <cstdint>
#include <span>

#include "base/pixel_format.h"
#include "protocols/camera_control.h"

namespace narpa {

/// The size of the image stays. Pixels outside the region are black; in it, from its top left corner on, blocks of
/// n x n pixels have the mean of their samples, rounded (n x 1, 1 x n and smaller at its right and lower edge), as
/// sensors do that bin digitally. Binning is not for YUYV and mosaics: 1.
void read_out(const VideoFormat& format, const Region& region, int binning, std::span<std::uint8_t> bytes) noexcept;

/// YUYV holds black as luma 16 and chroma 128 (ITU-R BT.601), the others as zeros.
void fill_black(PixelFormat format, std::span<std::uint8_t> bytes) noexcept;

[[nodiscard]] constexpr bool can_bin(PixelFormat format) {
    return is_mono(format) || format == PixelFormat::rgb24;
}

/// Mean of the samples in the region (of YUYV, of the luma), as a share of the format's full scale.
[[nodiscard]] double mean_level(const VideoFormat& format, const Region& region,
                                std::span<const std::uint8_t> bytes) noexcept;

}  // namespace narpa
