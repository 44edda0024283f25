/// protocols/video/frame_datagram.h - frames in UDP datagrams: the header of each part, and putting them together.
///
/// README.md in this folder has the table. A datagram holds whole rows, or a part of one row, and says where its
/// bytes belong, so that a receiver needs no state to place them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/pixel_format.h"
#include "protocols/video/frame_cut.h"

namespace narpa {

struct FrameDatagramHeader {
    std::int64_t t_ns = 0;                   ///< mid-exposure, simulation clock
    std::uint32_t frame = 0;                 ///< its number, as on CAN and in the embedded line
    PixelFormat pixel = PixelFormat::grey;   ///< of the samples
    LinkLayout link{};                       ///< of the samples
    std::uint16_t width = 0, height = 0;     ///< px
    std::uint32_t index = 0, count = 0;      ///< of this datagram, from 0; of the frame's
    std::uint32_t row = 0, byte_in_row = 0;  ///< where the bytes belong; rows have no padding
    friend bool operator==(const FrameDatagramHeader&, const FrameDatagramHeader&) = default;
};

/// magic, version, length | time | frame, format | width, height, bytes a row | index, count, row, byte | CRC
inline constexpr std::size_t kFrameDatagramHeaderBytes = 4 + 2 * 2 + 8 + 4 + 4 + 2 * 2 + 4 + 4 * 4 + 4;  ///< 52
inline constexpr std::uint16_t kFrameDatagramVersion = 1;

/// The frames of a format, cut for datagrams of at most `datagram_bytes` of payload, headers included.
[[nodiscard]] FrameCut cut_into_frame_datagrams(const VideoFormat& format, std::size_t datagram_bytes);

/// The CRC covers the header and `bytes`.
[[nodiscard]] std::array<std::uint8_t, kFrameDatagramHeaderBytes> encode_frame_datagram(
    const FrameDatagramHeader& h, std::span<const std::uint8_t> bytes) noexcept;
/// The bytes are those behind the header. Nothing: too short, another magic or version, a wrong CRC, an unknown
/// format, or a place outside the frame.
[[nodiscard]] std::optional<FrameDatagramHeader> decode_frame_datagram(
    std::span<const std::uint8_t> datagram) noexcept;

/// Puts the datagrams of a stream together. Frames come out whole and in order; datagrams may be lost, come twice,
/// and in any order within two frames.
class FrameAssembly {
public:
    struct Counters {
        std::uint64_t whole = 0;
        std::uint64_t incomplete = 0;  ///< frames of which datagrams were lost
        std::uint64_t missing = 0;     ///< frames of which none came
        std::uint64_t lost = 0;        ///< datagrams of incomplete frames
        std::uint64_t refused = 0;     ///< datagrams that are none of this stream, or came twice or too late
    };
    struct Frame {
        std::uint32_t number = 0;
        std::int64_t t_ns = 0;
        std::vector<std::uint8_t> bytes;  ///< link_bytes of the format
    };

    explicit FrameAssembly(const VideoFormat& format);

    /// The frame that this datagram completes; null: none. Valid until the next call.
    [[nodiscard]] const Frame* take(std::span<const std::uint8_t> datagram);
    [[nodiscard]] const Counters& counters() const noexcept { return counters_; }
    /// The format of the last datagram that was refused because it has another one.
    [[nodiscard]] const std::optional<VideoFormat>& other_format() const noexcept { return other_format_; }

private:
    struct Part {
        Frame frame;
        std::vector<bool> came;  ///< a datagram of this index; empty: no frame
        std::size_t left = 0;
    };
    [[nodiscard]] Part* part_of(const FrameDatagramHeader& h);
    void give_up(Part& part) noexcept;
    void end_at(std::uint32_t number) noexcept;

    VideoFormat format_;
    std::array<Part, 2> parts_;          ///< the frames that are not complete
    std::optional<std::uint32_t> last_;  ///< number of the newest one that came out or was given up
    Counters counters_;
    std::optional<VideoFormat> other_format_;
};

}  // namespace narpa
