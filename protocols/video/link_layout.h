/// protocols/video/link_layout.h - frames of samples as links carry them: right-justified, packed, big-endian,
/// with padding at the ends of rows.
///
/// Source: MIPI CSI-2, RAW10 and RAW12; V4L2's Y10, Y12, Y14, Y10P, Y12P and Bayer formats (kernel documentation,
/// "Pixel formats"); GenICam's Pixel Format Naming Convention, Mono10p and Mono12p. An embedded line keeps its
/// bytes, at the start of the last row.
#pragma once

#include <cstdint>
#include <span>

#include "base/pixel_format.h"

namespace narpa {

/// `samples`: frame_bytes(format), `out`: link_bytes(format); they do not overlap. The bits of a sample below the
/// ADC's are lost.
void lay_out(const VideoFormat& format, std::span<const std::uint8_t> samples,
             std::span<std::uint8_t> out) noexcept;
/// The reverse; the bits of a sample below the ADC's are 0. Where a row is packed, pixels of which an embedded line
/// has overwritten bytes are not what was sent.
void samples_of_link(const VideoFormat& format, std::span<const std::uint8_t> bytes,
                     std::span<std::uint8_t> samples) noexcept;

}  // namespace narpa
