/// emulator/log/csv.h - reading lines of comma-separated values.
#pragma once

#include <algorithm>
#include <charconv>
#include <string_view>
#include <vector>

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

/// The whole text is the number; `base`: of integers.
template <class... Base>
[[nodiscard]] bool read_number(std::string_view text, auto& value, Base... base) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base...);
    return error == std::errc{} && end == text.data() + text.size();
}

}  // namespace narpa
