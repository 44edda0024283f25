// The gates, which the judge applies.
#include <fmt/format.h>

#include "rehearsal/scenario/scenario_tables.h"

namespace narpa::rehearsal {
namespace {

constexpr TableKey kCorridorRows[]{
    {"half_angle_deg", rows::number({.low = 0, .high = 90})},
    {"radius_m", rows::number(kNotNegative)},
    {"from_m", rows::number(kPositive)},
};
constexpr TableKey kNavigationGateRows[]{
    {"sigmas", rows::number(kPositive)},
    {"share", rows::number(kUnit)},
    {"position_m", rows::number(kPositive)},
    {"attitude_deg", rows::number(kPositive)},
};
constexpr KeyValue kLimit = rows::number(kNotNegative);
constexpr TableKey kContactRows[]{{"closing_min_m_s", kLimit},      {"closing_max_m_s", kLimit},
                                  {"lateral_rate_m_s", kLimit},     {"lateral_m", kLimit},
                                  {"pitch_yaw_deg", kLimit},        {"roll_deg", kLimit},
                                  {"pitch_yaw_rate_deg_s", kLimit}, {"roll_rate_deg_s", kLimit}};
constexpr TableKey kLandingRows[]{{"vertical_m_s", kLimit}, {"horizontal_m_s", kLimit}, {"tilt_deg", kLimit},
                                  {"rate_deg_s", kLimit},   {"from_site_m", kLimit},    {"slope_deg", kLimit},
                                  {"step_m", kLimit}};
constexpr TableKeys kCorridorKeys{.rows = kCorridorRows}, kNavigationGateKeys{.rows = kNavigationGateRows},
    kContactKeys{.rows = kContactRows}, kLandingKeys{.rows = kLandingRows};
constexpr TableKey kGatesRows[]{
    {"corridor", rows::table(kCorridorKeys)}, {"keep_out_m", rows::number(kPositive)},
    {"distance_m", rows::pair(kNotNegative)}, {"navigation", rows::table(kNavigationGateKeys)},
    {"contact", rows::table(kContactKeys)},   {"complete", rows::boolean()},
    {"landing", rows::table(kLandingKeys)},
};

void read_contact(TableReader& gates, Gates& out) {
    auto table = gates.table("contact");
    if (!table) return;
    CaptureEnvelope c;
    table->read("closing_min_m_s", c.closing_min_m_s);
    table->read("closing_max_m_s", c.closing_max_m_s);
    if (!(c.closing_min_m_s < c.closing_max_m_s))
        table->fail("closing_min_m_s", fmt::format("is {:g}, expected less than closing_max_m_s, {:g}",
                                                   c.closing_min_m_s, c.closing_max_m_s));
    table->read("lateral_rate_m_s", c.lateral_rate_m_s);
    table->read("lateral_m", c.lateral_m);
    table->read("pitch_yaw_deg", c.pitch_yaw_deg);
    table->read("roll_deg", c.roll_deg);
    table->read("pitch_yaw_rate_deg_s", c.pitch_yaw_rate_deg_s);
    table->read("roll_rate_deg_s", c.roll_rate_deg_s);
    table->finish();
    out.contact = c;
}

void read_landing(TableReader& gates, const Scenario& s, Gates& out) {
    auto table = gates.table("landing");
    if (!table) return;
    LandingLimits l;
    for (const LandingLimit& limit : landing_limits()) table->read(limit.key, l.*limit.max);
    table->finish();
    if (!s.gear) gates.fail("landing", "nothing lands, expected a table [landing_gear]");
    out.landing = l;
}

}  // namespace

constinit const TableKeys kGatesKeys{.rows = kGatesRows};

void read_gates(TableReader& root, Scenario& s) {
    auto table = root.table("gates");
    if (!table) return;
    Gates& g = s.gates;
    if (auto corridor = table->table("corridor")) {
        Gates::Corridor c;
        corridor->read("half_angle_deg", c.half_angle_deg);
        corridor->read("radius_m", c.radius_m);
        corridor->read("from_m", c.from_m);
        corridor->finish();
        g.corridor = c;
    }
    g.keep_out_m = table->number("keep_out_m");
    if (g.keep_out_m && !g.corridor && s.legs.back().contact)
        table->fail("keep_out_m", "nothing may enter this sphere without a corridor, expected `corridor` too");
    if (const auto band = table->pair("distance_m")) {
        g.distance_m.emplace((*band)[0], (*band)[1]);
        if (!((*band)[0] < (*band)[1])) table->fail("distance_m", "expected [least, most]");
    }
    if (auto navigation = table->table("navigation")) {
        Gates::NavigationError n;
        navigation->read("sigmas", n.sigmas);
        navigation->read("share", n.share);
        navigation->read("position_m", n.position_m);
        navigation->read("attitude_deg", n.attitude_deg);
        navigation->finish();
        g.navigation = n;
    }
    read_contact(*table, g);
    read_landing(*table, s, g);
    if (g.contact && s.gear) table->fail("contact", "belongs to docking ports, expected `landing`");
    if (g.contact && !s.legs.back().contact)
        table->fail("contact", "no leg has contact = true, expected the last one to have it");
    table->read("complete", g.complete);
    table->finish();
}

}  // namespace narpa::rehearsal
