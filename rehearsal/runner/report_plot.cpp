// The plot documents of the reports.
#include <nlohmann/json.hpp>

#include "plot/plot.h"
#include "rehearsal/runner/report.h"

namespace narpa::rehearsal {
namespace {

using nlohmann::json;

json of(const Vec3& v) {
    return {v.x, v.y, v.z};
}

/// One array per key, with a value from each sample.
template <class Sample>
json columns(const std::vector<Sample>& samples,
             std::initializer_list<std::pair<const char*, json (*)(const Sample&)>> values) {
    json out;
    for (const auto& [key, value] : values) {
        json& column = out[key] = json::array();
        for (const Sample& s : samples) column.push_back(value(s));
    }
    return out;
}

json times(const BusRecord& bus, const auto& samples, auto counts) {
    json t = json::array();
    for (const auto& s : samples)
        if (counts(s)) t.push_back(bus.seconds(s.t_ns));
    return t;
}
constexpr auto kAll = [](const auto&) { return true; };

json of_estimates(const BusRecord& bus) {
    using E = JudgedEstimate;
    json out =
        columns<E>(bus.estimates, {{"port_position_m", [](const E& e) { return of(e.port_position_m); }},
                                   {"position_error_m", [](const E& e) { return of(e.position_error_m); }},
                                   {"position_sigma_m", [](const E& e) { return of(e.sigma_position_m); }},
                                   {"attitude_error_rad", [](const E& e) { return of(e.rotation_error_rad); }},
                                   {"attitude_sigma_rad", [](const E& e) { return of(e.sigma_rotation_rad); }}});
    out["t_s"] = times(bus, bus.estimates, kAll);
    out["frame_times_s"] = times(bus, bus.estimates, [](const E& e) { return e.frames > 0; });
    out["sweep_times_s"] = times(bus, bus.estimates, [](const E& e) { return e.sweeps > 0; });
    return out;
}

/// Intervals of commands with the same phase and leg.
json of_phases(const BusRecord& bus) {
    json out = json::array();
    const auto& commands = bus.commands;
    for (std::size_t i = 0; i < commands.size();) {
        std::size_t j = i;
        while (j < commands.size() && commands[j].phase == commands[i].phase && commands[j].leg == commands[i].leg)
            ++j;
        out.push_back({{"from_s", bus.seconds(commands[i].t_ns)},
                       {"to_s", bus.seconds(commands[j < commands.size() ? j : j - 1].t_ns)},
                       {"phase", kGuidancePhases[static_cast<std::size_t>(commands[i].phase)]},
                       {"leg", commands[i].leg + 1}});
        i = j;
    }
    return out;
}

json of_limits(const CaptureEnvelope& c) {
    return {{"lateral_m", c.lateral_m},
            {"closing_m_s", {c.closing_min_m_s, c.closing_max_m_s}},
            {"lateral_m_s", c.lateral_rate_m_s},
            {"pitch_yaw_deg", c.pitch_yaw_deg},
            {"roll_deg", c.roll_deg}};
}

json of_limits(const LandingLimits& l) {
    return {{"from_site_m", l.from_site_m},
            {"vertical_m_s", l.vertical_m_s},
            {"horizontal_m_s", l.horizontal_m_s},
            {"tilt_deg", l.tilt_deg},
            {"rate_deg_s", l.rate_deg_s}};
}

json of_gates(const Gates& g) {
    json out{{"corridor", nullptr}, {"keep_out_m", nullptr}, {"distance_m", nullptr}, {"contact", nullptr}};
    if (g.corridor)
        out["corridor"] = {{"half_angle_deg", g.corridor->half_angle_deg},
                           {"radius_m", g.corridor->radius_m},
                           {"from_m", g.corridor->from_m}};
    if (g.keep_out_m) out["keep_out_m"] = *g.keep_out_m;
    if (g.distance_m) out["distance_m"] = {g.distance_m->first, g.distance_m->second};
    if (g.contact) out["contact"] = of_limits(*g.contact);
    return out;
}

/// The navigation's commands in each period, in the chaser's body axes, and the accumulated change of speed.
json of_thrusters(const Scenario& scenario, const BusRecord& bus) {
    using C = ActuatorCommand;
    json out = columns<C>(bus.commands,
                          {{"impulse_n_s", [](const C& c) { return of(c.impulse_n_s); }},
                           {"angular_impulse_n_m_s", [](const C& c) { return of(c.angular_impulse_n_m_s); }}});
    out["t_s"] = times(bus, bus.commands, kAll);
    json& delta_v = out["delta_v_m_s"] = json::array();
    double sum = 0;
    for (const C& c : bus.commands) delta_v.push_back(sum += norm(c.impulse_n_s) / scenario.chaser.mass_kg);
    return out;
}

/// Latency from the pose command to the hand-over; none in lockstep, where the clock waits.
json of_latency(const BusRecord& bus, bool lockstep) {
    json t = json::array(), ms = json::array();
    for (const FrameLedger& f : bus.ledgers)
        if (f.t_hand_over_ns != 0 && !lockstep) {
            t.push_back(bus.seconds(f.t_exposure_mid_ns));
            ms.push_back(static_cast<double>(f.t_hand_over_ns - f.t_pose_ns) * 1e-6);
        }
    return {{"t_s", t}, {"ms", ms}};
}

}  // namespace

json rehearsal_plot(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict) {
    using S = TruthState;
    json truth = columns<S>(bus.truth, {{"position_m", [](const S& s) { return of(s.position_m()); }},
                                        {"range_m", [](const S& s) { return json(s.range_m()); }},
                                        {"closing_m_s", [](const S& s) { return json(s.closing_m_s()); }},
                                        {"lateral_m_s", [](const S& s) { return json(s.lateral_m_s()); }}});
    truth["t_s"] = times(bus, bus.truth, kAll);
    json holds = json::array(), contact;
    for (const Leg& leg : scenario.legs)
        if (!leg.arc_deg && !leg.contact) holds.push_back(of(leg.to_m));
    if (verdict.contact)
        contact = {{"t_s", verdict.contact->t_s},
                   {"captured", verdict.contact->captured},
                   {"position_m", of(verdict.contact->state.position_m())}};
    json document = {{"plot", "rehearsal"},
                     {"title", scenario.title},
                     {"t_end_s", verdict.t_end_s},
                     {"truth", truth},
                     {"estimates", of_estimates(bus)},
                     {"thrusters", of_thrusters(scenario, bus)},
                     {"holds_m", holds},
                     {"phases", of_phases(bus)},
                     {"gates", of_gates(scenario.gates)},
                     {"contact", contact},
                     {"latency", of_latency(bus, verdict.lockstep)}};
    if (scenario.gear) document["landing"] = of_limits(scenario.gates.landing.value_or(LandingLimits{}));
    return document;
}

json campaign_plot(const Scenario& scenario, std::span<const json> contacts) {
    json runs = json::array();
    for (const json& c : contacts) {
        bool within = true;
        for (const json& k : c["conditions"]) within &= k["within"].get<bool>();
        const auto value = [&](std::size_t i) { return c["conditions"][i]["value"]; };
        runs.push_back({{"within", within},
                        {"position_m", c["position_m"]},
                        {"closing_m_s", value(0)},
                        {"lateral_m_s", value(1)},
                        {scenario.gear ? "tilt_deg" : "pitch_yaw_deg", value(scenario.gear ? 2 : 3)},
                        {scenario.gear ? "rate_deg_s" : "roll_deg", value(scenario.gear ? 3 : 4)}});
    }
    if (scenario.gear)
        return {{"plot", "campaign"},
                {"title", scenario.title},
                {"landing", of_limits(scenario.gates.landing.value_or(LandingLimits{}))},
                {"runs", runs}};
    return {{"plot", "campaign"},
            {"title", scenario.title},
            {"limits", of_limits(scenario.gates.contact.value_or(CaptureEnvelope{}))},
            {"runs", runs}};
}

Status draw_charts(const std::string& folder, const json& document) {
    return write_plot(folder + "/charts", document);
}

}  // namespace narpa::rehearsal
