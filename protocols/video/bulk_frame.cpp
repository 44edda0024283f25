#include "protocols/video/bulk_frame.h"

#include <algorithm>
#include <string_view>

#include "protocols/crc32.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr std::array<std::uint8_t, 4> kBulkMagic{'N', 'R', 'P', 'F'};

struct BulkAt {
    static constexpr std::size_t kVersion = 4, kLength = 6, kTime = 8, kNumber = 16, kFormat = 20, kWidth = 24,
                                 kHeight = 28, kRow = 32, kSize = 36, kPixelsCrc = 40, kCrc = 44;
};
static_assert(BulkAt::kCrc + 4 == kBulkHeaderBytes);

}  // namespace

std::array<std::uint8_t, kBulkHeaderBytes> encode_bulk_header(const BulkFrameHeader& h) noexcept {
    std::array<std::uint8_t, kBulkHeaderBytes> b{};
    std::ranges::copy(kBulkMagic, b.begin());
    put_le(&b[BulkAt::kVersion], kBulkVersion);
    put_le(&b[BulkAt::kLength], static_cast<std::uint16_t>(kBulkHeaderBytes));
    put_le(&b[BulkAt::kTime], static_cast<std::uint64_t>(h.t_ns));
    put_le(&b[BulkAt::kNumber], h.number);
    std::ranges::copy(link_code(h.pixel, h.link), &b[BulkAt::kFormat]);
    put_le(&b[BulkAt::kWidth], h.width);
    put_le(&b[BulkAt::kHeight], h.height);
    put_le(&b[BulkAt::kRow], static_cast<std::uint32_t>(link_row_bytes(h.width, h.pixel, h.link)));
    put_le(&b[BulkAt::kSize], static_cast<std::uint32_t>(h.pixel_bytes()));
    put_le(&b[BulkAt::kPixelsCrc], h.pixels_crc32);
    put_le(&b[BulkAt::kCrc], crc32(std::span(b).first(BulkAt::kCrc)));
    return b;
}

std::optional<BulkFrameHeader> decode_bulk_header(std::span<const std::uint8_t> b) noexcept {
    if (b.size() != kBulkHeaderBytes || !std::ranges::equal(kBulkMagic, b.first(kBulkMagic.size())))
        return std::nullopt;
    if (get_le<std::uint16_t>(&b[BulkAt::kVersion]) != kBulkVersion ||
        get_le<std::uint16_t>(&b[BulkAt::kLength]) != kBulkHeaderBytes ||
        get_le<std::uint32_t>(&b[BulkAt::kCrc]) != crc32(b.first(BulkAt::kCrc)))
        return std::nullopt;
    BulkFrameHeader h;
    h.t_ns = static_cast<std::int64_t>(get_le<std::uint64_t>(&b[BulkAt::kTime]));
    h.number = get_le<std::uint32_t>(&b[BulkAt::kNumber]);
    const std::string code(&b[BulkAt::kFormat], &b[BulkAt::kFormat] + 4);
    const std::optional<LinkPixels> pixels = link_from_code(code);
    if (!pixels) return std::nullopt;
    h.pixel = pixels->samples, h.link = pixels->layout;
    h.width = get_le<std::uint32_t>(&b[BulkAt::kWidth]);
    h.height = get_le<std::uint32_t>(&b[BulkAt::kHeight]);
    h.pixels_crc32 = get_le<std::uint32_t>(&b[BulkAt::kPixelsCrc]);
    if (!take_row_bytes(get_le<std::uint32_t>(&b[BulkAt::kRow]), h.width, h.pixel, h.link)) return std::nullopt;
    const auto told_size = get_le<std::uint32_t>(&b[BulkAt::kSize]);
    if (told_size == 0 || told_size != h.pixel_bytes()) return std::nullopt;
    return h;
}

}  // namespace narpa
