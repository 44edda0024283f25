#include "emulator/log/ledger_log.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>

namespace narpa {
namespace {

constexpr std::uint64_t kMostSpp = 65535;

/// "307200;614400": the passes after the first, as a replay needs them.
std::size_t format_passes(std::span<char> out, const FrameLedger& ledger) noexcept {
    std::size_t size = 0;
    for (const std::uint32_t samples : ledger.passes) {
        if (samples == 0) break;
        size += fmt::format_to_n(out.data() + size, out.size() - size, "{}{}", size > 0 ? ";" : "", samples).size;
    }
    return size;
}

std::vector<std::string_view> cells_of(std::string_view line, char separator) {
    std::vector<std::string_view> cells;
    for (std::size_t start = 0;;) {
        const std::size_t end = std::min(line.find(separator, start), line.size());
        cells.push_back(line.substr(start, end - start));
        if (end == line.size()) return cells;
        start = end + 1;
    }
}

template <class... Base>
bool read_whole(std::string_view text, auto& value, Base... base) {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base...);
    return error == std::errc{} && end == text.data() + text.size();
}
bool read(std::string_view text, auto& value) {
    return read_whole(text, value);
}
bool read(std::string_view text, bool& value) {
    value = text == "1";
    return value || text == "0";
}
template <class Named, std::size_t N>
bool read_name(std::string_view text, const std::array<std::string_view, N>& names, Named& value) {
    const auto found = std::find(names.begin(), names.end(), text);
    value = static_cast<Named>(found - names.begin());
    return found != names.end();
}
/// A budget in samples for each pixel is as large as a scene may ask for.
bool read_budget(std::string_view text, FrameLedger& l) {
    return read(text, l.budget) &&
           (l.budget_kind != BudgetKind::samples || (l.budget >= 1 && l.budget <= kMostSpp));
}
bool read_passes(std::string_view text, FrameLedger& l) {
    if (text.empty()) return true;
    const std::vector<std::string_view> cells = cells_of(text, ';');
    if (cells.size() > l.passes.size()) return false;
    std::uint64_t sum = 0;
    for (std::size_t i = 0; i < cells.size(); ++i) {
        if (!read(cells[i], l.passes[i]) || l.passes[i] == 0) return false;
        sum += l.passes[i];
    }
    return sum <= l.samples;
}

struct Column {
    std::string_view expected;
    bool (*read)(std::string_view text, LoggedFrame& frame);
};
constexpr std::string_view kWhole = "a whole number", kTime = "whole nanoseconds", kFlag = "0 or 1";

/// In the order of kLedgerHeader.
constexpr std::array<Column, 22> kColumns{{
    {kWhole, [](auto text, auto& f) { return read(text, f.ledger.frame); }},
    {"a whole number up to 255", [](auto text, auto& f) { return read(text, f.ledger.pose_counter); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_pose_ns); }},
    {kFlag, [](auto text, auto& f) { return read(text, f.ledger.pose_stale); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_exposure_start_ns); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_exposure_mid_ns); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_exposure_end_ns); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_render_start_ns); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_render_end_ns); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_hand_over_ns); }},
    {kTime, [](auto text, auto& f) { return read(text, f.ledger.t_deadline_ns); }},
    {kFlag, [](auto text, auto& f) { return read(text, f.ledger.deadline_met); }},
    {"frame, nothing, repeated or blank",
     [](auto text, auto& f) { return read_name(text, kDeliveries, f.ledger.delivery); }},
    {"a step, 0 to 5",
     [](auto text, auto& f) { return read(text, f.ledger.step) && f.ledger.step < kStepNames.size(); }},
    {kWhole, [](auto text, auto& f) { return read(text, f.ledger.samples); }},
    {"a number", [](auto text, auto& f) { return read(text, f.ledger.samples_per_pixel); }},
    {kWhole, [](auto text, auto& f) { return read(text, f.ledger.rays); }},
    {"at most 8 numbers of samples as 65536;131072, together at most as many as the frame's",
     [](auto text, auto& f) { return read_passes(text, f.ledger); }},
    {"samples, rays or time",
     [](auto text, auto& f) { return read_name(text, kBudgetKinds, f.ledger.budget_kind); }},
    {"a whole number, of samples 1 to 65535", [](auto text, auto& f) { return read_budget(text, f.ledger); }},
    {"a number", [](auto text, auto& f) { return read(text, f.ledger.expected_error); }},
    {"8 hexadecimal digits",
     [](auto text, auto& f) { return text.size() == 8 && read_whole(text, f.image_crc32, 16); }},
}};

}  // namespace

std::uint32_t image_crc32(std::span<const std::uint8_t> bytes) noexcept {
    return static_cast<std::uint32_t>(::crc32_z(0, bytes.data(), bytes.size()));
}

std::size_t format_ledger_row(std::span<char> out, const FrameLedger& l, std::uint32_t crc32) noexcept {
    std::array<char, 11 * FrameLedger::kPasses> text;
    const std::string_view passes(text.data(), format_passes(text, l));
    const auto end = fmt::format_to_n(
        out.data(), out.size(), "{},{},{},{:d},{},{},{},{},{},{},{},{:d},{},{},{},{},{},{},{},{},{},{:08x}\n",
        l.frame, l.pose_counter, l.t_pose_ns, l.pose_stale, l.t_exposure_start_ns, l.t_exposure_mid_ns,
        l.t_exposure_end_ns, l.t_render_start_ns, l.t_render_end_ns, l.t_hand_over_ns, l.t_deadline_ns,
        l.deadline_met, kDeliveries[static_cast<std::size_t>(l.delivery)], l.step, l.samples, l.samples_per_pixel,
        l.rays, passes, kBudgetKinds[static_cast<std::size_t>(l.budget_kind)], l.budget, l.expected_error, crc32);
    return end.size <= out.size() ? end.size : 0;
}

Result<std::vector<LoggedFrame>> read_ledger_log(const std::string& path) {
    const auto bad = [&](int line, int column, std::string what) {
        return Error{std::move(what), path, line, column};
    };
    std::ifstream in(path);
    std::string line;
    if (!in) return bad(0, 0, "cannot be read, expected the ledger log of a camera");
    if (!std::getline(in, line) || line != kLedgerHeader)
        return bad(1, 1, fmt::format("expected the header line \"{}\"", kLedgerHeader));
    std::vector<LoggedFrame> frames;
    for (int number = 2; std::getline(in, line); ++number) {
        const std::vector<std::string_view> cells = cells_of(line, ',');
        if (cells.size() != kColumns.size())
            return bad(number, 1,
                       fmt::format("{} columns, expected {}: {}", cells.size(), kColumns.size(), kLedgerHeader));
        LoggedFrame frame;
        frame.line = number;
        for (std::size_t i = 0; i < cells.size(); ++i)
            if (!kColumns[i].read(cells[i], frame))
                return bad(number, static_cast<int>(cells[i].data() - line.data()) + 1,
                           fmt::format("{}: \"{}\", expected {}", cells_of(kLedgerHeader, ',')[i], cells[i],
                                       kColumns[i].expected));
        frames.push_back(frame);
    }
    return frames;
}

}  // namespace narpa
