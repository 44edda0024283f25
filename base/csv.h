/// base/csv.h - reading lines of comma-separated values.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/read_number.h"
#include "base/result.h"

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

/// Removes leading and trailing spaces and tabs.
[[nodiscard]] inline std::string_view trimmed(std::string_view text) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
    return text.substr(0, text.find_last_not_of(" \t") + 1);
}

/// Calls `take(line, number)`, which returns a Status, with each line after the header; lines that are empty or
/// begin with '#' are skipped. `what` and `item` are words for error messages, e.g. "a trajectory" and "row".
/// Errors: the file cannot be opened, has another header or no line after it; or an error of `take`.
template <class Take>
Status read_csv_lines(const std::string& file, std::string_view header, const std::string& what,
                      const std::string& item, const Take& take) {
    std::ifstream in(file);
    if (!in)
        return Error{std::string("cannot be opened (") + std::strerror(errno) + "), expected " + what + " (CSV)",
                     file};
    bool has_header = false, has_lines = false;
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
        if (!line.empty() && line.back() == '\r') line.pop_back();
        if (line.empty() || line.front() == '#') continue;
        if (!has_header) {
            if (line != header)
                return Error{"expected the header line \"" + std::string(header) + "\"", file, number, 1};
            has_header = true;
            continue;
        }
        if (Status taken = take(std::string_view(line), number); !taken) return taken;
        has_lines = true;
    }
    if (!has_lines) return Error{"no " + item + "s, expected a header line and at least one " + item, file};
    return Ok{};
}

}  // namespace narpa
