#include "protocols/video/rtp_video.h"

#include <algorithm>
#include <numeric>

#include "base/time.h"
#include "protocols/big_endian.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::uint8_t kRtpVersion2 = 2 << 6, kHasPadding = 0x20, kHasExtension = 0x10, kCountMask = 0x0F;
constexpr std::uint8_t kMarker = 0x80, kTypeMask = 0x7F;
constexpr std::uint16_t kOneByteElements = 0xBEDE;
constexpr std::uint16_t kContinues = 0x8000, kLow15 = 0x7FFF;
constexpr std::size_t kFrameElementBytes = 8 + 4, kExtensionWords = (kRtpExtensionBytes - 4) / 4;
constexpr std::size_t kRowsMost = 32768, kPixelsMost = 32768;  // line number and offset have 15 bits
/// A frame that is this much older than the newest one, 1 s, belongs to a stream that has begun again.
constexpr std::int32_t kOldestTicks = 90'000;

bool is_grey(const VideoFormat& f) {
    return is_mono(f.pixel);
}

std::size_t row_bytes_of(const VideoFormat& f, const RtpSampling& s) {
    return static_cast<std::size_t>(f.width) / s.group_pixels * s.group_bytes;
}

/// Groups of two grey pixels: Cb, Y0, Cr, Y1, most significant bit first.
void put_grey_groups(const VideoFormat& f, const RtpSampling& s, std::span<const std::uint8_t> samples,
                     std::uint8_t* out) {
    const std::uint64_t chroma = std::uint64_t{1} << (s.depth - 1);
    const std::uint64_t chromas = chroma << (3 * s.depth) | chroma << s.depth;
    const std::size_t bytes = bytes_per_pixel(f.pixel);
    const auto luma = [&](std::size_t pixel) -> std::uint64_t {
        if (bytes == 1) return samples[pixel];
        return get_le<std::uint16_t>(&samples[2 * pixel]) >> (16 - s.depth);
    };
    for (std::size_t pixel = 0; pixel < samples.size() / bytes; pixel += 2, out += s.group_bytes) {
        const std::uint64_t bits = chromas | luma(pixel) << (2 * s.depth) | luma(pixel + 1);
        for (std::size_t i = 0; i < s.group_bytes; ++i)
            out[i] = static_cast<std::uint8_t>(bits >> (8 * (s.group_bytes - 1 - i)));
    }
}
void get_grey_groups(const VideoFormat& f, const RtpSampling& s, std::span<const std::uint8_t> groups,
                     std::uint8_t* samples) {
    const std::size_t bytes = bytes_per_pixel(f.pixel);
    const auto put = [&](std::uint8_t* at, std::uint64_t luma) {
        if (bytes == 1)
            *at = static_cast<std::uint8_t>(luma);
        else
            put_le(at, static_cast<std::uint16_t>(luma << (16 - s.depth)));
    };
    const std::uint64_t mask = (std::uint64_t{1} << s.depth) - 1;
    for (std::size_t at = 0; at < groups.size(); at += s.group_bytes, samples += 2 * bytes) {
        std::uint64_t bits = 0;
        for (std::size_t i = 0; i < s.group_bytes; ++i) bits = bits << 8 | groups[at + i];
        put(samples, bits >> (2 * s.depth) & mask);
        put(samples + bytes, bits & mask);
    }
}

/// Between Y0 Cb Y1 Cr, as YUYV has them, and Cb Y0 Cr Y1.
void swap_pairs(std::span<const std::uint8_t> in, std::uint8_t* out) {
    for (std::size_t i = 0; i + 1 < in.size(); i += 2) out[i] = in[i + 1], out[i + 1] = in[i];
}

void put_groups(const VideoFormat& f, const RtpSampling& s, std::span<const std::uint8_t> samples,
                std::uint8_t* out) {
    if (is_grey(f)) return put_grey_groups(f, s, samples, out);
    if (f.pixel == PixelFormat::yuyv) return swap_pairs(samples, out);
    std::ranges::copy(samples, out);
}
void get_groups(const VideoFormat& f, const RtpSampling& s, std::span<const std::uint8_t> groups,
                std::uint8_t* samples) {
    if (is_grey(f)) return get_grey_groups(f, s, groups, samples);
    if (f.pixel == PixelFormat::yuyv) return swap_pairs(groups, samples);
    std::ranges::copy(groups, samples);
}

/// What is between RTP's fixed header and the padding.
struct RtpContent {
    std::uint32_t timestamp = 0;
    bool is_last = false;                     ///< of its frame
    std::span<const std::uint8_t> element{};  ///< of the frame's time and number; empty: none
    std::span<const std::uint8_t> payload{};
};

