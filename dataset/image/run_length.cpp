#include "dataset/image/run_length.h"

namespace narpa::dataset {

std::vector<std::uint32_t> runs_of(std::span<const std::int32_t> values, int width, int height,
                                   std::int32_t value) {
    std::vector<std::uint32_t> runs{0};
    bool inside = false;
    for (int x = 0; x < width; ++x)
        for (int y = 0; y < height; ++y) {
            const bool is_in = values[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                      static_cast<std::size_t>(x)] == value;
            if (is_in != inside) runs.push_back(0);
            inside = is_in;
            ++runs.back();
        }
    return runs;
}

std::string run_length_text(std::span<const std::uint32_t> runs) {
    constexpr std::int64_t kGroup = 0x1f, kSign = 0x10, kMore = 0x20, kFirst = 48;
    std::string text;
    for (std::size_t i = 0; i < runs.size(); ++i) {
        std::int64_t left = runs[i];
        if (i > 2) left -= runs[i - 2];
        for (bool more = true; more;) {
            std::int64_t c = left & kGroup;
            left >>= 5;
            more = (c & kSign) != 0 ? left != -1 : left != 0;
            if (more) c |= kMore;
            text += static_cast<char>(kFirst + c);
        }
    }
    return text;
}

}  // namespace narpa::dataset
