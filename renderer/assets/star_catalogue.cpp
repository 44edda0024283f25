#include "renderer/assets/star_catalogue.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string_view>

#include "base/constants.h"
#include "base/text/csv.h"

namespace narpa {
namespace {

constexpr std::size_t kColumns = 7;

struct Column {
    double CatalogueStar::*value;
    const char* expected;
    double low, high;
    bool may_be_empty;
};
/// All but the name.
constexpr std::array<Column, kColumns - 1> kNumbers{
    {{&CatalogueStar::ra_deg, "a right ascension of 0 to 360 degrees", 0, 360, false},
     {&CatalogueStar::dec_deg, "a declination of -90 to 90 degrees", -90, 90, false},
     {&CatalogueStar::v_magnitude, "a V magnitude of -30 to 40", -30, 40, false},
     {&CatalogueStar::b_v, "a colour index B - V of -0.5 to 8, or nothing", -0.5, 8, true},
     {&CatalogueStar::pm_ra_mas_yr, "a proper motion of at most 1e6 mas a year, or nothing", -1e6, 1e6, true},
     {&CatalogueStar::pm_dec_mas_yr, "a proper motion of at most 1e6 mas a year, or nothing", -1e6, 1e6, true}}};

Result<CatalogueStar> read_row(const CsvRow& row, const std::string& file) {
    const auto bad = [&](std::string_view cell, std::string what) {
        return Error{std::move(what), file, row.number, row.column_of(cell)};
    };
    const std::vector<std::string_view>& cells = row.cells;
    if (cells.size() != kColumns)
        return bad(cells.front(), fmt::format("{} columns, expected {}: {}", cells.size(), kColumns, kStarHeader));
    CatalogueStar star;
    star.name = cells[0];
    for (std::size_t i = 0; i < kNumbers.size(); ++i) {
        const Column& column = kNumbers[i];
        const std::string_view cell = cells[i + 1];
        if (cell.empty() && column.may_be_empty) continue;
        const std::optional<double> value = row.number_in(cell);
        if (!value || !(*value >= column.low && *value <= column.high))
            return bad(cell, fmt::format("\"{}\" where {} was expected", cell, column.expected));
        star.*column.value = *value;
    }
    return star;
}

}  // namespace

Result<std::vector<CatalogueStar>> read_star_catalogue(const std::string& file) {
    std::vector<CatalogueStar> stars;
    const auto take = [&](const CsvRow& row) -> Status {
        auto star = read_row(row, file);
        if (!star) return star.error();
        stars.push_back(*std::move(star));
        return Ok{};
    };
    if (auto read = read_csv_rows(file, kStarHeader, "a star catalogue", "star", take); !read) return read.error();
    return stars;
}

Vec3 star_direction(const CatalogueStar& star, double years) {
    constexpr double kRadPerMas = kPi / 180 / 3600e3;
    const double ra = star.ra_deg * kPi / 180, dec = star.dec_deg * kPi / 180;
    const Vec3 east{-std::sin(ra), std::cos(ra), 0};
    const Vec3 north{-std::sin(dec) * std::cos(ra), -std::sin(dec) * std::sin(ra), std::cos(dec)};
    const Vec3 at_epoch{std::cos(dec) * std::cos(ra), std::cos(dec) * std::sin(ra), std::sin(dec)};
    return normalized(at_epoch + years * kRadPerMas * (star.pm_ra_mas_yr * east + star.pm_dec_mas_yr * north));
}

}  // namespace narpa
