/// protocols/video/y4m.h - YUV4MPEG2 ("Y4M"): the headers and the order of the samples.
///
/// GREY is Cmono, Y16 is Cmono16 (little-endian), Y10 and Y12 are Cmono10 and Cmono12, YUYV is C422 (three planes:
/// the same samples in another order). RGB24, packed pixels and Bayer mosaics have no place in Y4M. Cmono and its
/// like are extensions that ffmpeg and mjpegtools write. Source: yuv4mpeg(5) of mjpegtools; ffmpeg's "yuv4mpegpipe"
/// (de)muxer.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "base/pixel_format.h"
#include "base/result.h"

namespace narpa {

/// `YUV4MPEG2 W640 H480 F10:1 Ip A1:1 Cmono` and a line feed; the frame rate is exactly 1 / period.
Result<std::string> y4m_stream_header(const VideoFormat& format);

/// Ok if a stream with this header (its first line, without the line feed) has frames of this format. Its frame
/// rate is not compared: no frame depends on it.
Status check_y4m_stream_header(std::string_view line, const VideoFormat& format);

/// Precedes each frame's samples.
inline constexpr std::string_view kY4mFrameHeader = "FRAME\n";

/// Y4M's samples are the frame's own bytes in their own order.
[[nodiscard]] constexpr bool y4m_is_verbatim(PixelFormat f) {
    return f == PixelFormat::grey || f == PixelFormat::y16;
}

/// Writes the frame's samples in Y4M's order. Both spans hold frame_bytes(format); they do not overlap.
void y4m_samples(const VideoFormat& format, std::span<const std::uint8_t> frame,
                 std::span<std::uint8_t> out) noexcept;
/// Writes a frame from Y4M's samples.
void frame_from_y4m(const VideoFormat& format, std::span<const std::uint8_t> samples,
                    std::span<std::uint8_t> out) noexcept;

}  // namespace narpa
