/// base/text/csv.h - reading lines of comma-separated values.
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"
#include "base/text/text_lines.h"
#include "base/text/text_number.h"

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

/// A line of a CSV file as spreadsheets write it. A cell may stand in quotes, with separators and doubled quotes
/// inside (RFC 4180).
class CsvRow {
public:
    std::vector<std::string_view> cells{};  ///< without the spaces and quotes around them
    int number = 0;                         ///< of the line in its file, from 1

    /// False if a quote is not closed, or text follows it.
    bool split(std::string_view line, char separator) {
        text_ = line, separator_ = separator;
        cells.clear();
        for (std::size_t at = 0; at <= text_.size();)
            if (!take_cell(at)) return false;
        return true;
    }
    /// The number that a cell is, NaN and infinity included. Where another character separates the cells, the
    /// decimal point may be a comma.
    [[nodiscard]] std::optional<double> number_in(std::string_view cell) const {
        const std::size_t comma = cell.find(',');
        if (separator_ == ',' || comma == cell.npos || cell.find('.') != cell.npos) return number_from(cell);
        std::string with_point(cell);
        with_point[comma] = '.';
        return number_from(with_point);
    }
    /// From 1.
    [[nodiscard]] int column_of(std::string_view cell) const {
        return static_cast<int>(cell.data() - text_.data()) + 1;
    }

private:
    /// The cell at `at`, which moves behind the separator that ends it.
    bool take_cell(std::size_t& at) {
        const std::size_t start = std::min(text_.find_first_not_of(' ', at), text_.size());
        if (start == text_.size() || text_[start] != '"') {
            const std::size_t end = std::min(text_.find(separator_, at), text_.size());
            cells.push_back(trimmed(std::string_view(text_).substr(at, end - at)));
            at = end + 1;
            return true;
        }
        std::size_t from = start + 1, to = from;
        for (; from < text_.size(); text_[to++] = text_[from++])
            if (text_[from] == '"' && (++from == text_.size() || text_[from] != '"')) break;
        const std::size_t end = std::min(text_.find(separator_, from), text_.size());
        const bool closed = text_[from - 1] == '"' && text_.find_first_not_of(' ', from) >= end;
        cells.push_back(std::string_view(text_).substr(start + 1, to - start - 1));
        at = end + 1;
        return closed;
    }

    std::string text_{};
    char separator_ = ',';
};

/// The character that separates the cells of a header line: comma, semicolon or tab; nullopt if they are not those
/// expected. Empty cells may follow.
[[nodiscard]] inline std::optional<char> separator_of(std::string_view header, std::string_view expected) {
    const std::vector<std::string_view> names = cells_of(expected);
    for (const char separator : {',', ';', '\t'}) {
        CsvRow row;
        if (!row.split(header, separator)) continue;
        while (row.cells.size() > names.size() && row.cells.back().empty()) row.cells.pop_back();
        if (row.cells == names) return separator;
    }
    return std::nullopt;
}

/// Calls `take(row)`, which returns a Status, with each CsvRow after the header; lines that are empty, have only
/// empty cells or begin with '#' are skipped. `what` and `item` are words for error messages, e.g. "a trajectory"
/// and "row". Errors: the file cannot be opened, has another header or no line after it; a quote that is not
/// closed; or an error of `take`.
template <class Take>
Status read_csv_rows(const std::string& file, std::string_view header, const std::string& what,
                     const std::string& item, const Take& take) {
    std::ifstream in(file);
    if (!in)
        return Error{std::string("cannot be opened (") + std::strerror(errno) + "), expected " + what + " (CSV)",
                     file};
    const std::size_t columns = cells_of(header).size();
    std::optional<char> separator;
    bool has_rows = false;
    CsvRow row;
    TextLines lines(in);
    for (std::string_view line; lines.next(line);) {
        if (line.empty() || line.front() == '#' || line.starts_with("\"#")) continue;
        row.number = lines.number();
        if (!separator) {
            if (line.size() == 5 && line.starts_with("sep=")) continue;  // a spreadsheet's
            separator = separator_of(line, header);
            if (!separator)
                return Error{"expected the header line \"" + std::string(header) + "\"", file, row.number, 1};
            continue;
        }
        if (!row.split(line, *separator))
            return Error{"expected a quote at the end of the cell, and a separator behind it", file, row.number,
                         row.column_of(row.cells.back())};
        if (line.find_first_not_of(" \t\"" + std::string(1, *separator)) == line.npos) continue;
        while (row.cells.size() > columns && row.cells.back().empty()) row.cells.pop_back();
        if (Status taken = take(std::as_const(row)); !taken) return taken;
        has_rows = true;
    }
    if (!has_rows) return Error{"no " + item + "s, expected a header line and at least one " + item, file};
    return Ok{};
}

}  // namespace narpa
