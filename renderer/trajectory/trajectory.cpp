#include "renderer/trajectory/trajectory.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/text/csv.h"
#include "renderer/trajectory/ccsds_message.h"
#include "renderer/trajectory/trajectory_description.h"

namespace narpa {
namespace {

constexpr int kTrajectoryColumns = 15;

Result<TrajectoryRow> read_trajectory_row(const CsvRow& csv, const std::string& path) {
    const auto bad = [&](std::string_view cell, std::string what) {
        return Error{std::move(what), path, csv.number, csv.column_of(cell)};
    };
    const std::vector<std::string_view>& cells = csv.cells;
    if (cells.size() != kTrajectoryColumns)
        return bad(cells.front(),
                   fmt::format("{} columns, expected {}: {}", cells.size(), kTrajectoryColumns, kTrajectoryHeader));
    std::array<double, kTrajectoryColumns> v{};
    for (std::size_t i = 0; i < kTrajectoryColumns; ++i) {
        if (i == 1) continue;
        const std::optional<double> number = csv.number_in(cells[i]);
        if (!number || !std::isfinite(*number))
            return bad(cells[i], fmt::format("\"{}\" where a finite number was expected", cells[i]));
        v[i] = *number;
    }
    if (std::abs(v[0]) > 9e9) return bad(cells[0], fmt::format("time {} s, expected less than 9e9 s", v[0]));
    if (cells[1].empty()) return bad(cells[1], "empty body name");

    TrajectoryRow row{std::llround(v[0] * 1e9), std::string(cells[1]), {}, csv.number};
    row.motion = {{{v[5], v[6], v[7], v[8]}, {v[2], v[3], v[4]}}, {v[9], v[10], v[11]}, {v[12], v[13], v[14]}};
    if (!accept_attitude(row.motion.T_world_body.q))
        return bad(cells[5], fmt::format("attitude of norm {:.6g}, expected a unit quaternion (w, x, y, z)",
                                         norm(Quat{v[5], v[6], v[7], v[8]})));
    return row;
}

}  // namespace

bool accept_attitude(Quat& q) noexcept {
    const double n = norm(q);
    if (!(std::abs(n - 1) <= 1e-3)) return false;
    if (std::abs(n - 1) > 1e-15) q = normalized(q);
    return true;
}

Result<std::vector<TrajectoryRow>> read_trajectory(const std::string& path) {
    const std::string_view format = format_of_poses(path);
    if (format == "TOML") return read_trajectory_description(path);
    if (!format.empty())
        return Error{
            fmt::format("{}, expected a CSV, or a trajectory description (TOML) that names orbit and attitude "
                        "ephemerides: docs/trajectories.md",
                        format),
            path, 1};
    std::vector<TrajectoryRow> rows;
    std::map<std::string, std::int64_t> last;
    const auto take = [&](const CsvRow& csv) -> Status {
        auto row = read_trajectory_row(csv, path);
        if (!row) return row.error();
        const auto [at, first] = last.try_emplace(row->body, row->t_ns);
        if (!first && row->t_ns <= at->second)
            return Error{fmt::format("time {} s of body \"{}\" does not come after its last row ({} s)",
                                     static_cast<double>(row->t_ns) * 1e-9, row->body,
                                     static_cast<double>(at->second) * 1e-9),
                         path, csv.number, 1};
        at->second = row->t_ns;
        rows.push_back(*std::move(row));
        return Ok{};
    };
    if (auto read = read_csv_rows(path, kTrajectoryHeader, "a trajectory", "row", take); !read) return read.error();
    return rows;
}

std::size_t format_trajectory_row(std::span<char> out, std::int64_t t_ns, std::string_view body,
                                  const Motion& m) noexcept {
    const Quat& q = m.T_world_body.q;
    const Vec3 &p = m.T_world_body.t, &v = m.velocity_m_s, &w = m.rate_rad_s;
    const std::uint64_t abs_ns = t_ns < 0 ? 0 - static_cast<std::uint64_t>(t_ns) : static_cast<std::uint64_t>(t_ns);
    const auto end =
        fmt::format_to_n(out.data(), out.size(), "{}{}.{:09},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n",
                         t_ns < 0 ? "-" : "", abs_ns / 1'000'000'000, abs_ns % 1'000'000'000, body, p.x, p.y, p.z,
                         q.w, q.x, q.y, q.z, v.x, v.y, v.z, w.x, w.y, w.z);
    return end.size <= out.size() ? end.size : 0;
}

}  // namespace narpa
