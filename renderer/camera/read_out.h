/// renderer/camera/read_out.h - region of interest and binning at read-out.
#pragma once

#include <cstdint>
#include <span>

#include "base/pixel_format.h"
#include "protocols/camera_control.h"

namespace narpa {

/// The image keeps its size. Pixels outside the region are black. Within it, starting at its top left corner, each
/// block of n x n pixels is set to the mean of its samples, rounded (blocks at the right and lower edge may be
/// smaller), as in sensors with digital binning. YUYV and mosaics cannot be binned.
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