/// The element of an extension with one-byte headers.
std::span<const std::uint8_t> frame_element(std::span<const std::uint8_t> extension) {
    for (std::size_t at = 0; at < extension.size();) {
        const unsigned id = extension[at] >> 4;
        const std::size_t bytes = (extension[at] & 0xFu) + 1;
        if (id == 15) break;  // RFC 8285: stop here
        if (id == 0) {        // padding
            ++at;
            continue;
        }
        if (at + 1 + bytes > extension.size()) break;
        if (id == kRtpFrameElement && bytes == kFrameElementBytes) return extension.subspan(at + 1, bytes);
        at += 1 + bytes;
    }
    return {};
}

std::optional<RtpContent> read_rtp(std::span<const std::uint8_t> packet) {
    if (packet.size() < kRtpFixedHeaderBytes || (packet[0] & 0xC0) != kRtpVersion2 ||
        (packet[1] & kTypeMask) != kRtpVideoPayloadType)
        return std::nullopt;
    RtpContent out{.timestamp = get_be<std::uint32_t>(&packet[4]), .is_last = (packet[1] & kMarker) != 0};
    std::size_t begin = kRtpFixedHeaderBytes + 4 * static_cast<std::size_t>(packet[0] & kCountMask),
                end = packet.size();
    if ((packet[0] & kHasExtension) != 0) {
        if (begin + 4 > end) return std::nullopt;
        const std::size_t bytes = 4 * std::size_t{get_be<std::uint16_t>(&packet[begin + 2])};
        if (begin + 4 + bytes > end) return std::nullopt;
        if (get_be<std::uint16_t>(&packet[begin]) == kOneByteElements)
            out.element = frame_element(packet.subspan(begin + 4, bytes));
        begin += 4 + bytes;
    }
    if ((packet[0] & kHasPadding) != 0) end -= std::min<std::size_t>(packet.back(), end);
    if (begin + kRtpExtendedSequenceBytes > end) return std::nullopt;
    out.payload = packet.subspan(begin + kRtpExtendedSequenceBytes, end - begin - kRtpExtendedSequenceBytes);
    return out;
}

}  // namespace

Result<RtpSampling> rtp_sampling(const VideoFormat& f) {
    const std::string name = link_text(f.pixel, f.link);
    if (!f.link.has_plain_rows())
        return Error{"RFC 4175 has a byte order and rows of its own, not " + name +
                     "; expected a camera without byte_order and row_bytes"};
    if (is_bayer(f.pixel))
        return Error{"RFC 4175 has no mosaics such as " + name + "; it carries " +
                     "GREY, Y10, Y12, Y14, Y16, YUYV and RGB24"};
    if (static_cast<std::size_t>(f.width) > kPixelsMost || static_cast<std::size_t>(f.height) > kRowsMost)
        return Error{"RFC 4175 carries at most 32768 x 32768 pixels, not " + std::to_string(f.width) + " x " +
                     std::to_string(f.height)};
    if (f.pixel == PixelFormat::rgb24) return RtpSampling{"RGB", 8, 1, 3};
    if (f.width % 2 != 0)
        return Error{"RFC 4175 carries " + name + " in pairs of pixels, expected an even width, not " +
                     std::to_string(f.width)};
    const std::size_t bits = f.link.is_samples() ? 8 * (is_16_bit(f.pixel) ? 2 : 1) : f.link.bits;
    const std::size_t depth = bits > 12 ? 16 : bits;
    if (depth % 8 != 0 && f.link.first_bytes_kept > 0)
        return Error{"an embedded line needs whole bytes, and RFC 4175 carries " + name + " in " +
                     std::to_string(depth) + " bits: expected no embedded_line, as each packet has the frame's " +
                     "number and time, or format = \"Y16\""};
    return RtpSampling{"YCbCr-4:2:2", depth, 2, 4 * depth / 8};
}

RtpVideoPackets::RtpVideoPackets(const VideoFormat& format, const RtpSampling& sampling, std::size_t packet_bytes,
                                 std::uint32_t ssrc)
    : format_(format),
      sampling_(sampling),
      row_bytes_(row_bytes_of(format, sampling)),
      cut_({.row_bytes = row_bytes_,
            .rows = static_cast<std::size_t>(format.height),
            .unit_bytes = sampling.group_bytes,
            .row_header_bytes = kRtpRowHeaderBytes},
           packet_bytes - kRtpFixedHeaderBytes - kRtpExtensionBytes - kRtpExtendedSequenceBytes),
      ssrc_(ssrc),
      packet_(packet_bytes) {}

