#include "renderer/assets/image_header.h"

#include <algorithm>
#include <string_view>

namespace narpa {

namespace {

/// The bytes of a file; those beyond its end read as 0.
class Bytes {
public:
    explicit Bytes(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

    [[nodiscard]] std::size_t size() const { return bytes_.size(); }
    std::uint8_t operator[](std::size_t at) const { return at < bytes_.size() ? bytes_[at] : std::uint8_t{0}; }
    [[nodiscard]] bool begins(std::size_t at, std::string_view text) const {
        return at + text.size() <= bytes_.size() &&
               std::equal(text.begin(), text.end(), bytes_.begin() + static_cast<std::ptrdiff_t>(at),
                          [](char c, std::uint8_t b) { return static_cast<std::uint8_t>(c) == b; });
    }
    [[nodiscard]] std::uint32_t little(std::size_t at, std::size_t count) const {
        std::uint32_t x = 0;
        for (std::size_t i = count; i-- > 0;) x = x << 8 | (*this)[at + i];
        return x;
    }
    [[nodiscard]] std::uint32_t big(std::size_t at, std::size_t count) const {
        std::uint32_t x = 0;
        for (std::size_t i = 0; i < count; ++i) x = x << 8 | (*this)[at + i];
        return x;
    }

private:
    std::span<const std::uint8_t> bytes_;
};

/// ITU-T T.81, B.2.2: the first frame header. Bytes between segments are skipped, as decoders do.
ImageSize jpeg_size(const Bytes& b) {
    for (std::size_t at = 2; at + 9 < b.size();) {
        if (b[at] != 0xff || b[at + 1] == 0xff || b[at + 1] == 0) {
            ++at;
            continue;
        }
        const std::uint8_t marker = b[at + 1];
        const bool is_frame =
            marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
        if (is_frame) return {b.big(at + 7, 2), b.big(at + 5, 2)};
        const bool has_no_length = marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8);
        at += 2 + (has_no_length ? 0 : b.big(at + 2, 2));
    }
    return {};
}

/// TIFF 6.0: ImageWidth and ImageLength of the first directory.
ImageSize tiff_size(const Bytes& b) {
    const bool is_little = b[0] == 'I';
    const auto number = [&](std::size_t at, std::size_t count) {
        return is_little ? b.little(at, count) : b.big(at, count);
    };
    constexpr std::uint32_t kWidth = 256, kHeight = 257, kShort = 3;
    const std::size_t directory = number(4, 4);
    ImageSize size;
    for (std::size_t i = 0, count = number(directory, 2); i < count; ++i) {
        const std::size_t entry = directory + 2 + 12 * i;
        const std::uint32_t tag = number(entry, 2),
                            value = number(entry + 8, number(entry + 2, 2) == kShort ? 2 : 4);
        if (tag == kWidth) size.width = std::max<std::uint64_t>(size.width, value);
        if (tag == kHeight) size.height = std::max<std::uint64_t>(size.height, value);
    }
    return size;
}

/// RFC 9649, section 2.
ImageSize webp_size(const Bytes& b) {
    constexpr std::uint32_t k14Bits = 0x3fff;
    if (b.begins(12, "VP8X")) return {1 + b.little(24, 3), 1 + b.little(27, 3)};
    if (b.begins(12, "VP8L")) return {1 + (b.little(21, 4) & k14Bits), 1 + (b.little(21, 4) >> 14 & k14Bits)};
    if (b.begins(12, "VP8 ")) return {b.little(26, 2) & k14Bits, b.little(28, 2) & k14Bits};
    return {};
}

ImageSize bmp_size(const Bytes& b) {
    if (b.little(14, 4) == 12) return {b.little(18, 2), b.little(20, 2)};
    const std::uint32_t height = b.little(22, 4);  // two's complement: below 0 where rows come from the top
    return {b.little(18, 4), height > 0x7fff'ffffu ? 0u - height : height};
}

/// Netpbm's P1 to P6: numbers in decimal, comments from # to the end of the line.
ImageSize pnm_size(const Bytes& b) {
    std::size_t at = 2;
    const auto number = [&] {
        constexpr std::uint64_t kLargest = 1u << 31;
        for (; at < b.size() && (b[at] < '0' || b[at] > '9'); ++at)
            if (b[at] == '#')
                while (at < b.size() && b[at] != '\n') ++at;
        std::uint64_t x = 0;
        for (; b[at] >= '0' && b[at] <= '9'; ++at) x = std::min<std::uint64_t>(10 * x + (b[at] - '0'), kLargest);
        return x;
    };
    const std::uint64_t width = number();
    return {width, number()};
}

ImageSize size_of_known(const Bytes& b) {
    if (b.begins(0, "\x89PNG\r\n\x1a\n")) return {b.big(16, 4), b.big(20, 4)};
    if (b.begins(0, "\xff\xd8\xff")) return jpeg_size(b);
    if (b.begins(0, std::string_view("II*\0", 4)) || b.begins(0, std::string_view("MM\0*", 4))) return tiff_size(b);
    if (b.begins(0, "RIFF") && b.begins(8, "WEBP")) return webp_size(b);
    if (b.begins(0, "BM")) return bmp_size(b);
    if (b[0] == 'P' && b[1] >= '1' && b[1] <= '6') return pnm_size(b);
    return {};
}

}  // namespace

std::optional<ImageSize> image_size(std::span<const std::uint8_t> bytes) {
    const ImageSize size = size_of_known(Bytes(bytes));
    return size.width > 0 && size.height > 0 ? std::optional(size) : std::nullopt;
}

}  // namespace narpa
