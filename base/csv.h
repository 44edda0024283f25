/// base/csv.h - reading lines of comma-separated values.
#pragma once

#include <algorithm>
#include <string_view>
#include <vector>

#include "base/read_number.h"

namespace narpa {

[[nodiscard]] inline std::vector<std::string_view> cells_of(std::string_view line, char separator = ',') {
    std::vector<std::string_view> cells;
    for (std::size_t start = 0;;) {
        const std::size_t end = std::min(line.find(separator, start), line.size());
        cells.push_back(line.substr(start, end - start));
        if (end == line.size()) return cells;
        start = end + 1;
    }
}

/// Without the spaces and tabs around it.
[[nodiscard]] inline std::string_view trimmed(std::string_view text) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
    return text.substr(0, text.find_last_not_of(" \t") + 1);
}

}  // namespace narpa
