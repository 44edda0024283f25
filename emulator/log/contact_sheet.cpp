#include "emulator/log/contact_sheet.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

#include "plot/plot.h"
#include "renderer/image/image_file.h"

namespace narpa {
namespace {

constexpr int kThumbnailWidth = 320;

/// Blue, green, red of one pixel, 0..255, as the format carries them.
std::array<int, 3> pixel(const VideoFormat& f, std::span<const std::uint8_t> bytes, int x, int y) {
    const std::size_t size = bytes_per_pixel(f.pixel);
    const auto at = [&](int column, int row) {
        return (static_cast<std::size_t>(row) * static_cast<std::size_t>(f.width) +
                static_cast<std::size_t>(column)) *
               size;
    };
    const std::size_t i = at(x, y), high = is_16_bit(f.pixel) ? 1 : 0;
    if (is_mono(f.pixel)) return {bytes[i + high], bytes[i + high], bytes[i + high]};
    if (f.pixel == PixelFormat::rgb24) return {bytes[i + 2], bytes[i + 1], bytes[i]};
    if (is_bayer(f.pixel)) {  // the colour of its 2 x 2 pixels
        std::array<int, 3> sum{};
        for (int k = 0; k < 4; ++k) {
            const int column = (x & ~1) + k % 2, row = (y & ~1) + k / 2;
            sum[2 - bayer_band(f.pixel, column, row)] += bytes[at(column, row) + high];
        }
        return {sum[0], sum[1] / 2, sum[2]};
    }
    const std::size_t pair = i & ~std::size_t{3};  // Y0 U Y1 V; BT.601 limited range
    const double luma = 1.164 * (bytes[i] - 16), u = bytes[pair + 1] - 128.0, v = bytes[pair + 3] - 128.0;
    const auto byte = [](double c) { return static_cast<int>(std::clamp(c, 0.0, 255.0)); };
    return {byte(luma + 2.017 * u), byte(luma - 0.392 * u - 0.813 * v), byte(luma + 1.596 * v)};
}

cv::Mat srgb_curve() {
    cv::Mat table(1, 256, CV_8U);
    for (int i = 0; i < 256; ++i) table.at<std::uint8_t>(i) = srgb_byte(i / 255.0);
    return table;
}

}  // namespace

ContactSheet::ContactSheet(const VideoFormat& format)
    : format_(format),
      scale_(std::max(1, (format.width + kThumbnailWidth - 1) / kThumbnailWidth)),
      width_(format.width / scale_),
      height_(std::max(1, format.height / scale_)),
      tiles_(kTiles),
      times_ns_(kTiles) {
    for (auto& tile : tiles_) tile.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_) * 3);
}

void ContactSheet::offer(std::uint64_t frame, std::int64_t t_mid_ns, std::span<const std::uint8_t> bytes) noexcept {
    if (frame % stride_ != 0) return;
    if (used_ == tiles_.size()) thin_out();
    if (frame % stride_ != 0) return;
    shrink(bytes, tiles_[used_]);
    times_ns_[used_++] = t_mid_ns;
}

void ContactSheet::thin_out() noexcept {
    for (std::size_t i = 0; 2 * i < used_; ++i)
        std::swap(tiles_[i], tiles_[2 * i]), std::swap(times_ns_[i], times_ns_[2 * i]);
    used_ = (used_ + 1) / 2;
    stride_ *= 2;
}

void ContactSheet::shrink(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> bgr) const noexcept {
    // A thumbnail's pixel is the mean of at most 2 x 2 source pixels, evenly spread over its block: reading all
    // four million pixels of a frame takes 37 ms.
    const int side = std::min(scale_, 2), area = side * side;
    const auto at = [&](int i, int k) { return i * scale_ + (2 * k + 1) * scale_ / (2 * side); };
    for (int y = 0; y < height_; ++y) {
        for (int x = 0; x < width_; ++x) {
            std::array<int, 3> sum{};
            for (int k = 0; k < area; ++k) {
                const auto p = pixel(format_, bytes, at(x, k % side), at(y, k / side));
                for (std::size_t c = 0; c < 3; ++c) sum[c] += p[c];
            }
            std::uint8_t* out = &bgr[3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                                          static_cast<std::size_t>(x))];
            for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<std::uint8_t>(sum[c] / area);
        }
    }
}

Status ContactSheet::write(const std::string& path) const {
    if (used_ == 0) return Ok{};
    const int rows = static_cast<int>((used_ + kColumns - 1) / kColumns), gap = 4;
    const int columns = std::min<int>(kColumns, static_cast<int>(used_));
    cv::Mat sheet(rows * (height_ + gap) + gap, columns * (width_ + gap) + gap, CV_8UC3, cv::Scalar(48, 48, 48));
    for (std::size_t i = 0; i < used_; ++i) {
        const int x = gap + static_cast<int>(i % kColumns) * (width_ + gap);
        const int y = gap + static_cast<int>(i / kColumns) * (height_ + gap);
        cv::Mat tile(height_, width_, CV_8UC3, const_cast<std::uint8_t*>(tiles_[i].data())), shown;
        cv::LUT(tile, srgb_curve(), shown);
        const double t_s = static_cast<double>(times_ns_[i]) * 1e-9;
        for (const auto& [colour, width] : {std::pair{cv::Scalar::all(0), 3}, std::pair{cv::Scalar::all(255), 1}})
            cv::putText(shown, fmt::format("{:.2f} s", t_s), {4, height_ - 6}, cv::FONT_HERSHEY_SIMPLEX, 0.4,
                        colour, width, cv::LINE_AA);
        shown.copyTo(sheet(cv::Rect(x, y, width_, height_)));
    }
    return write_png(path, sheet);
}

}  // namespace narpa
