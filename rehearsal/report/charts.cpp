// The plot documents of the reports.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/text/base64.h"
#include "plot/plot.h"
#include "rehearsal/report/run_report.h"
#include "rehearsal/runner/child_process.h"

namespace narpa::rehearsal {
namespace {

using nlohmann::json;

json to_json(const Vec3& v) {
    return {v.x, v.y, v.z};
}

/// The value of each sample.
json column(const auto& samples, const auto& value) {
    json out = json::array();
    for (const auto& s : samples) out.push_back(value(s));
    return out;
}
template <class Sample>
json column(const std::vector<Sample>& samples, Vec3 Sample::*vector) {
    return column(samples, [&](const Sample& s) { return to_json(s.*vector); });
}

json times(const BusRecord& bus, const auto& samples, auto counts) {
    json t = json::array();
    for (const auto& s : samples)
        if (counts(s)) t.push_back(bus.seconds(s.t_ns));
    return t;
}
constexpr auto kAll = [](const auto&) { return true; };

json estimates_over_time(const BusRecord& bus) {
    using E = JudgedEstimate;
    const auto& all = bus.estimates;
    return {{"t_s", times(bus, all, kAll)},
            {"frame_times_s", times(bus, all, [](const E& e) { return e.frames > 0; })},
            {"sweep_times_s", times(bus, all, [](const E& e) { return e.sweeps > 0; })},
            {"port_position_m", column(all, &E::port_position_m)},
            {"position_error_m", column(all, &E::position_error_m)},
            {"position_sigma_m", column(all, &E::sigma_position_m)},
            {"attitude_error_rad", column(all, &E::rotation_error_rad)},
            {"attitude_sigma_rad", column(all, &E::sigma_rotation_rad)}};
}

/// Intervals of commands with the same phase and leg.
json phases_over_time(const BusRecord& bus) {
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

json to_json(const CaptureEnvelope& c) {
    return {{"lateral_m", c.lateral_m},
            {"closing_m_s", {c.closing_min_m_s, c.closing_max_m_s}},
            {"lateral_m_s", c.lateral_rate_m_s},
            {"pitch_yaw_deg", c.pitch_yaw_deg},
            {"roll_deg", c.roll_deg}};
}

json to_json(const LandingLimits& limits) {
    json out;
    for (const LandingLimit& l : landing_limits())
        if (!l.of_ground) out[l.key] = limits.*l.max;
    return out;
}

json to_json(const Gates& g) {
    json out{{"corridor", nullptr}, {"keep_out_m", nullptr}, {"distance_m", nullptr}, {"contact", nullptr}};
    if (g.corridor)
        out["corridor"] = {{"half_angle_deg", g.corridor->half_angle_deg},
                           {"radius_m", g.corridor->radius_m},
                           {"from_m", g.corridor->from_m}};
    if (g.keep_out_m) out["keep_out_m"] = *g.keep_out_m;
    if (g.distance_m) out["distance_m"] = {g.distance_m->first, g.distance_m->second};
    if (g.contact) out["contact"] = to_json(*g.contact);
    return out;
}

/// The navigation's commands in each period, in the chaser's body axes, and the accumulated change of speed.
json thrusters_over_time(const Scenario& scenario, const BusRecord& bus) {
    using C = ActuatorCommand;
    double sum = 0;
    return {{"t_s", times(bus, bus.commands, kAll)},
            {"impulse_n_s", column(bus.commands, &C::impulse_n_s)},
            {"angular_impulse_n_m_s", column(bus.commands, &C::angular_impulse_n_m_s)},
            {"delta_v_m_s", column(bus.commands, [&](const C& c) {
                 return sum += norm(c.impulse_n_s) / scenario.chaser.mass_kg;
             })}};
}

/// Latency from the pose command to the hand-over; none in lockstep, where the clock waits.
json latency_over_time(const BusRecord& bus, bool lockstep) {
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
    const json truth = {{"t_s", times(bus, bus.truth, kAll)},
                        {"position_m", column(bus.truth, [](const S& s) { return to_json(s.position_m()); })},
                        {"range_m", column(bus.truth, [](const S& s) { return s.range_m(); })},
                        {"closing_m_s", column(bus.truth, [](const S& s) { return s.closing_m_s(); })},
                        {"lateral_m_s", column(bus.truth, [](const S& s) { return s.lateral_m_s(); })}};
    json holds = json::array(), contact;
    for (const Leg& leg : scenario.legs)
        if (!leg.arc_deg && !leg.contact) holds.push_back(to_json(leg.to_m));
    if (verdict.contact)
        contact = {{"t_s", verdict.contact->t_s},
                   {"captured", verdict.contact->captured},
                   {"position_m", to_json(verdict.contact->state.position_m())}};
    json document = {{"plot", "rehearsal"},
                     {"title", scenario.title},
                     {"t_end_s", verdict.t_end_s},
                     {"truth", truth},
                     {"estimates", estimates_over_time(bus)},
                     {"thrusters", thrusters_over_time(scenario, bus)},
                     {"holds_m", holds},
                     {"phases", phases_over_time(bus)},
                     {"gates", to_json(scenario.gates)},
                     {"contact", contact},
                     {"latency", latency_over_time(bus, verdict.lockstep)}};
    if (scenario.gear) document["landing"] = to_json(scenario.gates.landing.value_or(LandingLimits{}));
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
                {"landing", to_json(scenario.gates.landing.value_or(LandingLimits{}))},
                {"runs", runs}};
    return {{"plot", "campaign"},
            {"title", scenario.title},
            {"limits", to_json(scenario.gates.contact.value_or(CaptureEnvelope{}))},
            {"runs", runs}};
}

Status draw_charts(const std::string& folder, const json& document) {
    return write_plot(folder + "/charts", document);
}

json drawn_charts(const std::string& folder) {
    json out = json::object();
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator(folder + "/charts", none))
        if (const auto& path = entry.path(); path.extension() == ".svg")
            out[path.stem().string()] = base64(read_text(path.string()));
    return out;
}

}  // namespace narpa::rehearsal
