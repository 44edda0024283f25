#include "renderer/camera/read_out.h"

#include <algorithm>

namespace narpa {
namespace {

/// The samples of an image; a pixel has `bands` of them, a sample one or two bytes, little-endian.
struct Samples {
    std::span<std::uint8_t> bytes;
    std::size_t width, bands, size;

    [[nodiscard]] std::uint8_t* at(std::size_t x, std::size_t y, std::size_t band) const noexcept {
        return &bytes[((y * width + x) * bands + band) * size];
    }
    [[nodiscard]] std::uint32_t get(std::size_t x, std::size_t y, std::size_t band) const noexcept {
        const std::uint8_t* const s = at(x, y, band);
        return size == 2 ? s[0] + 256u * s[1] : s[0];
    }
    void put(std::size_t x, std::size_t y, std::size_t band, std::uint32_t value) const noexcept {
        std::uint8_t* const s = at(x, y, band);
        s[0] = static_cast<std::uint8_t>(value);
        if (size == 2) s[1] = static_cast<std::uint8_t>(value >> 8);
    }
};

void bin(const Samples& image, const Region& region, std::size_t n) noexcept {
    const std::size_t right = region.x + region.width, bottom = region.y + region.height;
    for (std::size_t top = region.y; top < bottom; top += n)
        for (std::size_t left = region.x; left < right; left += n)
            for (std::size_t band = 0; band < image.bands; ++band) {
                const std::size_t x_end = std::min(left + n, right), y_end = std::min(top + n, bottom);
                std::uint32_t sum = 0, count = 0;
                for (std::size_t y = top; y < y_end; ++y)
                    for (std::size_t x = left; x < x_end; ++x) sum += image.get(x, y, band), ++count;
                const std::uint32_t mean = (sum + count / 2) / count;
                for (std::size_t y = top; y < y_end; ++y)
                    for (std::size_t x = left; x < x_end; ++x) image.put(x, y, band, mean);
            }
}

}  // namespace

void fill_black(PixelFormat format, std::span<std::uint8_t> bytes) noexcept {
    for (std::size_t i = 0; i < bytes.size(); ++i)
        bytes[i] = format != PixelFormat::yuyv ? 0 : i % 2 == 0 ? 16 : 128;
}

void read_out(const VideoFormat& format, const Region& region, int binning,
              std::span<std::uint8_t> bytes) noexcept {
    const std::size_t pixel = bytes_per_pixel(format.pixel), row = pixel * static_cast<std::size_t>(format.width);
    const std::size_t height = static_cast<std::size_t>(format.height), bottom = region.y + region.height;
    const bool whole =
        region == Region{0, 0, static_cast<std::uint16_t>(format.width), static_cast<std::uint16_t>(format.height)};
    if (!whole) {
        fill_black(format.pixel, bytes.first(region.y * row));
        for (std::size_t y = region.y; y < bottom; ++y) {
            const std::span line = bytes.subspan(y * row, row);
            fill_black(format.pixel, line.first(region.x * pixel));
            fill_black(format.pixel, line.subspan((region.x + region.width) * pixel));
        }
        fill_black(format.pixel, bytes.subspan(bottom * row, (height - bottom) * row));
    }
    if (binning > 1 && can_bin(format.pixel)) {
        const std::size_t size = is_16_bit(format.pixel) ? 2 : 1;
        bin({bytes, static_cast<std::size_t>(format.width), pixel / size, size}, region,
            static_cast<std::size_t>(binning));
    }
}

double mean_level(const VideoFormat& format, const Region& region, std::span<const std::uint8_t> bytes) noexcept {
    const std::size_t pixel = bytes_per_pixel(format.pixel), row = pixel * static_cast<std::size_t>(format.width);
    // The high byte of each sample is enough.
    const std::size_t step = is_16_bit(format.pixel) || format.pixel == PixelFormat::yuyv ? 2 : 1;
    const std::size_t offset = is_16_bit(format.pixel) ? 1 : 0;
    std::uint64_t sum = 0, count = 0;
    for (std::size_t y = region.y; y < std::size_t{region.y} + region.height; ++y) {
        const std::span line = bytes.subspan(y * row + region.x * pixel, region.width * pixel);
        for (std::size_t i = offset; i < line.size(); i += step) sum += line[i], ++count;
    }
    return count == 0 ? 0 : static_cast<double>(sum) / (255.0 * static_cast<double>(count));
}

}  // namespace narpa
