#include "protocols/video/y4m.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>

#include "base/time.h"

namespace narpa {
namespace {

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

/// Calls `copy(i, k)` for each byte: i is its place in the frame (Y0 U Y1 V ...), k in the samples (all Y, all U,
/// all V).
void for_each_sample(const VideoFormat& f, const auto& copy) {
    const std::size_t pairs = static_cast<std::size_t>(f.width) * static_cast<std::size_t>(f.height) / 2;
    for (std::size_t i = 0; i < pairs; ++i) {
        copy(4 * i, 2 * i), copy(4 * i + 1, 2 * pairs + i);
        copy(4 * i + 2, 2 * i + 1), copy(4 * i + 3, 3 * pairs + i);
    }
}

}  // namespace

Result<std::string> y4m_stream_header(const VideoFormat& format) {
    const std::string_view colour = link_y4m(format.pixel, format.link);
    if (colour.empty())
        return Error{"Y4M cannot hold frames of " + link_text(format.pixel, format.link) +
                     "; it holds GREY, Y10, Y12, Y16 and YUYV"};
    if (format.width <= 0 || format.height <= 0 || format.period_ns <= 0)
        return Error{"Y4M needs a positive width, height and frame period"};
    if (std::string what = unfit_size(format.pixel, format.width, format.height); !what.empty())
        return Error{std::move(what)};
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
    if (line.ends_with('\r'))
        return Error{
            "its first line ends in a carriage return: the stream was written or copied as text, expected "
            "it as binary"};
    const std::string_view tags = line.substr(magic.size());
    const std::string_view colour = tag_value(tags, 'C');  // none means 420: yuv4mpeg(5)
    const std::string found =
        size_text(tag_value(tags, 'W'), tag_value(tags, 'H'), colour.empty() ? "420" : colour);
    const std::string expected =
        size_text(std::to_string(format.width), std::to_string(format.height), link_y4m(format.pixel, format.link));
    if (found != expected) return Error{"the stream has " + found + " frames, expected " + expected};
    if (const std::string_view order = tag_value(tags, 'I'); !order.empty() && order != "p" && order != "?")
        return Error{"the stream is interlaced (I" + std::string(order) + "), expected progressive frames"};
    return Ok{};
}

void y4m_samples(const VideoFormat& format, std::span<const std::uint8_t> frame,
                 std::span<std::uint8_t> out) noexcept {
    if (y4m_is_verbatim(format.pixel))
        std::ranges::copy(frame, out.data());
    else
        for_each_sample(format, [&](std::size_t i, std::size_t k) { out[k] = frame[i]; });
}

void frame_from_y4m(const VideoFormat& format, std::span<const std::uint8_t> samples,
                    std::span<std::uint8_t> out) noexcept {
    if (y4m_is_verbatim(format.pixel))
        std::ranges::copy(samples, out.data());
    else
        for_each_sample(format, [&](std::size_t i, std::size_t k) { out[i] = samples[k]; });
}

}  // namespace narpa
