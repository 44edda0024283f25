#include "protocols/video/frame_datagram.h"

#include <algorithm>
#include <string>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::array<std::uint8_t, 4> kDatagramMagic{'N', 'R', 'P', 'D'};

struct DatagramAt {
    static constexpr std::size_t kVersion = 4, kLength = 6, kTime = 8, kFrame = 16, kFormat = 20, kWidth = 24,
                                 kHeight = 26, kRowBytes = 28, kIndex = 32, kCount = 36, kRow = 40, kByte = 44,
                                 kCrc = 48;
};
static_assert(DatagramAt::kCrc + 4 == kFrameDatagramHeaderBytes);

/// A part of a row is a multiple of this, its last part excepted: pixels of all formats, and whole words.
constexpr std::size_t kPartUnit = 24;
/// A frame that is this much older than the newest one belongs to a stream that has begun again.
constexpr std::int32_t kLatest = 64;

std::uint32_t crc_of(std::span<const std::uint8_t> header, std::span<const std::uint8_t> bytes) noexcept {
    return crc32(bytes, crc32(header.first(DatagramAt::kCrc)));
}

std::int32_t newer_by(std::uint32_t number, std::uint32_t than) noexcept {
    return static_cast<std::int32_t>(number - than);
}

}  // namespace

FrameCut cut_into_frame_datagrams(const VideoFormat& format, std::size_t datagram_bytes) {
    return FrameCut({.row_bytes = link_row_bytes(format),
                     .rows = static_cast<std::size_t>(format.height),
                     .unit_bytes = kPartUnit},
                    datagram_bytes - kFrameDatagramHeaderBytes);
}

std::array<std::uint8_t, kFrameDatagramHeaderBytes> encode_frame_datagram(
    const FrameDatagramHeader& h, std::span<const std::uint8_t> bytes) noexcept {
    std::array<std::uint8_t, kFrameDatagramHeaderBytes> b{};
    std::ranges::copy(kDatagramMagic, b.begin());
    put_le(&b[DatagramAt::kVersion], kFrameDatagramVersion);
    put_le(&b[DatagramAt::kLength], static_cast<std::uint16_t>(kFrameDatagramHeaderBytes));
    put_le(&b[DatagramAt::kTime], static_cast<std::uint64_t>(h.t_ns));
    put_le(&b[DatagramAt::kFrame], h.frame);
    std::ranges::copy(link_code(h.pixel, h.link), &b[DatagramAt::kFormat]);
    put_le(&b[DatagramAt::kWidth], h.width);
    put_le(&b[DatagramAt::kHeight], h.height);
    put_le(&b[DatagramAt::kRowBytes], static_cast<std::uint32_t>(link_row_bytes(h.width, h.pixel, h.link)));
    put_le(&b[DatagramAt::kIndex], h.index);
    put_le(&b[DatagramAt::kCount], h.count);
    put_le(&b[DatagramAt::kRow], h.row);
    put_le(&b[DatagramAt::kByte], h.byte_in_row);
    put_le(&b[DatagramAt::kCrc], crc_of(b, bytes));
    return b;
}