std::size_t RtpVideoPackets::frame_packets_bytes() const noexcept {
    constexpr std::size_t kEach = kRtpFixedHeaderBytes + kRtpExtensionBytes + kRtpExtendedSequenceBytes;
    const auto rows = static_cast<std::size_t>(format_.height);
    return count() * kEach + std::max<std::size_t>(count(), rows) * kRtpRowHeaderBytes + rows * row_bytes_;
}

std::span<const std::uint8_t> RtpVideoPackets::next(std::span<const std::uint8_t> frame, std::int64_t t_ns,
                                                    std::uint32_t number, std::uint32_t index) noexcept {
    const bool is_last = index + 1 == count();
    std::uint8_t* at = packet_.data();
    *at++ = kRtpVersion2 | kHasExtension;
    *at++ = static_cast<std::uint8_t>((is_last ? kMarker : 0) | kRtpVideoPayloadType);
    const auto put = [&at](auto value) {
        put_be(at, value);
        at += sizeof value;
    };
    put(static_cast<std::uint16_t>(sequence_));
    put(rtp_time(t_ns));
    put(ssrc_);
    put(kOneByteElements);
    put(static_cast<std::uint16_t>(kExtensionWords));
    *at++ = static_cast<std::uint8_t>(kRtpFrameElement << 4 | (kFrameElementBytes - 1));
    put(static_cast<std::uint64_t>(t_ns));
    put(number);
    for (int padding = 0; padding < 3; ++padding) *at++ = 0;
    put(static_cast<std::uint16_t>(sequence_ >> 16));
    ++sequence_;

    const FrameCut::Part part = cut_[index];
    const std::size_t rows = std::max<std::size_t>(part.bytes / row_bytes_, 1), row_bytes = part.bytes / rows;
    const std::size_t first_pixel = part.byte_in_row / sampling_.group_bytes * sampling_.group_pixels;
    for (std::size_t i = 0; i < rows; ++i) {
        put(static_cast<std::uint16_t>(row_bytes));
        put(static_cast<std::uint16_t>(part.row + i));
        put(static_cast<std::uint16_t>(first_pixel | (i + 1 < rows ? kContinues : 0u)));
    }
    const std::size_t pixels = part.bytes / sampling_.group_bytes * sampling_.group_pixels;
    const std::size_t first = part.row * static_cast<std::size_t>(format_.width) + first_pixel;
    const std::size_t bytes = bytes_per_pixel(format_.pixel);
    put_groups(format_, sampling_, frame.subspan(first * bytes, pixels * bytes), at);
    return {packet_.data(), static_cast<std::size_t>(at - packet_.data()) + part.bytes};
}

std::string rtp_video_sdp(const VideoFormat& f, const RtpSampling& sampling, const RtpSession& session) {
    const std::string ip = session.ipv6 ? "IN IP6 " : "IN IP4 ", type = std::to_string(kRtpVideoPayloadType);
    // RFC 8866: only a group of IPv4 has a time to live.
    const std::string ttl =
        session.multicast_ttl >= 0 && !session.ipv6 ? "/" + std::to_string(session.multicast_ttl) : "";
    const std::int64_t common = std::gcd(kSecond_ns, f.period_ns);
    const std::int64_t frames = kSecond_ns / common, seconds = f.period_ns / common;
    std::string text;
    for (const std::string& line :
         {std::string("v=0"), "o=- 0 0 " + ip + session.sender, std::string("s=narpa camera"),
          "c=" + ip + session.receiver + ttl, std::string("t=0 0"),
          "m=video " + std::to_string(session.port) + " RTP/AVP " + type, "a=rtpmap:" + type + " raw/90000",
          "a=fmtp:" + type + " sampling=" + std::string(sampling.name) + "; width=" + std::to_string(f.width) +
              "; height=" + std::to_string(f.height) + "; depth=" + std::to_string(sampling.depth) +
              "; colorimetry=BT601-5; exactframerate=" + std::to_string(frames) +
              (seconds > 1 ? "/" + std::to_string(seconds) : "") +
              "; RANGE=" + (f.pixel == PixelFormat::yuyv ? "NARROW" : "FULL"),
          "a=extmap:" + std::to_string(kRtpFrameElement) + " " + std::string(kRtpFrameUri),
          std::string("a=recvonly")})
        text += line + "\r\n";
    return text;
}

