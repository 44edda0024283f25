#include "emulator/log/ledger_log.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <numeric>
#include <type_traits>
#include <utility>

#include "base/text/csv.h"
#include "base/text/read_number.h"
#include "protocols/ledger_fields.h"

namespace narpa {
namespace {

constexpr std::uint64_t kMaxSpp = 65535;

/// Rows are formatted into a buffer that may be too short: `size` counts on, and what does not fit is left out.
struct RowBuffer {
    std::span<char> out;
    std::size_t size = 0;

    template <class... Args>
    void add(fmt::format_string<Args...> format, Args&&... args) noexcept {
        const std::span<char> rest = out.subspan(std::min(size, out.size()));
        size += fmt::format_to_n(rest.data(), rest.size(), format, std::forward<Args>(args)...).size;
    }
};

void format_cell(RowBuffer& row, const LedgerField&, auto value) noexcept {
    row.add("{}", value);
}
void format_cell(RowBuffer& row, const LedgerField&, bool value) noexcept {
    row.add("{:d}", value);
}
template <class Named>
requires std::is_enum_v<Named>
void format_cell(RowBuffer& row, const LedgerField& field, Named value) noexcept {
    row.add("{}", field.signal.choices[static_cast<std::size_t>(value)].name);
}
/// "307200;614400", up to the last that is not 0
void format_cell(RowBuffer& row, const LedgerField&, const FrameLedger::Passes& passes) noexcept {
    const auto last = std::find_if(passes.rbegin(), passes.rend(), [](std::uint32_t n) { return n > 0; });
    const auto n = static_cast<std::size_t>(passes.rend() - last);
    for (std::size_t i = 0; i < n; ++i) row.add("{}{}", i > 0 ? ";" : "", passes[i]);
}

// Each reads a cell and returns what was expected where it is bad, else nothing.

template <class Whole>
std::string read_cell(std::string_view text, const LedgerField& field, Whole& value) {
    const auto choices = field.signal.choices;
    const bool good = read_number(text, value);
    if (!choices.empty())
        return good && std::cmp_less(value, choices.size())
                   ? ""
                   : fmt::format("a {}, 0 to {}", field.name, choices.size() - 1);
    return good ? "" : sizeof(Whole) == 1 ? "a whole number up to 255" : "a whole number";
}
std::string read_cell(std::string_view text, const LedgerField&, std::int64_t& t_ns) {
    return read_number(text, t_ns) ? "" : "whole nanoseconds";
}
std::string read_cell(std::string_view text, const LedgerField&, float& value) {
    return read_number(text, value) ? "" : "a number";
}
std::string read_cell(std::string_view text, const LedgerField&, bool& value) {
    value = text == "1";
    return value || text == "0" ? "" : "0 or 1";
}
template <class Named>
requires std::is_enum_v<Named> std::string read_cell(std::string_view text, const LedgerField& field,
                                                     Named& value) {
    const auto choices = field.signal.choices;
    std::string expected;
    for (std::size_t i = 0; i < choices.size(); ++i) {
        if (text == choices[i].name) return value = static_cast<Named>(i), "";
        expected += fmt::format("{}{}", i == 0 ? "" : i + 1 < choices.size() ? ", " : " or ", choices[i].name);
    }
    return expected;
}
std::string read_cell(std::string_view text, const LedgerField&, FrameLedger::Passes& passes) {
    constexpr const char* expected =
        "at most 8 numbers of samples as 65536;131072, together at most as many as the frame's";
    if (text.empty()) return "";
    const std::vector<std::string_view> cells = cells_of(text, ';');
    if (cells.size() > passes.size()) return expected;
    for (std::size_t i = 0; i < cells.size(); ++i)
        if (!read_number(cells[i], passes[i])) return expected;
    return passes[cells.size() - 1] > 0 ? "" : expected;
}

/// Checks a cell against the columns before it. Returns what was expected, or nothing.
std::string check_cell(const LedgerField& field, const FrameLedger& l) {
    if (field.name == "passes" && std::accumulate(l.passes.begin(), l.passes.end(), std::uint64_t{0}) > l.samples)
        return "numbers of samples, together at most as many as the frame's";
    if (field.name == "budget" && l.budget_kind == BudgetKind::samples && (l.budget < 1 || l.budget > kMaxSpp))
        return fmt::format("samples for each pixel, 1 to {}", kMaxSpp);
    if (field.name == "binning" && l.binning < 1) return "a whole number from 1 to 255";
    return "";
}

}  // namespace

const std::string& ledger_header() {
    static const std::string header = [] {
        std::string text;
        for (const LedgerField& field : kLedgerColumns) text += fmt::format("{},", field.name);
        return text + "image_crc32";
    }();
    return header;
}

std::uint32_t image_crc32(std::span<const std::uint8_t> bytes) noexcept {
    return static_cast<std::uint32_t>(::crc32_z(0, bytes.data(), bytes.size()));
}

std::size_t format_ledger_row(std::span<char> out, const FrameLedger& ledger, std::uint32_t crc32) noexcept {
    RowBuffer row{out};
    for (const LedgerField& field : kLedgerColumns) {
        visit_field(field, ledger, [&](const auto& value) { format_cell(row, field, value); });
        row.add(",");
    }
    row.add("{:08x}\n", crc32);
    return row.size <= out.size() ? row.size : 0;
}

Result<std::vector<LoggedFrame>> read_ledger_log(const std::string& path) {
    const auto bad = [&](int line, std::ptrdiff_t column, std::string what) {
        return Error{std::move(what), path, line, static_cast<int>(column)};
    };
    std::ifstream in(path);
    if (!in) return bad(0, 0, "cannot be read, expected the ledger log of a camera");
    TextLines lines(in);
    std::string_view line;
    if (!lines.next(line) || line != ledger_header())
        return bad(1, 1, fmt::format("expected the header line \"{}\"", ledger_header()));
    constexpr std::size_t columns = kLedgerColumns.size() + 1;
    std::vector<LoggedFrame> frames;
    while (lines.next(line)) {
        const int number = lines.number();
        const std::vector<std::string_view> cells = cells_of(line);
        if (cells.size() != columns)
            return bad(number, 1,
                       fmt::format("{} columns, expected {}: {}", cells.size(), columns, ledger_header()));
        LoggedFrame frame;
        frame.line = number;
        const auto bad_cell = [&](std::string_view name, std::string_view cell, std::string_view expected) {
            return bad(number, cell.data() - line.data() + 1,
                       fmt::format("{}: \"{}\", expected {}", name, cell, expected));
        };
        for (std::size_t i = 0; i < kLedgerColumns.size(); ++i) {
            const LedgerField& field = kLedgerColumns[i];
            std::string expected;
            visit_field(field, frame.ledger, [&](auto& value) { expected = read_cell(cells[i], field, value); });
            if (expected.empty()) expected = check_cell(field, frame.ledger);
            if (!expected.empty()) return bad_cell(field.name, cells[i], expected);
        }
        if (cells.back().size() != 8 || !read_number(cells.back(), frame.image_crc32, 16))
            return bad_cell("image_crc32", cells.back(), "8 hexadecimal digits");
        frames.push_back(frame);
    }
    return frames;
}

}  // namespace narpa
