#include "renderer/scene_file/lidar_description.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/constants.h"
#include "base/text/csv.h"
#include "protocols/lidar/pattern_lidar.h"
#include "renderer/keys/toml_file.h"

namespace narpa {
namespace {

constexpr Range kAzimuth_deg{.low = -720, .high = 720}, kElevation_deg{.low = -90, .high = 90},
    kPhase{.low = 0, .high = 1, .high_open = true};

constexpr Range kRate{.low = 0, .high = 1e4, .low_open = true}, kShare{.low = 0, .high = 1, .low_open = true};
constexpr int kMaxBeams = 256;

/// Whether cells have equal steps of the tangent or of the angle across the field of view.
enum class Spacing : std::uint8_t { tangents, angles };
enum class Scan : std::uint8_t { flash, rows, columns };
constexpr std::array<std::string_view, 2> kSpacingNames{"tangents", "angles"};
constexpr std::array<std::string_view, 3> kScanNames{"flash", "rows", "columns"};

constexpr TableKey kHeadRows[]{
    {"based_on", rows::file()},
    {"name", rows::text(), "a text"},
    {"rate_hz", rows::number(kRate), "frames a second"},
    {"range_max_m", rows::number({.low = 0, .high = 1e3 * UINT32_MAX, .low_open = true}), "the rated range"},
    {"rate_hz_min", rows::number(kRate)},
    {"rate_hz_max", rows::number(kRate)},
    {"range_resolution_m", rows::number({.low = 0, .high = 1e3, .low_open = true})},
    {"velocity_resolution_m_s", rows::number({.low = 0, .high = 1e3})},
    {"dual", rows::boolean()},
    {"latency_s", rows::number({.low = 0, .high = LidarPattern::kLongest_s})},
    {"data_port", rows::integer(1, 65535)},
    {"shots", rows::file()},
};
constexpr TableKey kGridRows[]{
    {"columns", rows::integer(1, 65535), "a count"},
    {"rows", rows::integer(1, 65535), "a count"},
    {"fov_horizontal_deg", rows::number({.low = 0, .high = 360, .low_open = true}), "an angle"},
    {"fov_vertical_deg", rows::number({.low = 0, .high = 180, .low_open = true}), "an angle"},
    {"spacing", rows::choice<kSpacingNames>()},
    {"scan", rows::choice<kScanNames>()},
    {"two_way", rows::boolean()},
    {"scan_share", rows::number(kShare)},
};
constexpr TableKey kSpinRows[]{
    {"columns", rows::integer(1, 65536), "a count: firings in a turn"},
    {"elevation_deg", rows::numbers_up_to(kMaxBeams, kElevation_deg), "an array of angles, one for each laser"},
    {"azimuth_deg", rows::numbers_up_to(kMaxBeams, {.low = -180, .high = 180})},
};
constexpr TableKey kBeamRows[]{
    {"azimuth_deg", rows::number(kAzimuth_deg), "an angle, clockwise from y"},
    {"elevation_deg", rows::number(kElevation_deg), "an angle above the plane of x and y"},
    {"phase", rows::number(kPhase)},
};
constexpr TableKeys kHeadKeys{.rows = kHeadRows}, kGridKeys{.rows = kGridRows}, kSpinKeys{.rows = kSpinRows},
    kBeamKeys{.rows = kBeamRows};
constexpr TableKey kDescriptionRows[]{
    {"lidar", rows::table(kHeadKeys), "a table [lidar]"},
    {"grid", rows::table(kGridKeys)},
    {"spin", rows::table(kSpinKeys)},
    {"beam", rows::tables(kBeamKeys)},
};

std::vector<PatternShot> read_beams(std::vector<TableReader> tables) {
    std::vector<PatternShot> shots;
    for (TableReader& table : tables) {
        shots.push_back({.azimuth_rad = kRadPerDeg * table.number("azimuth_deg").value_or(0),
                         .elevation_rad = kRadPerDeg * table.number("elevation_deg").value_or(0),
                         .phase = table.number("phase").value_or(0),
                         .beam = static_cast<int>(shots.size())});
        table.finish();
    }
    return shots;
}

/// The field's angle at cell i of n, from -1/2 of the field to +1/2.
double at_cell(Spacing spacing, double field_rad, std::int64_t i, std::int64_t n) {
    const double place = (static_cast<double>(i) + 0.5) / static_cast<double>(n) - 0.5;
    return spacing == Spacing::angles ? place * field_rad : 2 * place * std::tan(0.5 * field_rad);
}

struct Grid {
    std::int64_t columns = 1, rows = 1;
    double horizontal_rad = 0, vertical_rad = 0;
    Spacing spacing = Spacing::tangents;
    Scan scan = Scan::flash;
    bool two_way = false;
    double scan_share = 1;  ///< of the frame's period
};

std::vector<PatternShot> shots_of(const Grid& g) {
    std::vector<PatternShot> shots;
    const std::int64_t count = g.columns * g.rows;
    const bool by_columns = g.scan == Scan::columns;
    const std::int64_t length = by_columns ? g.rows : g.columns;
    for (std::int64_t i = 0; i < count; ++i) {
        const std::int64_t line = i / length, along = i % length;
        const std::int64_t place = g.two_way && line % 2 == 1 ? length - 1 - along : along;
        const std::int64_t column = by_columns ? line : place, row = by_columns ? place : line;
        const double x = at_cell(g.spacing, g.horizontal_rad, column, g.columns),
                     z = -at_cell(g.spacing, g.vertical_rad, row, g.rows);
        const bool tangents = g.spacing == Spacing::tangents;
        shots.push_back({.azimuth_rad = tangents ? std::atan(x) : x,
                         .elevation_rad = tangents ? std::atan2(z, std::hypot(1, x)) : z,
                         .phase = g.scan == Scan::flash
                                      ? 0
                                      : g.scan_share * static_cast<double>(i) / static_cast<double>(count),
                         .beam = static_cast<int>(row)});
    }
    return shots;
}

void read_grid(TableReader table, LidarPattern& pattern) {
    Grid g;
    table.read("columns", g.columns);
    table.read("rows", g.rows);
    table.read("spacing", g.spacing);
    const double most = g.spacing == Spacing::tangents ? 170 : 360;
    const auto fov = [&](const char* key, double limit) {
        return kRadPerDeg * table.number(key, {.low = 0, .high = limit, .low_open = true}).value_or(1);
    };
    g.horizontal_rad = fov("fov_horizontal_deg", most);
    g.vertical_rad = fov("fov_vertical_deg", std::min(most, 180.0));
    table.read("scan", g.scan);
    table.read("two_way", g.two_way);
    table.read("scan_share", g.scan_share);
    if (g.scan == Scan::flash)
        for (const char* key : {"two_way", "scan_share"}) table.refuse(key, "all shots of a flash fire at once");
    table.finish();
    const auto max_shots = static_cast<std::int64_t>(LidarPattern::kMaxShots);
    if (g.columns * g.rows > max_shots) {
        table.fail("columns",
                   fmt::format("{} x {} shots a frame, expected at most {}", g.columns, g.rows, max_shots));
        return;
    }
    pattern.shots = shots_of(g);
    if (g.scan != Scan::flash) return;
    const double h = 0.5 * g.horizontal_rad, v = 0.5 * g.vertical_rad;
    if (g.spacing == Spacing::tangents)
        pattern.lit = {LidarField::Kind::plane, std::tan(h), std::tan(v)};
    else
        pattern.lit = {LidarField::Kind::angles, h, v};
}

std::vector<PatternShot> read_spin(TableReader table) {
    const std::int64_t columns = table.integer("columns").value_or(1);
    const auto elevation_deg = table.numbers("elevation_deg").value_or(std::vector<double>{});
    auto azimuth_deg = table.numbers("azimuth_deg").value_or(std::vector<double>{});
    if (table.has("azimuth_deg") && !elevation_deg.empty() && azimuth_deg.size() != elevation_deg.size())
        table.fail("azimuth_deg", fmt::format("expected an array of {} numbers", elevation_deg.size()));
    azimuth_deg.resize(elevation_deg.size());
    table.finish();
    const auto shots = static_cast<std::size_t>(columns) * elevation_deg.size();
    if (shots > LidarPattern::kMaxShots) {
        table.fail("columns", fmt::format("{} shots a turn, expected at most {}", shots, LidarPattern::kMaxShots));
        return {};
    }
    std::vector<PatternShot> all;
    for (std::int64_t c = 0; c < columns; ++c)
        for (std::size_t i = 0; i < elevation_deg.size(); ++i) {
            const double turn = static_cast<double>(c) / static_cast<double>(columns);
            all.push_back({.azimuth_rad = 2 * std::numbers::pi * turn + kRadPerDeg * azimuth_deg[i],
                           .elevation_rad = kRadPerDeg * elevation_deg[i],
                           .phase = turn,
                           .beam = static_cast<int>(i)});
        }
    return all;
}

/// Reads a CSV file with a row for each shot.
Result<std::vector<PatternShot>> read_shots(const std::string& file) {
    constexpr std::string_view kHeader = "phase,azimuth_deg,elevation_deg,beam";
    std::vector<PatternShot> shots;
    const auto take = [&](const CsvRow& row) -> Status {
        constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
        std::array<double, 4> x{};
        bool good = row.cells.size() == x.size() && shots.size() < LidarPattern::kMaxShots;
        for (std::size_t i = 0; good && i < x.size(); ++i) x[i] = row.number_in(row.cells[i]).value_or(kNone);
        good = good && kPhase.holds(x[0]) && kAzimuth_deg.holds(x[1]) && kElevation_deg.holds(x[2]) && x[3] >= 0 &&
               x[3] <= 65535 && x[3] == std::floor(x[3]);
        if (!good)
            return Error{fmt::format("expected {}: phase in [0, 1), angles within 720 and 90 deg, a beam of 0 to "
                                     "65535; at most {} rows",
                                     kHeader, LidarPattern::kMaxShots),
                         file, row.number, 1};
        if (!shots.empty() && x[0] < shots.back().phase)
            return Error{"fires before the shot above it, expected the order of firing", file, row.number, 1};
        shots.push_back({kRadPerDeg * x[1], kRadPerDeg * x[2], x[0], static_cast<int>(x[3])});
        return Ok{};
    };
    if (Status read = read_csv_rows(file, kHeader, "shots of a LiDAR", "shot", take); !read) return read.error();
    return shots;
}

void read_pattern(TableReader& root, TableReader& head, const std::string& file, LidarPattern& pattern) {
    const bool grid = root.has("grid"), spin = root.has("spin"), beams = root.has("beam"),
               shots = head.has("shots");
    if (grid + spin + beams + shots != 1) {
        head.fail("shots", "expected one of [grid], [spin], [[beam]] and shots = \"FILE.csv\" in [lidar]");
        return;
    }
    if (auto table = grid ? root.table("grid") : std::nullopt) return read_grid(*table, pattern);
    if (auto table = spin ? root.table("spin") : std::nullopt) pattern.shots = read_spin(*table);
    if (beams) pattern.shots = read_beams(root.tables("beam"));
    if (const auto named = shots ? head.text("shots") : std::nullopt) {
        auto read = read_shots(beside(file, *named));
        if (read)
            pattern.shots = *std::move(read);
        else
            head.fail("shots", read.error().text());
    }
}

void read_head(TableReader& head, LidarPattern& p) {
    head.read("name", p.name);
    if (head.has("name") && (p.name.empty() || p.name.size() > 64))
        head.fail("name", "expected 1 to 64 characters");
    p.rate_hz_default = head.number("rate_hz").value_or(10);
    p.rate_hz_min = head.number("rate_hz_min").value_or(p.rate_hz_default);
    p.rate_hz_max = head.number("rate_hz_max").value_or(p.rate_hz_default);
    p.range_resolution_m = head.number("range_resolution_m").value_or(1e-3);
    p.range_m_default =
        head.number("range_max_m", {.low = 0, .high = p.range_resolution_m * UINT32_MAX, .low_open = true})
            .value_or(1);
    p.velocity_resolution_m_s = head.number("velocity_resolution_m_s").value_or(0);
    p.dual = head.boolean("dual").value_or(false);
    p.latency_s = head.number("latency_s").value_or(0);
    head.read("data_port", p.data_port);
}

Result<LidarMake> read_description(const std::string& file) {
    Problems problems(file);
    auto pattern = std::make_shared<LidarPattern>();
    const auto parsed = TomlFile::read(file, "lidar", kLidarDescriptionKeys);
    if (!parsed) return parsed.error();
    TableReader root = parsed->root("the description", problems, &kLidarDescriptionKeys);
    if (auto head = root.table("lidar")) {
        read_head(*head, *pattern);
        read_pattern(root, *head, file, *pattern);
        head->finish();
    }
    root.finish();
    if (!problems.none()) return problems.first();
    auto make = make_of(pattern);
    if (!make) return Error{make.error().what, file};
    return make;
}

}  // namespace

constinit const TableKeys kLidarDescriptionKeys{.rows = kDescriptionRows};

Result<LidarMake> read_lidar_description(const std::string& file) {
    try {
        return read_description(file);
    } catch (const std::exception& e) {
        return Error{fmt::format("cannot be read: {}", e.what()), file};
    }
}

}  // namespace narpa
