/// emulator/log/contact_sheet.h - a run at a glance: up to 24 of a camera's frames, evenly spread, on one picture.
///
/// The number of frames need not be known: when the sheet is full every other picture makes room and the stride
/// doubles. All memory is taken at the start.
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

    /// Takes the frame if its turn has come. Allocates nothing.
    void offer(std::uint64_t frame, std::int64_t t_ns, std::span<const std::uint8_t> bytes) noexcept;
    /// Writes the sheet as PNG, for eyes: linear values shown with the sRGB curve. Nothing taken: no file.
    [[nodiscard]] Status write(const std::string& path) const;

    static constexpr int kTiles = 24, kColumns = 6;

private:
    struct Tile {
        std::int64_t t_ns = 0;
        std::vector<std::uint8_t> bgr;
    };
    void thin_out() noexcept;
    void shrink(std::span<const std::uint8_t> bytes, std::span<std::uint8_t> bgr) const noexcept;

    VideoFormat format_;
    int scale_, width_, height_;  ///< source pixels per thumbnail pixel; thumbnail size
    std::vector<Tile> tiles_;
    std::size_t used_ = 0;
    std::uint64_t stride_ = 1;
};

}  // namespace narpa
