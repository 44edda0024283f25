/// protocols/video/rtp_video.h - uncompressed video in RTP packets, as receivers of professional video read it.
///
/// Source: RFC 3550 (RTP), RFC 4175 (uncompressed video), RFC 8285 (header extensions), RFC 8866 (SDP). README.md
/// in this folder has the tables. RFC 4175 has no grey: grey is the luma of YCbCr-4:2:2 with a chroma of zero, the
/// middle of its range. It has no mosaics.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/pixel_format.h"
#include "base/result.h"
#include "protocols/video/frame_cut.h"

namespace narpa {

/// How RFC 4175 carries samples: groups of pixels that fill whole bytes.
struct RtpSampling {
    std::string_view name;  ///< "YCbCr-4:2:2" or "RGB"
    std::size_t depth;      ///< bits of a component: 8, 10, 12 or 16
    std::size_t group_pixels, group_bytes;
};
/// Error: the format has no place in RFC 4175. Samples of 14 bits and more travel in 16.
[[nodiscard]] Result<RtpSampling> rtp_sampling(const VideoFormat& format);

inline constexpr std::uint8_t kRtpVideoPayloadType = 96;  ///< the first of the dynamic ones
/// RTP's header; of the extension its own 4 bytes, those of its element, its data and padding.
inline constexpr std::size_t kRtpFixedHeaderBytes = 12, kRtpExtensionBytes = 4 + 1 + 8 + 4 + 3;  ///< 20
/// RFC 4175: the high bits of the sequence number, and for each row or part of one its length, number and offset.
inline constexpr std::size_t kRtpExtendedSequenceBytes = 2, kRtpRowHeaderBytes = 2 + 2 + 2;
/// The extension's element: time of the frame's mid-exposure, ns of the simulation clock, and its number.
inline constexpr std::uint8_t kRtpFrameElement = 1;
inline constexpr std::string_view kRtpFrameUri = "urn:x-narpa:frame";

/// The 90 kHz time stamp of a time. 0 is sent as 1: ffmpeg (5.1) takes a first packet of 0 for one of a frame that
/// it has begun.
[[nodiscard]] constexpr std::uint32_t rtp_time(std::int64_t t_ns) noexcept {
    constexpr std::int64_t kNs = 100'000, kTicks = 9;  // 90 kHz
    const std::int64_t whole = t_ns / kNs - (t_ns % kNs < 0 ? 1 : 0), rest = t_ns - whole * kNs;
    const auto ticks = static_cast<std::uint32_t>(whole * kTicks + rest * kTicks / kNs);
    return ticks == 0 ? 1 : ticks;
}

/// The packets of a stream of frames.
class RtpVideoPackets {
public:
    /// `format`: one that rtp_sampling takes, of at most 32768 x 32768 pixels; `packet_bytes`: payload of UDP, all
    /// headers included, at least 64.
    RtpVideoPackets(const VideoFormat& format, const RtpSampling& sampling, std::size_t packet_bytes,
                    std::uint32_t ssrc);

    /// Packets of a frame, and the sum of their bytes.
    [[nodiscard]] std::uint32_t count() const noexcept { return cut_.count(); }
    [[nodiscard]] std::size_t frame_packets_bytes() const noexcept;
    /// The next packet of the stream: number `index` of a frame of samples (frame_bytes). Valid until the next
    /// call.
    [[nodiscard]] std::span<const std::uint8_t> next(std::span<const std::uint8_t> frame, std::int64_t t_ns,
                                                     std::uint32_t number, std::uint32_t index) noexcept;

private:
    VideoFormat format_;
    RtpSampling sampling_;
    std::size_t row_bytes_;
    FrameCut cut_;
    std::uint32_t ssrc_, sequence_ = 0;
    std::vector<std::uint8_t> packet_;
};

/// A session as receivers are told of it.
struct RtpSession {
    std::string sender, receiver;  ///< addresses
    bool ipv6 = false;
    int multicast_ttl = -1;  ///< -1: not to a group
    std::uint16_t port = 0;
};
/// The text of an SDP file.
[[nodiscard]] std::string rtp_video_sdp(const VideoFormat& format, const RtpSampling& sampling,
                                        const RtpSession& session);

/// Puts the packets of a stream together, of any sender of RFC 4175 with this format. Packets may be lost, come
/// twice, and in any order within a frame.
class RtpVideoAssembly {
public:
    struct Counters {
        std::uint64_t whole = 0;
        std::uint64_t incomplete = 0;  ///< frames of which packets were lost
        std::uint64_t missing = 0;     ///< frames of which none came, by their numbers
        std::uint64_t refused = 0;     ///< packets that came twice or too late, or are no RTP
        std::uint64_t unfit = 0;       ///< packets of frames of another format
    };
    struct Frame {
        std::uint32_t timestamp = 0;
        std::optional<std::uint32_t> number{};  ///< absent: the sender does not send it
        std::int64_t t_ns = 0;                  ///< with the number
        std::vector<std::uint8_t> bytes{};      ///< samples (frame_bytes); bits that were not sent are 0
    };
    RtpVideoAssembly(const VideoFormat& format, const RtpSampling& sampling);

    /// The frame that this packet completes; null: none. Valid until the next call.
    [[nodiscard]] const Frame* take(std::span<const std::uint8_t> packet);
    [[nodiscard]] const Counters& counters() const noexcept { return counters_; }

private:
    struct RowPart {
        std::size_t row, first_group;
        std::span<const std::uint8_t> bytes;
    };
    [[nodiscard]] bool read_parts(std::span<const std::uint8_t> payload, bool is_last);
    void begin(std::uint32_t timestamp, std::span<const std::uint8_t> element);

    VideoFormat format_;
    RtpSampling sampling_;
    std::size_t row_bytes_;
    Frame frame_;
    bool begun_ = false;
    std::vector<bool> came_;  ///< of each group of pixels
    std::size_t left_ = 0;    ///< groups
    std::optional<std::uint32_t> ended_, last_number_;
    std::vector<RowPart> parts_;
    Counters counters_;
};

}  // namespace narpa
