/// emulator/log/zstd_frame.h - compression of logs with zstd.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace narpa {

/// Replaces `to` by a zstd frame of `from`. `level`: of zstd, 1 is fast. Keeps its memory between calls.
[[nodiscard]] std::function<void(std::span<const std::uint8_t> from, std::vector<std::uint8_t>& to)> zstd_frames(
    int level);

}  // namespace narpa
