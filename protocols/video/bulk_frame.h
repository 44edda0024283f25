/// protocols/video/bulk_frame.h - the header of a frame on a USB bulk endpoint.
///
/// A frame is a header of 48 bytes and then its pixels, row after row; it ends with a short packet. README.md in
/// this folder has the table. Identity and time of the frame are here because a bridge has no other place for them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/pixel_format.h"

namespace narpa {

struct BulkFrameHeader {
    std::int64_t t_ns = 0;  ///< mid-exposure, simulation clock
    std::uint32_t number =
        0;  ///< of the frame, as on CAN and in the embedded line; a gap means frames that are lost
    PixelFormat pixel = PixelFormat::grey;  ///< of the samples
    std::uint32_t width = 0, height = 0;    ///< px
    std::uint32_t pixels_crc32 = 0;         ///< of all bytes behind the header
    LinkLayout link{};                      ///< of the samples
    /// Of all bytes behind the header; rows have no padding.
    [[nodiscard]] std::uint64_t pixel_bytes() const noexcept {
        return std::uint64_t{link_row_bytes(width, pixel, link)} * height;
    }
    friend bool operator==(const BulkFrameHeader&, const BulkFrameHeader&) = default;
};

/// magic, version, length | time | number, format, width, height, bytes a row, bytes in all | two CRCs
inline constexpr std::size_t kBulkHeaderBytes = 4 + 2 * 2 + 8 + 6 * 4 + 2 * 4;  ///< 48
inline constexpr std::uint16_t kBulkVersion = 1;

/// `pixel_bytes()` is to be below 2^32.
[[nodiscard]] std::array<std::uint8_t, kBulkHeaderBytes> encode_bulk_header(const BulkFrameHeader& h) noexcept;
/// Nothing: another length, magic or version, a wrong CRC, an unknown format, no pixels, or sizes that do not
/// agree.
[[nodiscard]] std::optional<BulkFrameHeader> decode_bulk_header(std::span<const std::uint8_t> bytes) noexcept;

}  // namespace narpa
