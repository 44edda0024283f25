#include "emulator/log/sweep_log.h"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <utility>

#include "base/text/csv.h"
#include "base/text/read_number.h"

namespace narpa {
namespace {

/// Lines that the ring holds: 0.4 s of a VLP-16, 0.05 to 0.1 s of an OS1-128.
constexpr std::size_t kShotLines = 1 << 17;

template <class... Args>
std::size_t format_row(std::span<char> out, fmt::format_string<Args...> format, Args&&... args) noexcept {
    return std::min(out.size(), fmt::format_to_n(out.data(), out.size(), format, std::forward<Args>(args)...).size);
}

}  // namespace

Result<std::vector<LoggedSweep>> read_sweep_log(const std::string& path) {
    const auto bad = [&](int line, std::ptrdiff_t column, std::string what) {
        return Error{std::move(what), path, line, static_cast<int>(column)};
    };
    constexpr std::string_view header = kSweepHeader.substr(0, kSweepHeader.size() - 1);
    std::ifstream in(path);
    if (!in) return bad(0, 0, "cannot be read, expected the log of a LiDAR's sweeps");
    TextLines lines(in);
    std::string_view line;
    if (!lines.next(line) || line != header)
        return bad(1, 1, fmt::format("expected the header line \"{}\"", header));
    std::vector<LoggedSweep> sweeps;
    while (lines.next(line)) {
        LoggedSweep& logged = sweeps.emplace_back();
        logged.line = lines.number();
        SweepLedger& s = logged.ledger;
        const std::vector<std::string_view> cells = cells_of(line);
        std::size_t i = 0;
        const auto read = [&](auto&... values) {
            return ((i < cells.size() && read_number(cells[i], values) && ++i > 0) && ...);
        };
        const bool good = read(s.sweep, s.t_first_shot_ns, s.t_last_shot_ns, s.packets, s.late, s.skipped, s.shots,
                               s.returns, s.t_complete_ns, s.t_hand_over_ns, s.hand_over_max_ns, s.packets_crc32,
                               s.utc_offset_ns, s.utc_error_ns, s.lost);
        if (good && i == cells.size()) continue;
        const std::ptrdiff_t column = i < cells.size() ? cells[i].data() - line.data() + 1 : 1;
        return bad(logged.line, column, fmt::format("expected whole numbers: {}", header));
    }
    return sweeps;
}

ShotRow shot_row(const LidarUnit& unit, std::int64_t packet, std::size_t i) noexcept {
    const LidarShot& s = unit.shots()[i];
    const LidarReturn& r = unit.truth()[i];
    const auto [first, second] = unit.echoes()[i].reported(unit.spec().returns);
    return {.t_ns = unit.packet_start_ns(packet) + s.t_offset_ns,
            .packet = packet,
            .block = s.block,
            .laser = s.beam,
            .azimuth_rad = s.azimuth_rad,
            .elevation_rad = s.elevation_rad,
            .range_m = r.range_m,
            .position_m = s.origin_m + r.range_m * s.direction,
            .reflectivity = r.reflectivity,
            .body = r.range_m > 0 ? r.body : -1,
            .incidence_rad = std::acos(std::clamp(static_cast<double>(r.cos_incidence), 0.0, 1.0)),
            .velocity_m_s = r.velocity_m_s,
            .reported_range_m = first.range_m,
            .reported_reflectivity = first.reflectivity,
            .reported_velocity_m_s = first.velocity_m_s,
            .second_range_m = second.range_m,
            .second_reflectivity = second.reflectivity};
}

std::size_t format_shot_row(std::span<char> out, const LidarUnit& unit, std::int64_t packet,
                            std::size_t i) noexcept {
    const ShotRow s = shot_row(unit, packet, i);
    return format_row(out, "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", s.t_ns, s.packet, s.block,
                      s.laser, s.azimuth_rad, s.elevation_rad, s.range_m, s.position_m.x, s.position_m.y,
                      s.position_m.z, s.reflectivity, s.body, s.incidence_rad, s.velocity_m_s, s.reported_range_m,
                      s.reported_reflectivity, s.reported_velocity_m_s, s.second_range_m, s.second_reflectivity);
}

Result<std::unique_ptr<SweepLog>> SweepLog::create(const std::string& folder, const std::string& lidar, bool shots,
                                                   bool wait_when_full) {
    auto log = std::make_unique<SweepLog>();
    auto sweeps = RowLog::create(folder + "/" + lidar + ".sweeps.csv", kSweepHeader, wait_when_full);
    if (!sweeps) return sweeps.error();
    log->sweeps_ = *std::move(sweeps);
    if (shots) {
        auto rows = RowLog::create(folder + "/" + lidar + ".shots.csv", kShotHeader, wait_when_full, kShotLines);
        if (!rows) return rows.error();
        log->shots_ = *std::move(rows);
    }
    return log;
}

void SweepLog::add(const LidarUnit& unit, std::int64_t packet, std::int64_t t_due_ns, std::int64_t t_sent_ns,
                   const RunUtc& utc, bool late, std::uint64_t lost) noexcept {
    const std::int64_t sweep = unit.sweep(packet), start_ns = unit.packet_start_ns(packet);
    if (sweep_.packets > 0 && sweep != sweep_.sweep) write_sweep(lost);
    if (sweep_.packets == 0) {
        sweep_ = {};
        sweep_.sweep = sweep;
        sweep_.t_first_shot_ns = start_ns + unit.shots().front().t_offset_ns;
    }
    ++sweep_.packets;
    sweep_.late += late ? 1 : 0;
    sweep_.shots += unit.shots().size();
    sweep_.returns += unit.returns();
    sweep_.t_last_shot_ns = start_ns + unit.shots().back().t_offset_ns;
    sweep_.t_complete_ns = t_due_ns;
    sweep_.t_hand_over_ns = t_sent_ns;
    sweep_.utc_offset_ns = utc.zero_unix_ns, sweep_.utc_error_ns = utc.error_ns;
    sweep_.hand_over_max_ns = std::max(sweep_.hand_over_max_ns, t_sent_ns - t_due_ns);
    sweep_.packets_crc32 = static_cast<std::uint32_t>(
        ::crc32(sweep_.packets_crc32, unit.bytes().data(), static_cast<uInt>(unit.bytes().size())));
    if (!shots_) return;
    std::array<char, RowLog::kMaxLine> row;
    for (std::size_t i = 0; i < unit.shots().size(); ++i)
        shots_->append({row.data(), format_shot_row(row, unit, packet, i)});
}

void SweepLog::write_sweep(std::uint64_t lost) noexcept {
    sweep_.lost = lost - std::exchange(lost_before_, lost);
    const SweepLedger& s = sweep_;
    std::array<char, RowLog::kMaxLine> row;
    sweeps_->append(
        {row.data(), format_row(row, "{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", s.sweep, s.t_first_shot_ns,
                                s.t_last_shot_ns, s.packets, s.late, s.skipped, s.shots, s.returns, s.t_complete_ns,
                                s.t_hand_over_ns, s.hand_over_max_ns, s.packets_crc32, s.utc_offset_ns,
                                s.utc_error_ns, s.lost)});
    sweep_ = {};
}

Status SweepLog::close(std::uint64_t lost) {
    if (sweep_.packets > 0) write_sweep(lost);
    Status sweeps = sweeps_->close();
    const Status shots = shots_ ? shots_->close() : Status{Ok{}};
    return sweeps ? shots : sweeps;
}

}  // namespace narpa
