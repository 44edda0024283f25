#include "protocols/video/y4m.h"

#include <algorithm>
#include <cstddef>
#include <numeric>

#include "base/time.h"

namespace narpa {
namespace {

std::string_view colour_space(PixelFormat pixel) {
    switch (pixel) {
        case PixelFormat::grey: return "mono";
        case PixelFormat::y16: return "mono16";
        case PixelFormat::yuyv: return "422";
        case PixelFormat::rgb24: break;
    }
    return {};
}

/// The value of a header's tag, such as the 640 of W640; empty without one.
std::string_view tag_value(std::string_view line, char tag) {
    for (std::size_t at = 0; at < line.size();) {
        const std::size_t end = std::min(line.find(' ', at), line.size());
        if (end > at && line[at] == tag) return line.substr(at + 1, end - at - 1);
        at = end + 1;
    }
    return {};
}

std::string size_text(std::string_view width, std::string_view height, std::string_view colour) {
    return std::string(width) + "x" + std::string(height) + " C" + std::string(colour);
}

// Y0 U Y1 V in the frame; all Y, all U, all V in the samples.
struct Planes {
    explicit Planes(const VideoFormat& f)
        : pairs(static_cast<std::size_t>(f.width) * static_cast<std::size_t>(f.height) / 2),
          u(2 * pairs),
          v(3 * pairs) {}
    std::size_t pairs, u, v;
};

}  // namespace

Result<std::string> y4m_stream_header(const VideoFormat& format) {
    const std::string_view colour = colour_space(format.pixel);
    if (colour.empty())
        return Error{"Y4M cannot hold " + std::string(name(format.pixel)) + " frames; it holds GREY, Y16 and YUYV"};
    if (format.width <= 0 || format.height <= 0 || format.period_ns <= 0)
        return Error{"Y4M needs a positive width, height and frame period"};
    if (format.pixel == PixelFormat::yuyv && format.width % 2 != 0)
        return Error{"YUYV needs an even width, not " + std::to_string(format.width)};
    const std::int64_t common = std::gcd(kSecond_ns, format.period_ns);
    return "YUV4MPEG2 W" + std::to_string(format.width) + " H" + std::to_string(format.height) + " F" +
           std::to_string(kSecond_ns / common) + ":" + std::to_string(format.period_ns / common) + " Ip A1:1 C" +
           std::string(colour) + "\n";
}

Status check_y4m_stream_header(std::string_view line, const VideoFormat& format) {
    constexpr std::string_view magic = "YUV4MPEG2 ";
    const Result<std::string> own = y4m_stream_header(format);
    if (!own) return own.error();
    if (!line.starts_with(magic)) return Error{"not a Y4M stream: it does not begin with YUV4MPEG2"};
    const std::string_view tags = line.substr(magic.size());
    const std::string_view colour = tag_value(tags, 'C');  // none means 420: yuv4mpeg(5)
    const std::string found =
        size_text(tag_value(tags, 'W'), tag_value(tags, 'H'), colour.empty() ? "420" : colour);
    const std::string expected =
        size_text(std::to_string(format.width), std::to_string(format.height), colour_space(format.pixel));
    if (found != expected) return Error{"the stream has " + found + " frames, expected " + expected};
    return Ok{};
}

void y4m_samples(const VideoFormat& format, std::span<const std::uint8_t> frame,
                 std::span<std::uint8_t> out) noexcept {
    if (y4m_is_verbatim(format.pixel)) {
        std::ranges::copy(frame, out.data());
        return;
    }
    const Planes plane(format);
    for (std::size_t i = 0; i < plane.pairs; ++i) {
        out[2 * i] = frame[4 * i];
        out[plane.u + i] = frame[4 * i + 1];
        out[2 * i + 1] = frame[4 * i + 2];
        out[plane.v + i] = frame[4 * i + 3];
    }
}

void frame_from_y4m(const VideoFormat& format, std::span<const std::uint8_t> samples,
                    std::span<std::uint8_t> out) noexcept {
    if (y4m_is_verbatim(format.pixel)) {
        std::ranges::copy(samples, out.data());
        return;
    }
    const Planes plane(format);
    for (std::size_t i = 0; i < plane.pairs; ++i) {
        out[4 * i] = samples[2 * i];
        out[4 * i + 1] = samples[plane.u + i];
        out[4 * i + 2] = samples[2 * i + 1];
        out[4 * i + 3] = samples[plane.v + i];
    }
}

}  // namespace narpa