std::optional<FrameDatagramHeader> decode_frame_datagram(std::span<const std::uint8_t> b) noexcept {
    if (b.size() <= kFrameDatagramHeaderBytes ||
        !std::ranges::equal(kDatagramMagic, b.first(kDatagramMagic.size())))
        return std::nullopt;
    const auto bytes = b.subspan(kFrameDatagramHeaderBytes);
    if (get_le<std::uint16_t>(&b[DatagramAt::kVersion]) != kFrameDatagramVersion ||
        get_le<std::uint16_t>(&b[DatagramAt::kLength]) != kFrameDatagramHeaderBytes ||
        get_le<std::uint32_t>(&b[DatagramAt::kCrc]) != crc_of(b, bytes))
        return std::nullopt;
    const std::string code(&b[DatagramAt::kFormat], &b[DatagramAt::kFormat] + 4);
    const std::optional<LinkPixels> pixels = link_from_code(code);
    if (!pixels) return std::nullopt;
    FrameDatagramHeader h{.t_ns = static_cast<std::int64_t>(get_le<std::uint64_t>(&b[DatagramAt::kTime])),
                          .frame = get_le<std::uint32_t>(&b[DatagramAt::kFrame]),
                          .pixel = pixels->samples,
                          .link = pixels->layout,
                          .width = get_le<std::uint16_t>(&b[DatagramAt::kWidth]),
                          .height = get_le<std::uint16_t>(&b[DatagramAt::kHeight]),
                          .index = get_le<std::uint32_t>(&b[DatagramAt::kIndex]),
                          .count = get_le<std::uint32_t>(&b[DatagramAt::kCount]),
                          .row = get_le<std::uint32_t>(&b[DatagramAt::kRow]),
                          .byte_in_row = get_le<std::uint32_t>(&b[DatagramAt::kByte])};
    const auto row_bytes = get_le<std::uint32_t>(&b[DatagramAt::kRowBytes]);
    if (!take_row_bytes(row_bytes, h.width, h.pixel, h.link)) return std::nullopt;
    const std::uint64_t end = std::uint64_t{h.row} * row_bytes + h.byte_in_row + bytes.size();
    const std::uint64_t most = std::uint64_t{row_bytes} * h.height;
    if (h.index >= h.count || h.byte_in_row >= row_bytes || end > most || h.count > most) return std::nullopt;
    return h;
}

FrameAssembly::FrameAssembly(const VideoFormat& format) : format_(format) {
    for (Part& part : parts_) part.frame.bytes.resize(link_bytes(format));
}

/// Frame `number` has ended; those between the one before and this one never came.
void FrameAssembly::end_at(std::uint32_t number) noexcept {
    if (last_) counters_.missing += static_cast<std::uint64_t>(newer_by(number, *last_) - 1);
    last_ = number;
}

void FrameAssembly::give_up(Part& part) noexcept {
    ++counters_.incomplete;
    counters_.lost += part.left;
    part.came.clear();
}

/// The place of the datagram's frame; null: that frame has ended.
FrameAssembly::Part* FrameAssembly::part_of(const FrameDatagramHeader& h) {
    if (last_ && newer_by(h.frame, *last_) <= 0) {
        if (newer_by(h.frame, *last_) > -kLatest) return nullptr;
        for (Part& part : parts_)  // the sender has begun again
            if (!part.came.empty()) give_up(part);
        last_.reset();
    }
    for (Part& part : parts_)
        if (!part.came.empty() && part.frame.number == h.frame) return &part;
    Part* place = std::ranges::find_if(parts_, [](const Part& part) { return part.came.empty(); });
    if (place == parts_.end()) {  // the older one
        place = newer_by(parts_[0].frame.number, parts_[1].frame.number) < 0 ? &parts_[0] : &parts_[1];
        if (newer_by(h.frame, place->frame.number) < 0) return nullptr;
        give_up(*place);
        end_at(place->frame.number);
    }
    place->frame.number = h.frame, place->frame.t_ns = h.t_ns;
    place->came.assign(h.count, false);
    place->left = h.count;
    return place;
}

const FrameAssembly::Frame* FrameAssembly::take(std::span<const std::uint8_t> datagram) {
    const std::optional<FrameDatagramHeader> h = decode_frame_datagram(datagram);
    const VideoFormat its{h ? h->width : 0, h ? h->height : 0, h ? h->pixel : PixelFormat::grey, format_.period_ns,
                          h ? h->link : LinkLayout{}};
    const bool same = is_same_on_link(its, format_);
    if (h && !same) other_format_ = its;
    Part* const part = h && same ? part_of(*h) : nullptr;
    if (part == nullptr || h->count != part->came.size() || part->came[h->index]) {
        ++counters_.refused;
        return nullptr;
    }
    const auto bytes = datagram.subspan(kFrameDatagramHeaderBytes);
    std::ranges::copy(bytes, &part->frame.bytes[h->row * link_row_bytes(format_) + h->byte_in_row]);
    part->came[h->index] = true;
    if (--part->left > 0) return nullptr;
    part->came.clear();
    for (Part& other : parts_)
        if (!other.came.empty() && newer_by(other.frame.number, h->frame) < 0) {
            give_up(other);
            end_at(other.frame.number);
        }
    end_at(h->frame);
    ++counters_.whole;
    return &part->frame;
}

}  // namespace narpa