RtpVideoAssembly::RtpVideoAssembly(const VideoFormat& format, const RtpSampling& sampling)
    : format_(format), sampling_(sampling), row_bytes_(row_bytes_of(format, sampling)) {
    frame_.bytes.resize(frame_bytes(format));
    came_.resize(row_bytes_ / sampling.group_bytes * static_cast<std::size_t>(format.height));
}

/// False: a row or a part of one does not fit the format, or the frame ends elsewhere.
bool RtpVideoAssembly::read_parts(std::span<const std::uint8_t> payload, bool is_last) {
    parts_.clear();
    std::size_t data = 0, at = 0;
    bool continues = true;
    while (continues) {
        if (at + kRtpRowHeaderBytes > payload.size()) return false;
        const std::size_t bytes = get_be<std::uint16_t>(&payload[at]);
        const std::size_t row = get_be<std::uint16_t>(&payload[at + 2]);  // with the field's bit: 0 in whole frames
        const auto offset = get_be<std::uint16_t>(&payload[at + 4]);
        const std::size_t pixel = offset & kLow15, group = pixel / sampling_.group_pixels;
        continues = (offset & kContinues) != 0;
        at += kRtpRowHeaderBytes;
        if (bytes == 0 || bytes % sampling_.group_bytes != 0 || pixel % sampling_.group_pixels != 0 ||
            row >= static_cast<std::size_t>(format_.height) || group * sampling_.group_bytes + bytes > row_bytes_ ||
            bytes > payload.size())
            return false;
        parts_.push_back({row, group, payload.subspan(0, bytes)});
        data += bytes;
    }
    if (at + data > payload.size()) return false;
    for (RowPart& part : parts_) {
        part.bytes = payload.subspan(at, part.bytes.size());
        at += part.bytes.size();
    }
    const RowPart& end = parts_.back();
    const bool is_at_end = end.row + 1 == static_cast<std::size_t>(format_.height) &&
                           end.first_group * sampling_.group_bytes + end.bytes.size() == row_bytes_;
    return is_last == is_at_end;
}

void RtpVideoAssembly::begin(std::uint32_t timestamp, std::span<const std::uint8_t> element) {
    if (begun_) ++counters_.incomplete;
    frame_.timestamp = timestamp;
    frame_.number.reset();
    frame_.t_ns = 0;
    if (!element.empty()) {
        frame_.t_ns = static_cast<std::int64_t>(get_be<std::uint64_t>(element.data()));
        frame_.number = get_be<std::uint32_t>(&element[8]);
        const auto newer = static_cast<std::int32_t>(*frame_.number - last_number_.value_or(*frame_.number - 1));
        if (newer > 1) counters_.missing += static_cast<std::uint64_t>(newer - 1);
        last_number_ = frame_.number;
    }
    begun_ = true;
    came_.assign(came_.size(), false);
    left_ = came_.size();
}

const RtpVideoAssembly::Frame* RtpVideoAssembly::take(std::span<const std::uint8_t> packet) {
    const std::optional<RtpContent> content = read_rtp(packet);
    const auto older_than = [&](std::uint32_t than) {
        const auto ticks = static_cast<std::int32_t>(than - content->timestamp);
        return ticks >= 0 && ticks < kOldestTicks;
    };
    const bool is_new = content && !(begun_ && content->timestamp == frame_.timestamp);
    const bool is_unfit = content && !read_parts(content->payload, content->is_last);
    if (!content || is_unfit ||
        (is_new && ((ended_ && older_than(*ended_)) || (begun_ && older_than(frame_.timestamp))))) {
        ++(is_unfit ? counters_.unfit : counters_.refused);
        return nullptr;
    }
    if (is_new) begin(content->timestamp, content->element);
    bool is_repeated = false;
    for (const RowPart& part : parts_) {
        const std::size_t groups = part.bytes.size() / sampling_.group_bytes, group_pixels = sampling_.group_pixels;
        const std::size_t first = part.row * (row_bytes_ / sampling_.group_bytes) + part.first_group;
        get_groups(format_, sampling_, part.bytes,
                   &frame_.bytes[first * group_pixels * bytes_per_pixel(format_.pixel)]);
        for (std::size_t i = first; i < first + groups; ++i) {
            is_repeated = is_repeated || came_[i];
            if (!came_[i]) --left_;
            came_[i] = true;
        }
    }
    if (is_repeated) ++counters_.refused;
    if (left_ > 0) return nullptr;
    begun_ = false;
    ended_ = frame_.timestamp;
    ++counters_.whole;
    return &frame_;
}

}  // namespace narpa
