// The results of the gates.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "rehearsal/judge/judge.h"

namespace narpa::rehearsal {
double corridor_clearance_m(const Gates::Corridor& corridor, const Vec3& p) {
    if (p.x < 0) return corridor.radius_m - norm(p);
    const double allowed = corridor.radius_m + p.x * std::tan(corridor.half_angle_deg / kDegPerRad);
    return allowed - std::hypot(p.y, p.z);
}

std::string leg_text(const Scenario& scenario, std::size_t leg) {
    if (leg >= scenario.legs.size() || scenario.legs[leg].name.empty()) return fmt::format("leg {}", leg + 1);
    return fmt::format("leg {} \"{}\"", leg + 1, scenario.legs[leg].name);
}

namespace {

/// "at t = 12.30 s (leg 2 \"hold\", holding)".
std::string when(const Scenario& scenario, const BusRecord& bus, std::int64_t t_ns) {
    std::string text = fmt::format("at t = {:.2f} s", bus.seconds(t_ns));
    const ActuatorCommand* command = bus.command_before(t_ns);
    if (!command) return text + " before the first thruster command";
    const std::string_view phase = kGuidancePhases[static_cast<std::size_t>(command->phase)];
    return text + fmt::format(" ({}, {})", leg_text(scenario, command->leg), phase);
}

std::string last_message(const BusRecord& bus, std::int64_t t_ns) {
    return t_ns == BusRecord::kNever ? "never" : fmt::format("at t = {:.3f} s", bus.seconds(t_ns));
}

/// The program whose message was due next and did not arrive: why a run broke off. In lockstep each program waits
/// for the one before: poses, the emulator's heartbeat of their time, the command. In real time none waits: it is
/// the program that stopped first.
std::string missing_sender(const BusRecord& bus, std::int64_t period_ns, std::int64_t t_command) {
    const std::int64_t slack = bus.heartbeats.lockstep ? 1'000'000 : 2 * period_ns;
    const std::int64_t t_report = bus.reports.empty() ? BusRecord::kNever : bus.reports.back().t_ns;
    const auto behind = [&](std::int64_t t, std::int64_t other) {
        return other != BusRecord::kNever && (t == BusRecord::kNever || t < other - slack);
    };
    if (bus.heartbeats.received == 0) return "the emulator sent nothing";
    if (bus.t_pose_ns == BusRecord::kNever) return "the dynamics sent nothing";
    if (behind(bus.t_heartbeat_ns, bus.t_pose_ns)) return "the emulator stopped sending";
    if (bus.heartbeats.lockstep ? behind(t_command, t_report) : behind(t_command, bus.t_pose_ns))
        return fmt::format("the navigation {}",
                           t_command == BusRecord::kNever ? "sent nothing" : "stopped sending");
    return "the dynamics stopped sending";
}

/// Who is awaited, and what was received last.
std::array<std::string, 2> standstill(const Scenario& scenario, const BusRecord& bus) {
    const std::int64_t t_command = bus.commands.empty() ? BusRecord::kNever : bus.commands.back().t_ns;
    return {
        missing_sender(bus, scenario.period_ns(), t_command),
        fmt::format("last received: poses {}, heartbeat {}, thruster command {}", last_message(bus, bus.t_pose_ns),
                    last_message(bus, bus.t_heartbeat_ns), last_message(bus, t_command))};
}

/// The first violation: "WORDS at t = .. s (..)"; without one, the sample nearest to the limit.
template <class Sample, class Words>
std::string first_text(const Scenario& scenario, const BusRecord& bus, const LimitMonitor<Sample>& monitor,
                       Words words) {
    const auto at = [&](const Sample& s) { return words(s) + " " + when(scenario, bus, s.t_ns); };
    if (monitor.first) return at(*monitor.first);
    return monitor.worst ? "nearest to the limit: " + at(*monitor.worst) : "never near the limit";
}

/// Adds the worst violation, if it is not the first one.
template <class Sample, class Words>
void add_worst(const Scenario& scenario, const BusRecord& bus, const LimitMonitor<Sample>& monitor, Words words,
               std::vector<std::string>& details) {
    if (monitor.first && monitor.worst->t_ns != monitor.first->t_ns)
        details.push_back("worst: " + words(*monitor.worst) + " " + when(scenario, bus, monitor.worst->t_ns));
}

/// " (limit 0.5 m)"; empty: there is none.
std::string limit_text(double limit, const char* unit) {
    return std::isfinite(limit) ? fmt::format(" (limit {:g} {})", limit, unit) : std::string();
}
constexpr const char* kNoPoses = "no poses of both bodies were on the bus";
std::string no_poses(const Gates&) {
    return kNoPoses;
}

}  // namespace

std::span<const GateKind, Judge::kGateKinds> Judge::gate_kinds() {
    static constexpr std::array<GateKind, kGateKinds> kKinds{{
        {.name = "corridor",
         .unit = "m",
         .key = "corridor",
         .text = "`{half_angle_deg = 10, radius_m = 0.5, from_m = 20}`: a cone about the port's axis with radius "
                 "`radius_m` at the port, judged nearer than `from_m`",
         .is_asked = [](const Gates& g) { return g.corridor.has_value(); },
         .margin_m = [](const Gates& g, const TruthState& s) -> std::optional<double> {
             if (!g.corridor || s.range_m() >= g.corridor->from_m) return std::nullopt;
             return corridor_clearance_m(*g.corridor, s.position_m());
         },
         .asked =
             [](const Gates& g) {
                 return fmt::format(
                     "within a cone of {:g} deg about the port's axis, with a radius of {:g} m at the "
                     "port, nearer than {:g} m",
                     g.corridor->half_angle_deg, g.corridor->radius_m, g.corridor->from_m);
             },
         .pose_text =
             [](const Gates& g, const TruthState& s) {
                 const Vec3& p = s.position_m();
                 if (p.x < 0)
                     return fmt::format("{:.3f} m behind the port's plane and {:.3f} m off its axis", -p.x,
                                        s.lateral_m());
                 return fmt::format("{:.3f} m off the axis {:.2f} m before the port, the corridor allows {:.3f} m",
                                    s.lateral_m(), p.x, corridor_clearance_m(*g.corridor, p) + s.lateral_m());
             },
         .not_judged =
             [](const Gates& g) {
                 return fmt::format("the chaser never came nearer than {:g} m", g.corridor->from_m);
             }},
        {.name = "keep_out",
         .unit = "m",
         .key = "keep_out_m",
         .text = "radius of a sphere about the port that may be entered only through the corridor",
         .is_asked = [](const Gates& g) { return g.keep_out_m.has_value(); },
         // Inside the corridor the keep-out sphere does not apply.
         .margin_m = [](const Gates& g, const TruthState& s) -> std::optional<double> {
             if (!g.keep_out_m) return std::nullopt;
             const double outside_m = s.range_m() - *g.keep_out_m;
             return g.corridor ? std::max(corridor_clearance_m(*g.corridor, s.position_m()), outside_m) : outside_m;
         },
         .asked =
             [](const Gates& g) {
                 return fmt::format("no nearer to the port than {:g} m but in the corridor", *g.keep_out_m);
             },
         .pose_text =
             [](const Gates&, const TruthState& s) {
                 return fmt::format("{:.2f} m from the port, {:.2f} m off its axis", s.range_m(), s.lateral_m());
             },
         .not_judged = no_poses},
        {.name = "distance",
         .unit = "m",
         .key = "distance_m",
         .text = "`[least, most]`: limits of the distance between the ports, at all times",
         .is_asked = [](const Gates& g) { return g.distance_m.has_value(); },
         .margin_m = [](const Gates& g, const TruthState& s) -> std::optional<double> {
             if (!g.distance_m) return std::nullopt;
             return std::min(s.range_m() - g.distance_m->first, g.distance_m->second - s.range_m());
         },
         .asked =
             [](const Gates& g) {
                 return fmt::format("{:g} to {:g} m between the ports", g.distance_m->first, g.distance_m->second);
             },
         .pose_text = [](const Gates&, const TruthState& s) { return fmt::format("{:.3f} m apart", s.range_m()); },
         .not_judged = no_poses},
        {.name = "navigation",
         .unit = "%",
         .key = "navigation",
         .text =
             "`{sigmas = 4, share = 0.99, position_m = inf, attitude_deg = inf}`: in at least this `share` of the "
             "estimates all six errors are within `sigmas` reported standard deviations; `position_m`, "
             "`attitude_deg`: largest errors allowed from the first measurement on",
         .is_asked = [](const Gates& g) { return g.navigation.has_value(); },
         .judge = &Judge::judge_navigation},
        {.name = "contact",
         .unit = "% of the range",
         .key = "contact",
         .text = "requires contact within this capture envelope; `{}`: the default envelope below. Keys: "
                 "`closing_min_m_s`, `closing_max_m_s`, `lateral_rate_m_s`, `lateral_m`, `pitch_yaw_deg`, "
                 "`roll_deg`, `pitch_yaw_rate_deg_s`, `roll_rate_deg_s`",
         .is_asked = [](const Gates& g) { return g.contact.has_value(); },
         .judge = &Judge::judge_contact},
        {.name = "complete",
         .unit = "",
         .key = "complete",
         .text = "all legs flown within `duration_s`, without an abort",
         .is_asked = [](const Gates&) { return true; },
         .judge = &Judge::judge_complete},
        {.name = "duration",
         .unit = "s",
         .key = "",
         .text = "",
         .is_asked = [](const Gates& g) { return g.complete; },
         .judge = &Judge::judge_duration},
        {.name = "landing",
         .unit = "",
         .key = "landing",
         .text = "a table with a gate for each key, here with the defaults. At the touchdown: `vertical_m_s` 1.5, "
                 "`horizontal_m_s` 0.5, `tilt_deg` 5, `rate_deg_s` 3, `from_site_m` 10. At rest: `slope_deg` 10 of "
                 "the ground under the feet; `step_m` 0.3, ground above that plane within the circle of the feet",
         .is_asked = [](const Gates& g) { return g.landing.has_value(); }},
    }};
    return kKinds;
}

GateResult Judge::result(const GateKind& kind) const {
    GateResult gate{.name = std::string(kind.name)};
    if (kind.margin_m)
        judge_poses(kind, gate);
    else
        (this->*kind.judge)(gate);
    if (gate.margin) gate.unit = kind.unit;
    return gate;
}

void Judge::judge_poses(const GateKind& kind, GateResult& gate) const {
    const Gates& gates = scenario_.gates;
    const LimitMonitor<TruthState>& monitor = poses_[static_cast<std::size_t>(&kind - gate_kinds().data())];
    gate.asked = kind.asked(gates);
    gate.reason = kind.not_judged(gates);
    if (monitor.seen == 0) return;
    gate.state = monitor.first ? GateState::failed : GateState::passed;
    gate.margin = monitor.margin;
    if (monitor.first) gate.t_first_s = bus_.seconds(monitor.first->t_ns);
    if (monitor.worst) gate.t_worst_s = bus_.seconds(monitor.worst->t_ns);
    const auto words = [&](const TruthState& s) { return kind.pose_text(gates, s); };
    gate.reason = first_text(scenario_, bus_, monitor, words);
    add_worst(scenario_, bus_, monitor, words, gate.details);
}

std::string Judge::awaited() const {
    const auto [sender, last] = standstill(scenario_, bus_);
    return sender + "; " + last;
}

void Judge::judge_navigation(GateResult& gate) const {
    const Gates::NavigationError& limits = *scenario_.gates.navigation;
    gate.asked = fmt::format("{:g} % of the estimates within {:g} standard deviations in all six components",
                             limits.share * 100, limits.sigmas);
    if (std::isfinite(limits.position_m))
        gate.asked += fmt::format(", once it has measured never {:g} m off", limits.position_m);
    if (std::isfinite(limits.attitude_deg)) gate.asked += fmt::format(", never {:g} deg off", limits.attitude_deg);
    if (sigmas_.seen == 0) {
        gate.state = GateState::failed;
        gate.reason = bus_.unjudged() > 0 ? "no estimate could be judged: no poses of both bodies of its time"
                                          : "no estimate was on the bus";
        return;
    }
    const NavigationStatistics s = navigation_statistics();
    const bool enough = s.share_within >= limits.share;
    gate.margin = (s.share_within - limits.share) * 100;
    gate.t_worst_s = bus_.seconds(sigmas_.worst->t_ns);

    const auto sigmas = [](const JudgedEstimate& e) {
        return fmt::format("{:.2f} standard deviations", e.largest_in_sigmas());
    };
    const auto metres = [&](const JudgedEstimate& e) {
        return fmt::format("position {:.3f} m off{}", norm(e.position_error_m), limit_text(limits.position_m, "m"));
    };
    const auto degrees = [&](const JudgedEstimate& e) {
        return fmt::format("attitude {:.3f} deg off{}", norm(e.rotation_error_rad) * kDegPerRad,
                           limit_text(limits.attitude_deg, "deg"));
    };
    struct Finding {
        double t_first_s;  ///< infinite: no violation
        std::string text;
        std::vector<std::string> details{};
    };
    const auto t_first_s = [&](const LimitMonitor<JudgedEstimate>& m) {
        return m.first ? bus_.seconds(m.first->t_ns) : kInfinity;
    };
    std::vector<Finding> findings;
    const auto add = [&](const LimitMonitor<JudgedEstimate>& monitor, const auto& words,
                         const std::string& largest) {
        if (!monitor.worst) return findings.push_back({kInfinity, largest});  // there is no limit
        findings.push_back({t_first_s(monitor), first_text(scenario_, bus_, monitor, words)});
        add_worst(scenario_, bus_, monitor, words, findings.back().details);
    };
    add(position_, metres, fmt::format("largest position error {:.3f} m", s.position_m.max));
    add(attitude_, degrees, fmt::format("largest attitude error {:.3f} deg", s.attitude_deg.max));
    findings.push_back({enough ? kInfinity : t_first_s(sigmas_),
                        fmt::format("{:.2f} % of {} estimates are within {:g} standard deviations, asked {:g} %",
                                    s.share_within * 100, s.estimates, limits.sigmas, limits.share * 100)});
    findings.back().details = {"largest: " + sigmas(*sigmas_.worst) + " " +
                               when(scenario_, bus_, sigmas_.worst->t_ns)};
    std::ranges::stable_sort(findings, {}, &Finding::t_first_s);

    const bool good = findings.front().t_first_s == kInfinity;
    gate.state = good ? GateState::passed : GateState::failed;
    if (!good) gate.t_first_s = findings.front().t_first_s;
    if (good) std::rotate(findings.begin(), findings.end() - 1, findings.end());
    gate.reason = findings.front().text;
    for (const Finding& f : findings) {
        if (&f != &findings.front()) gate.details.push_back(f.text);
        gate.details.insert(gate.details.end(), f.details.begin(), f.details.end());
    }
}

std::optional<Contact> Judge::contact_made() const {
    if (!t_contact_ns_) return std::nullopt;
    const auto state = bus_.truth_at(*t_contact_ns_);
    if (!state) return std::nullopt;
    if (scenario_.gear)
        return Contact{bus_.seconds(*t_contact_ns_), t_captured_ns_.has_value(), *state,
                       landing_conditions(scenario_.gates.landing.value_or(LandingLimits{}), *state, {})};
    const CaptureEnvelope limits = scenario_.gates.contact.value_or(CaptureEnvelope{});
    return Contact{bus_.seconds(*t_contact_ns_), t_captured_ns_ == t_contact_ns_, *state,
                   contact_conditions(limits, *state)};
}

void Judge::judge_contact(GateResult& gate) const {
    gate.asked = "contact within the initial contact conditions, and capture";
    const auto made = contact_made();
    if (!made) {
        gate.state = GateState::failed;
        gate.reason = t_contact_ns_
                          ? "the dynamics report contact, but no poses of its time"
                          : fmt::format("there was no contact: {}",
                                        bus_.truth.empty() ? kNoPoses
                                                           : fmt::format("the ports were {:.2f} m apart at the end",
                                                                         bus_.truth.back().range_m()));
        return;
    }
    gate.t_worst_s = made->t_s;
    std::vector<std::string> beyond;
    double least = std::numeric_limits<double>::infinity();
    for (const ContactCondition& c : made->conditions) {
        // The margin of the whole gate: the least remaining margin of all conditions, as a part of their range.
        least = std::min(
            {least, (c.max - c.value) / (c.max - c.min), c.min > 0 ? (c.value - c.min) / (c.max - c.min) : 1.0});
        if (!c.within())
            beyond.push_back(
                fmt::format("{} {:.4f} {}, asked {:g} to {:g}", c.title, c.value, c.unit, c.min, c.max));
    }
    gate.margin = least * 100;
    gate.state = beyond.empty() && made->captured ? GateState::passed : GateState::failed;
    if (gate.state == GateState::failed) gate.t_first_s = made->t_s;
    gate.reason = (made->captured ? "captured" : "bounced off") + (" " + when(scenario_, bus_, *t_contact_ns_));
    if (beyond.empty()) {
        const auto value = [&](std::size_t i) { return made->conditions[i].value; };
        gate.details = {
            fmt::format("closing {:.3f} m/s, {:.3f} m off the axis at {:.3f} m/s, {:.2f} deg pitch and "
                        "yaw, {:.2f} deg roll",
                        value(0), value(2), value(1), value(3), value(4))};
        return;
    }
    beyond.push_back(gate.reason);
    gate.reason = beyond.front();
    gate.details.assign(beyond.begin() + 1, beyond.end());
}

/// The ground under the feet where the lander came to rest, or where the run ended.
std::optional<Footing> Judge::footing_at_end() const {
    if (!t_contact_ns_ || bus_.truth.empty()) return std::nullopt;
    const auto terrain = Terrain::create(scenario_);
    if (!terrain) return std::nullopt;
    return footing(**terrain, feet_at_site(scenario_.gear->feet_m, bus_.truth.back()));
}

/// Adds a gate for each condition at touchdown, and for the ground.
void Judge::add_landing_gates(Verdict& v) const {
    const LandingLimits& limits = *scenario_.gates.landing;
    if (v.contact) {
        const auto ground = footing_at_end();
        v.contact->conditions = landing_conditions(limits, v.contact->state, ground);
        const std::size_t of_touchdown = landing_conditions(limits, v.contact->state, {}).size();
        for (std::size_t i = 0; i < v.contact->conditions.size(); ++i)
            v.gates.push_back(landing(*v.contact, v.contact->conditions[i], i < of_touchdown));
        if (!ground)
            v.gates.push_back({.name = "slope",
                               .asked = "ground under the feet",
                               .state = GateState::failed,
                               .reason = "there is none where the lander came to rest"});
        return;
    }
    for (const ContactCondition& c : landing_conditions(limits, {}, Footing{}))
        v.gates.push_back({.name = c.name,
                           .asked = fmt::format("{} at most {:g} {}", c.title, c.max, c.unit),
                           .reason = "it did not touch down"});
}

GateResult Judge::landing(const Contact& touchdown, const ContactCondition& c, bool of_touchdown) const {
    GateResult gate{.name = c.name, .asked = fmt::format("{} at most {:g} {}", c.title, c.max, c.unit)};
    gate.state = c.within() ? GateState::passed : GateState::failed;
    gate.margin = c.max - c.value;
    gate.unit = c.unit;
    gate.t_worst_s = touchdown.t_s;
    if (!c.within()) gate.t_first_s = touchdown.t_s;
    gate.reason =
        fmt::format("{:.3f} {} ", c.value, c.unit) +
        (of_touchdown ? "at the touchdown " + when(scenario_, bus_, *t_contact_ns_) : "where it stood at the end");
    return gate;
}

void Judge::judge_complete(GateResult& gate) const {
    const bool docks = !scenario_.legs.empty() && scenario_.legs.back().contact;
    gate.asked = !scenario_.gates.complete ? "to the end, whatever it is"
                 : docks && scenario_.gear ? "all legs flown and landed, without an abort"
                 : docks                   ? "all legs flown and docked, without an abort"
                                           : "all legs flown, without an abort";
    gate.state = GateState::failed;
    const auto aborted = std::find_if(bus_.commands.begin(), bus_.commands.end(),
                                      [](const ActuatorCommand& c) { return c.abort != AbortReason::none; });
    const bool gave_up = aborted != bus_.commands.end();
    if (gave_up) {
        gate.t_first_s = bus_.seconds(aborted->t_ns);
        gate.reason =
            fmt::format("the navigation gave up at t = {:.2f} s in {}: {}", *gate.t_first_s,
                        leg_text(scenario_, aborted->leg), kAbortReasons[static_cast<std::size_t>(aborted->abort)]);
    }
    if (gave_up && scenario_.gates.complete) return;
    const DynamicsReport* finished = bus_.first_report(DynamicsPhase::finished);
    if (!finished) {
        const auto [sender, last] = standstill(scenario_, bus_);
        const std::string broke_off = "the run broke off: " + sender;
        if (gave_up) gate.details.push_back(broke_off);
        if (!gave_up) gate.reason = broke_off;
        gate.details.push_back(last);
        return;
    }
    const double t_end_s = bus_.seconds(finished->t_ns);
    const auto done = std::find_if(bus_.commands.begin(), bus_.commands.end(),
                                   [](const ActuatorCommand& c) { return c.phase == GuidancePhase::done; });
    const bool flown = docks ? t_captured_ns_.has_value() : done != bus_.commands.end();
    if (flown || !scenario_.gates.complete) gate.state = GateState::passed;
    if (flown) {
        gate.reason = docks ? fmt::format("{} at t = {:.2f} s", scenario_.gear ? "landed" : "docked",
                                          bus_.seconds(*t_captured_ns_))
                            : fmt::format("all {} legs flown by t = {:.2f} s", scenario_.legs.size(),
                                          bus_.seconds(done->t_ns));
        return;
    }
    std::string over = fmt::format("over at t = {:.2f} s", t_end_s);
    if (!bus_.commands.empty()) over += " in " + leg_text(scenario_, bus_.commands.back().leg);
    if (!bus_.truth.empty()) over += fmt::format(", the ports {:.2f} m apart", bus_.truth.back().range_m());
    if (docks && t_contact_ns_)
        over += bus_.first_report(DynamicsPhase::crashed) ? ", it crashed"
                : scenario_.gear                          ? ", it came to no rest"
                                                          : ", after a contact that bounced";
    if (gave_up) gate.details.push_back(over);
    if (!gave_up) gate.reason = over;
}

void Judge::judge_duration(GateResult& gate) const {
    gate.asked = fmt::format("done within {:g} s", scenario_.duration_s);
    const bool docks = !scenario_.legs.empty() && scenario_.legs.back().contact;
    std::optional<double> t_done_s;
    for (const ActuatorCommand& c : bus_.commands)
        if (!docks && !t_done_s && c.phase == GuidancePhase::done) t_done_s = bus_.seconds(c.t_ns);
    if (docks && t_captured_ns_) t_done_s = bus_.seconds(*t_captured_ns_);
    const DynamicsReport* finished = bus_.first_report(DynamicsPhase::finished);
    const bool timed_out = !t_done_s && finished && bus_.seconds(finished->t_ns) >= scenario_.duration_s - 1e-6;
    if (!t_done_s && !timed_out) {
        gate.reason = "it did not come to its goal";
        return;
    }
    const double t_s = t_done_s ? *t_done_s : bus_.seconds(finished->t_ns);
    gate.state = t_done_s && t_s <= scenario_.duration_s ? GateState::passed : GateState::failed;
    gate.margin = scenario_.duration_s - t_s;
    gate.t_worst_s = t_s;
    if (gate.state == GateState::failed) gate.t_first_s = scenario_.duration_s;
    gate.reason = t_done_s ? fmt::format("done at t = {:.2f} s", t_s)
                           : fmt::format("the goal was not reached when {:g} s were over", scenario_.duration_s);
}

}  // namespace narpa::rehearsal
