// Engine, landing gear and gates of landings.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "base/constants.h"
#include "rehearsal/scenario/scenario_tables.h"

namespace narpa::rehearsal {

Engine read_engine(TableReader& table) {
    Engine e;
    table.require("axis", "\"+fx\", \"-fx\" ... \"-fz\": the force of the engine");
    table.require("most_n", "a number > 0");
    const std::string axis = table.text("axis").value_or("+fz");
    e.group = static_cast<std::size_t>(std::ranges::find(kThrusterGroupNames, axis) - kThrusterGroupNames.begin());
    if (e.group >= kThrusterGroupNames.size() / 2)
        table.fail("axis", fmt::format("\"{}\" is no force, expected one of {}", axis,
                                       fmt::join(std::span(kThrusterGroupNames).first(6), ", ")));
    read(table, "most_n", e.most_n, kPositive);
    read(table, "least_n", e.least_n, kNotNegative);
    if (e.least_n > e.most_n) table.fail("least_n", "expected at most `most_n`");
    read(table, "gain_sigma", e.gain_sigma, {.low = 0, .high = 0.5});
    read(table, "specific_impulse_s", e.specific_impulse_s, kNotNegative);
    read(table, "tilt_most_deg", e.tilt_most_deg, {.low = 0, .high = 89});
    table.finish();
    return e;
}

LandingGear read_gear(TableReader& table, const Scenario& s) {
    LandingGear g;
    table.require("radius_m", "the distance of the feet from the port's axis");
    const auto feet = table.integer("feet", 3, 16).value_or(4);
    const double radius_m = table.number("radius_m", kPositive).value_or(1);
    for (std::int64_t i = 0; i < feet; ++i) {
        const double at_rad = 2 * kPi * (static_cast<double>(i) + 0.5) / static_cast<double>(feet);
        g.feet_m.push_back({0, radius_m * std::cos(at_rad), radius_m * std::sin(at_rad)});
    }
    read(table, "stiffness_n_m", g.stiffness_n_m, kPositive);
    read(table, "damping_n_s_m", g.damping_n_s_m, kNotNegative);
    read(table, "friction", g.friction, kNotNegative);
    read(table, "stroke_m", g.stroke_m, kPositive);
    read(table, "tipped_deg", g.tipped_deg, {.low = 1, .high = 89});
    if (!s.orbit.model->over_ground)
        table.fail("radius_m", "there is no ground, expected [orbit] with model \"surface\"");
    table.finish();
    return g;
}

void read_landing(TableReader& gates, const Scenario& s, Gates& out) {
    auto table = gates.table("landing");
    if (!table) return;
    LandingLimits l;
    for (const LandingLimit& limit : landing_limits()) read(*table, limit.key, l.*limit.max, kNotNegative);
    table->finish();
    if (!s.gear) gates.fail("landing", "nothing lands, expected a table [landing_gear]");
    out.landing = l;
}

}  // namespace narpa::rehearsal
