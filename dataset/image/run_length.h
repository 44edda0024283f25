/// dataset/image/run_length.h - masks as COCO stores them: run-length encoding down the columns.
///
/// Format: lengths of runs of pixels outside and inside by turns, from the top left, down each column; then each
/// length from the fourth on as its difference from the one two before it; then each number in groups of five bits,
/// lowest first, as characters: 48 + group + (32 if another group follows). The last group's bit 4 is the sign
/// (COCO's format "compressed RLE", which its API pycocotools reads).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace narpa::dataset {

/// The runs of pixels that have this value; `values`: row by row, width x height.
[[nodiscard]] std::vector<std::uint32_t> runs_of(std::span<const std::int32_t> values, int width, int height,
                                                 std::int32_t value);
[[nodiscard]] std::string run_length_text(std::span<const std::uint32_t> runs);

}  // namespace narpa::dataset
