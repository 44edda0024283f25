#include <fmt/format.h>

#include "renderer/assets/star_catalogue.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {
namespace {

constexpr double kJ2000 = 2000;
constexpr Range kYears{.low = 1000, .high = 3000};  // straight proper motion is good to an arcminute here
constexpr double kFastest_m_s = 2.9e8;              // below the speed of light
constexpr TableKey kStarRows[]{
    {"catalogue", rows::file(), "the path of a star catalogue (CSV)"},
    {"catalogue_epoch", rows::number(kYears)},
    {"epoch", rows::number(kYears)},
    {"faintest", rows::number()},
    {"attitude_wxyz", rows::attitude()},
    {"rate_rad_s", rows::vec3({.low = -1e3, .high = 1e3})},
    {"velocity_m_s", rows::vec3()},
};

/// An error at a line of the catalogue keeps its location; others get that of the scene file.
Error blamed(Error error, const FilePlace& place, const std::string& scene_file) {
    if (error.line == 0)
        return {
            .what = "catalogue: " + error.text(), .file = scene_file, .line = place.line, .column = place.column};
    error.what += fmt::format(" (catalogue of [stars], {}:{})", scene_file, place.line);
    return error;
}

}  // namespace

constinit const TableKeys kStarsKeys{.rows = kStarRows};

void read_stars(TableReader& root, SceneReading& reading, std::optional<double> epoch_year) {
    auto table = root.table("stars");
    if (!table) return;
    double catalogue_epoch = kJ2000, epoch = epoch_year.value_or(kJ2000), faintest = kAnyNumber.high;
    table->read("catalogue_epoch", catalogue_epoch);
    table->read("epoch", epoch);
    table->read("faintest", faintest);
    StarField field;
    table->read("attitude_wxyz", field.q_icrs_world);
    table->read("rate_rad_s", field.rate_rad_s);
    table->read("velocity_m_s", field.velocity_m_s);
    if (!(norm(field.velocity_m_s) < kFastest_m_s))
        table->fail("velocity_m_s", "expected a speed below that of light, 2.9e8 m/s at the most");
    if (const auto name = table->text("catalogue")) {
        const auto catalogue = read_star_catalogue((reading.folder / *name).string());
        if (!catalogue) {
            const FilePlace place = table->place("catalogue");
            return reading.problems.add(place, blamed(catalogue.error(), place, reading.problems.file()));
        }
        for (const CatalogueStar& star : *catalogue)
            if (star.v_magnitude <= faintest)
                field.stars.push_back({star_direction(star, epoch - catalogue_epoch), star.v_magnitude, star.b_v});
    }
    table->finish();
    reading.scene.stars = std::move(field);
}

}  // namespace narpa
