// What the chaser has: thrusters, engine, landing gear, attitude sensor.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "rehearsal/scenario/scenario_tables.h"

namespace narpa::rehearsal {
namespace {

constexpr Range kGainSigma{.low = 0, .high = 0.5};

std::vector<std::string_view> force_names() {
    return {kThrusterGroupNames.begin(), kThrusterGroupNames.begin() + 6};
}

constexpr TableKey kThrustersRows[]{
    {"force_n", rows::number(kPositive)},
    {"torque_n_m", rows::number(kPositive)},
    {"min_on_s", rows::number(kNotNegative)},
    {"gain_sigma", rows::number(kGainSigma)},
    {"misalignment_sigma_deg", rows::number({.low = 0, .high = 20})},
};
constexpr TableKey kEngineRows[]{
    {"axis", rows::choice(force_names), "\"+fx\", \"-fx\" ... \"-fz\": the force of the engine"},
    {"most_n", rows::number(kPositive), "a number > 0"},
    {"least_n", rows::number(kNotNegative)},
    {"gain_sigma", rows::number(kGainSigma)},
    {"specific_impulse_s", rows::number(kNotNegative)},
    {"tilt_most_deg", rows::number({.low = 0, .high = 89})},
};
constexpr TableKey kLandingGearRows[]{
    {"radius_m", rows::number(kPositive), "the distance of the feet from the port's axis"},
    {"feet", rows::integer(3, 16)},
    {"stiffness_n_m", rows::number(kPositive)},
    {"damping_n_s_m", rows::number(kNotNegative)},
    {"friction", rows::number(kNotNegative)},
    {"stroke_m", rows::number(kPositive)},
    {"tipped_deg", rows::number({.low = 1, .high = 89})},
};
constexpr TableKey kAttitudeSensorRows[]{
    {"attitude_sigma_deg", rows::number(kNotNegative)},
    {"rate_sigma_deg_s", rows::number(kNotNegative)},
};

Engine read_engine(TableReader& table) {
    Engine e;
    const std::string axis = table.text("axis").value_or("+fz");
    e.group = static_cast<std::size_t>(std::ranges::find(kThrusterGroupNames, axis) - kThrusterGroupNames.begin());
    if (e.group >= kThrusterGroupNames.size() / 2)
        table.fail("axis",
                   fmt::format("\"{}\" is no force, expected one of {}", axis, fmt::join(force_names(), ", ")));
    table.read("most_n", e.most_n);
    table.read("least_n", e.least_n);
    if (e.least_n > e.most_n) table.fail("least_n", "expected at most `most_n`");
    table.read("gain_sigma", e.gain_sigma);
    table.read("specific_impulse_s", e.specific_impulse_s);
    table.read("tilt_most_deg", e.tilt_most_deg);
    table.finish();
    return e;
}

LandingGear read_gear(TableReader& table, const Scenario& s) {
    LandingGear g;
    const auto feet = table.integer("feet").value_or(4);
    const double radius_m = table.number("radius_m").value_or(1);
    for (std::int64_t i = 0; i < feet; ++i) {
        const double at_rad = 2 * kPi * (static_cast<double>(i) + 0.5) / static_cast<double>(feet);
        g.feet_m.push_back({0, radius_m * std::cos(at_rad), radius_m * std::sin(at_rad)});
    }
    table.read("stiffness_n_m", g.stiffness_n_m);
    table.read("damping_n_s_m", g.damping_n_s_m);
    table.read("friction", g.friction);
    table.read("stroke_m", g.stroke_m);
    table.read("tipped_deg", g.tipped_deg);
    if (!s.orbit.model->over_ground)
        table.fail("radius_m", "there is no ground, expected [orbit] with model \"surface\"");
    table.finish();
    return g;
}

}  // namespace

constinit const TableKeys kThrustersKeys{.rows = kThrustersRows}, kEngineKeys{.rows = kEngineRows},
    kLandingGearKeys{.rows = kLandingGearRows}, kAttitudeSensorKeys{.rows = kAttitudeSensorRows};

void read_equipment(TableReader& root, Scenario& s) {
    if (auto table = root.table("thrusters")) {
        Thrusters& t = s.thrusters;
        table->read("force_n", t.force_n);
        table->read("torque_n_m", t.torque_n_m);
        table->read("min_on_s", t.min_on_s);
        table->read("gain_sigma", t.gain_sigma);
        table->read("misalignment_sigma_deg", t.misalignment_sigma_deg);
        table->finish();
    }
    if (auto table = root.table("engine")) s.engine = read_engine(*table);
    if (auto table = root.table("landing_gear")) s.gear = read_gear(*table, s);
    if (auto table = root.table("attitude_sensor")) {
        AttitudeSensor& a = s.attitude_sensor;
        table->read("attitude_sigma_deg", a.attitude_sigma_deg);
        table->read("rate_sigma_deg_s", a.rate_sigma_deg_s);
        table->finish();
    }
}

}  // namespace narpa::rehearsal
