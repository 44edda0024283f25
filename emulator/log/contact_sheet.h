/// emulator/log/contact_sheet.h - a run at a glance: up to 24 of a camera's frames, evenly spread, row by row in
/// one image, each with its time. The number of frames need not be known: when the sheet is full, every other tile
/// is dropped and the stride doubles. All memory is allocated at the start.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/pixel_format.h"
#include "base/result.h"

namespace narpa {

class ContactSheet {
public:
    explicit ContactSheet(const VideoFormat& format);

    /// Adds the frame, whose exposure has this middle, if its number is a multiple of the stride. Allocates
    /// nothing.
    void offer(std::uint64_t frame, std::int64_t t_mid_ns, std::span<const std::uint8_t> bytes) noexcept;
    /// Writes the sheet as PNG, linear values encoded by the sRGB curve. No file without frames.
    [[nodiscard]] Status write(const std::string& path) const;

    static constexpr int kTiles = 24, kColumns = 6;

private:
    void thin_out() noexcept;
    void shrink(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> bgr) const noexcept;

    VideoFormat format_;
    int scale_, width_, height_;                    ///< source pixels per thumbnail pixel; thumbnail size
    std::vector<std::vector<std::uint8_t>> tiles_;  ///< blue, green, red
    std::vector<std::int64_t> times_ns_;            ///< of each tile's frame
    std::size_t used_ = 0;
    std::uint64_t stride_ = 1;
};

}  // namespace narpa
