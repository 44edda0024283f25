#include "rehearsal/runner/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "rehearsal/judge/gates.h"
#include "rehearsal/runner/chart.h"
#include "rehearsal/runner/child_process.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
constexpr double kDeg = 180 / std::numbers::pi;
constexpr std::size_t kPictures = 8;
constexpr const char* kPhaseColours[] = {kSky, kGreen, kOrange, kPurple, kVermilion, kGrey};

/// Everything that the parts of the page look at.
struct Run {
    const Scenario& scenario;
    const BusRecord& bus;
    const Verdict& verdict;
    const nlohmann::json& record;
    const std::string& folder;
};

std::string head(const Run& run) {
    const Verdict& v = run.verdict;
    std::string out = fmt::format("<h1>{}</h1>\n<p class=\"lead\">{} {}</p>\n", escape(run.scenario.title),
                                  badge(v.passed, v.passed ? "passed" : "failed"), escape(v.headline));
    out += fmt::format("<p class=\"soft\">{}, seed {}, {:.1f} s simulated in {:.1f} s, narpa {}, {}</p>\n",
                       escape(run.record.value("mode", "")), run.record.value("seed", std::uint64_t{0}), v.t_end_s,
                       run.record.value("wall_s", 0.0), escape(run.record.value("version", "")),
                       escape(run.record.value("begun", "")));
    return out;
}

std::string gates(const Run& run) {
    std::string out =
        "<h2>Gates</h2>\n<table><tr><th>gate</th><th>asked</th><th></th><th>what there was</th>"
        "<th class=\"n\">margin</th></tr>\n";
    for (const GateResult& g : run.verdict.gates) {
        const auto state = static_cast<std::size_t>(g.state);
        constexpr const char* kClasses[] = {"good", "bad", "none"};
        out += fmt::format(
            "<tr><td><b>{}</b></td><td>{}</td><td><span class=\"badge {}\">{}</span></td><td>{}</td><td "
            "class=\"n\">{}</td></tr>\n",
            escape(g.name), escape(g.asked), kClasses[state], kGateStates[state], escape(g.reason),
            g.margin && std::isfinite(*g.margin) ? fmt::format("{:.3g} {}", *g.margin, g.unit) : "");
    }
    return out + "</table>\n";
}

// --- The approach ---------------------------------------------------------------------------------------------

Points path_of(const auto& samples, int along, int across, auto position) {
    Points points;
    for (const auto& s : samples) points.emplace_back(position(s)[along], position(s)[across]);
    return points;
}

void bodies_of_the_approach(const Run& run, Chart& chart, int along, int across, double from, double to) {
    const Gates& g = run.scenario.gates;
    if (along == 0 && g.corridor) {
        const double far = std::min(g.corridor->from_m, to), near = std::max(0.0, from);
        const double slope = std::tan(g.corridor->half_angle_deg / kDeg), r = g.corridor->radius_m;
        chart.area(
            {{near, r + near * slope}, {far, r + far * slope}, {far, -r - far * slope}, {near, -r - near * slope}},
            kGreen, "corridor");
    }
    if (along == 1 && g.corridor) chart.circle(0, 0, g.corridor->radius_m, kGreen, "corridor at the port");
    if (g.keep_out_m) chart.circle(0, 0, *g.keep_out_m, kVermilion, "keep-out sphere");
    if (g.distance_m) {
        chart.circle(0, 0, g.distance_m->first, kVermilion, "distance allowed");
        chart.circle(0, 0, g.distance_m->second, kVermilion);
    }
    const auto truth = path_of(run.bus.truth, along, across, [](const PortState& s) { return s.position_m; });
    const auto estimated =
        path_of(run.bus.estimates, along, across, [](const JudgedEstimate& e) { return e.port_position_m; });
    chart.line(truth, kBlue, 1.8, "true");
    chart.dots(estimated, kOrange, 1.1, "estimated");
    Points holds;
    for (const Leg& leg : run.scenario.legs)
        if (!leg.arc_deg && !leg.contact) holds.emplace_back(leg.to_m[along], leg.to_m[across]);
    chart.dots(holds, "#1d232b", 3, "hold points");
}

/// Half the width that shows a path across, and little else.
double half_width(const Run& run, int axis) {
    double most = 0.15;
    for (const PortState& s : run.bus.truth) most = std::max(most, std::abs(s.position_m[axis]));
    for (const Leg& leg : run.scenario.legs)
        if (!leg.arc_deg) most = std::max(most, std::abs(leg.to_m[axis]));
    return most * 1.3;
}

std::string approach(const Run& run) {
    double low = 0, high = 1;
    for (const PortState& s : run.bus.truth)
        low = std::min(low, s.position_m.x), high = std::max(high, s.position_m.x);
    const double more = 0.04 * (high - low);
    const bool round = run.scenario.gates.distance_m.has_value();  // about the port, not along its axis
    std::string out =
        "<h2>Approach</h2>\n<p>The chaser's port in the target's port axes: x out of the docking "
        "interface. Scales differ across and along.</p>\n<div class=\"charts\">";
    const auto view = [&](const char* title, const char* x, const char* y, int along, int across, double width) {
        Chart chart(title, x, y, width, 330);
        double from = low - more, to = high + more;
        if (along == 1) from = -half_width(run, 1), to = -from;
        chart.range_x(from, to);
        chart.range_y(-half_width(run, across), half_width(run, across));
        if (round || along == 1) chart.equal_scales();
        bodies_of_the_approach(run, chart, along, across, from, to);
        out += chart.svg();
    };
    view("From above", "x [m]", "y [m]", 0, 1, 560);
    view("From the side", "x [m]", "z [m]", 0, 2, 560);
    view("From the front", "y [m]", "z [m]", 1, 2, 560);
    // The last metres, where the limits of contact can be seen.
    if (run.scenario.gates.contact) {
        Chart chart("The last three metres, from the front", "y [m]", "z [m]", 560, 330);
        Points end;
        for (const PortState& s : run.bus.truth)
            if (s.position_m.x < 3) end.emplace_back(s.position_m.y, s.position_m.z);
        const double r = run.scenario.gates.contact->lateral_m;
        chart.range_x(-2 * r, 2 * r);
        chart.range_y(-2 * r, 2 * r);
        chart.equal_scales();
        chart.line(end, kBlue, 1.8, "true");
        chart.circle(0, 0, r, kGreen, "lateral misalignment at contact");
        if (run.verdict.contact)
            chart.dots({{run.verdict.contact->state.position_m.y, run.verdict.contact->state.position_m.z}},
                       kVermilion, 4, "contact");
        out += chart.svg();
    }
    return out + "</div>\n";
}

// --- Over time ------------------------------------------------------------------------------------------------

void shade_phases(const Run& run, Chart& chart) {
    const auto& commands = run.bus.commands;
    for (std::size_t i = 0; i < commands.size();) {
        std::size_t j = i;
        while (j < commands.size() && commands[j].phase == commands[i].phase && commands[j].leg == commands[i].leg)
            ++j;
        const double to = run.bus.seconds(j < commands.size() ? commands[j].t_ns : commands[j - 1].t_ns);
        const auto phase = static_cast<std::size_t>(commands[i].phase);
        chart.shade(run.bus.seconds(commands[i].t_ns), to, kPhaseColours[phase],
                    fmt::format("{} {}", kGuidancePhases[phase], commands[i].leg + 1));
        i = j;
    }
}

std::string motion(const Run& run) {
    Points range, closing, lateral;
    for (const PortState& s : run.bus.truth) {
        const double t = run.bus.seconds(s.t_ns);
        range.emplace_back(t, s.range_m());
        closing.emplace_back(t, s.closing_m_s());
        lateral.emplace_back(t, s.lateral_m_s());
    }
    Chart far("Range", "t [s]", "between the ports [m]", 1130, 240), rate("Rates", "t [s]", "[m/s]", 1130, 240);
    shade_phases(run, far);
    shade_phases(run, rate);
    far.line(range, kBlue, 1.8);
    rate.line(closing, kBlue, 1.8, "closing");
    rate.line(lateral, kVermilion, 1.4, "lateral");
    if (run.scenario.gates.contact) {
        const double t0 = 0, t1 = run.verdict.t_end_s;
        const Gates::Contact& c = *run.scenario.gates.contact;
        rate.line({{t0, c.closing_max_m_s}, {t1, c.closing_max_m_s}}, kGreen, 1, "closing rate asked at contact",
                  true);
        rate.line({{t0, c.closing_min_m_s}, {t1, c.closing_min_m_s}}, kGreen, 1, "", true);
    }
    return "<h2>Range and rates</h2>\n<p>Shaded: phase of the guidance and number of the leg.</p>\n<div "
           "class=\"charts\">" +
           far.svg() + rate.svg() + "</div>\n";
}

bool captured(const Run& run) {
    return run.verdict.contact && run.verdict.contact->captured;
}

std::string errors(const Run& run) {
    const auto& estimates = run.bus.estimates;
    std::string out = fmt::format(
        "<h2>Navigation error and bound</h2>\n<p>The target in the chaser's body axes, as estimated less as it "
        "was, "
        "within three of the standard deviations told on CAN. {} estimates, {:.2f} % within the gate's limits in "
        "all "
        "six components; squared errors over variances add up to {:.2f} on average (6 where the covariance is "
        "right).</p>\n",
        run.verdict.navigation.estimates, run.verdict.navigation.share_within * 100, run.verdict.navigation.nees);
    if (estimates.empty()) return out + "<p>No estimates.</p>\n";
    std::vector<double> frames, sweeps;
    for (const JudgedEstimate& e : estimates) {
        if (e.frames > 0) frames.push_back(run.bus.seconds(e.t_ns));
        if (e.sweeps > 0) sweeps.push_back(run.bus.seconds(e.t_ns));
    }
    out += "<div class=\"charts\">";
    for (int quantity = 0; quantity < 2; ++quantity)
        for (int axis = 0; axis < 3; ++axis) {
            const double unit = quantity == 0 ? 100 : kDeg;
            Points error, low, high;
            std::vector<double> bound;
            double most = 0;
            for (const JudgedEstimate& e : estimates) {
                const double t = run.bus.seconds(e.t_ns);
                if (captured(run) && t > run.verdict.contact->t_s) break;  // one body: nothing more to know
                const double value = (quantity == 0 ? e.position_error_m : e.rotation_error_rad)[axis] * unit;
                const double sigma = (quantity == 0 ? e.sigma_position_m : e.sigma_rotation_rad)[axis] * unit;
                error.emplace_back(t, value);
                low.emplace_back(t, -3 * sigma);
                high.emplace_back(t, 3 * sigma);
                bound.push_back(3 * sigma);
                if (t > 0.03 * run.verdict.t_end_s) most = std::max(most, std::abs(value));
            }
            Chart chart(fmt::format("{} {}", quantity == 0 ? "Position" : "Attitude about", "xyz"[axis]), "t [s]",
                        quantity == 0 ? "[cm]" : "[deg]", 365, 210);
            // The start's uncertainty would hide all the rest.
            const double span = std::max({1.25 * most, 1.2 * distribution(bound).p50, 1e-6});
            chart.range_y(-span, span);
            chart.band(low, high, kSky, "3 sigma");
            chart.line(error, kBlue, 1.3, "error");
            chart.ticks(frames, kVermilion, frames.empty() ? "" : "frames");
            chart.ticks(sweeps, kGreen, sweeps.empty() ? "" : "sweeps");
            out += chart.svg();
        }
    return out + "</div>\n";
}

std::string contact(const Run& run) {
    if (!run.verdict.contact) return "";
    const Contact& c = *run.verdict.contact;
    return fmt::format(
        "<h2>Contact</h2>\n<p>At t = {:.2f} s, {}. Green: what the International Docking System "
        "Standard's initial contact conditions allow (Interface Definition Document, revision E), or "
        "the scenario in their place.</p>\n{}",
        c.t_s, c.captured ? "captured" : "bounced off", contact_bars(c.conditions));
}

// --- Ledger, pictures, events, how ------------------------------------------------------------------------------

std::string ledger(const Run& run) {
    const LedgerStatistics& l = run.verdict.ledger;
    std::string out = fmt::format(
        "<h2>Time ledger</h2>\n<p>{} frames, {} handed over, {} deadlines met ({:.2f} %), {} "
        "on stale poses.{}</p>\n",
        l.frames, l.handed_over, l.deadlines_met,
        l.frames > 0 ? 100.0 * static_cast<double>(l.deadlines_met) / static_cast<double>(l.frames) : 0.0, l.stale,
        run.verdict.lockstep ? " In lockstep the clock stands still while a frame is made: "
                               "times of making and handing over tell nothing here."
                             : "");
    if (run.verdict.lockstep || l.frames == 0) return out;
    out +=
        "<table><tr><th>[ms]</th><th class=\"n\">p50</th><th class=\"n\">p90</th><th class=\"n\">p99</th>"
        "<th class=\"n\">p99.9</th><th class=\"n\">max</th></tr>\n";
    const auto row = [&](const char* name, const Distribution& d) {
        if (d.count == 0) return;
        out += fmt::format("<tr><td>{}</td>", name);
        for (const double v : {d.p50, d.p90, d.p99, d.p999, d.max})
            out += fmt::format("<td class=\"n\">{:.2f}</td>", v);
        out += "</tr>\n";
    };
    row("pose command to hand-over", l.latency_ms);
    row("middle of the exposure to hand-over", l.exposure_to_hand_over_ms);
    row("rendering", l.render_ms);
    row("hand-over after its deadline (negative: before)", l.late_ms);
    Points latency;
    for (const FrameLedger& f : run.bus.ledgers)
        if (f.t_hand_over_ns != 0)
            latency.emplace_back(run.bus.seconds(f.t_exposure_mid_ns),
                                 static_cast<double>(f.t_hand_over_ns - f.t_pose_ns) * 1e-6);
    Chart chart("Pose command to hand-over", "t [s]", "[ms]", 1130, 220);
    chart.dots(latency, kBlue, 1.3);
    return out + "</table>\n" + chart.svg();
}

std::string pictures(const Run& run) {
    std::vector<fs::path> files;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(run.folder + "/navigation", none))
        if (entry.path().extension() == ".png") files.push_back(entry.path());
    // In the order in which they were taken.
    std::sort(files.begin(), files.end(), [&](const fs::path& a, const fs::path& b) {
        return std::pair(fs::last_write_time(a, none), a) < std::pair(fs::last_write_time(b, none), b);
    });
    if (files.size() > kPictures) files.resize(kPictures);
    if (files.empty()) return "";
    std::string out = "<h2>What the navigation saw</h2>\n<div class=\"charts\">";
    for (const fs::path& file : files) {
        const std::string name = file.stem().string();
        out += fmt::format(
            "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"/><figcaption>{0}</figcaption>"
            "</figure>\n",
            escape(name), base64(read_text(file.string())));
    }
    return out + "</div>\n";
}

std::string events(const Run& run) {
    std::vector<std::pair<double, std::string>> all;
    const auto& bus = run.bus;
    for (std::size_t i = 0; i < bus.commands.size(); ++i) {
        const ActuatorCommand &c = bus.commands[i], before = i > 0 ? bus.commands[i - 1] : ActuatorCommand{};
        const double t = bus.seconds(c.t_ns);
        if (i == 0 || c.phase != before.phase || c.leg != before.leg)
            all.emplace_back(t, fmt::format("guidance: {}, {}", kGuidancePhases[static_cast<std::size_t>(c.phase)],
                                            leg_text(run.scenario, c.leg)));
        if (c.abort != AbortReason::none && before.abort == AbortReason::none)
            all.emplace_back(t, fmt::format("abort: {}", kAbortReasons[static_cast<std::size_t>(c.abort)]));
    }
    for (std::size_t i = 1; i < bus.reports.size(); ++i)
        if (bus.reports[i].phase != bus.reports[i - 1].phase)
            all.emplace_back(
                bus.seconds(bus.reports[i].t_ns),
                fmt::format("dynamics: {}", kDynamicsPhases[static_cast<std::size_t>(bus.reports[i].phase)]));
    constexpr const char* kFaults[] = {"thruster off", "thruster stuck", "attitude sensor turned",
                                       "target's rate changed", "thruster commands lost"};
    for (const Fault& f : run.scenario.faults) {
        const std::string what = fmt::format("fault: {} {}", kFaults[static_cast<std::size_t>(f.kind)], f.axis);
        all.emplace_back(f.from_s, what);
        if (std::isfinite(f.until_s)) all.emplace_back(f.until_s, what + " is over");
    }
    for (const GateResult& g : run.verdict.gates)
        if (g.state == GateState::failed && g.t_first_s) all.emplace_back(*g.t_first_s, "gate failed: " + g.name);
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::string out = "<h2>What happened</h2>\n<table><tr><th class=\"n\">t [s]</th><th>event</th></tr>\n";
    for (const auto& [t, what] : all)
        out +=
            fmt::format("<tr><td class=\"n\">{:.2f}</td><td style=\"width:100%\">{}</td></tr>\n", t, escape(what));
    return out + "</table>\n";
}

std::string how(const Run& run) {
    std::string out = "<h2>How it was run</h2>\n<dl>";
    for (const char* key : {"scenario", "scene", "scenario_hash", "mode", "seed", "bus", "version", "begun"})
        if (run.record.contains(key)) {
            const auto& value = run.record[key];
            out += fmt::format("<dt>{}</dt><dd>{}</dd>", key,
                               escape(value.is_string() ? value.get<std::string>() : value.dump()));
        }
    const Verdict& v = run.verdict;
    out += fmt::format(
        "<dt>on the bus</dt><dd>{} poses, {} estimates, {} thruster commands, {} heartbeats, {} ledgers; "
        "{} frames refused, {} messages late</dd></dl>\n",
        v.poses, v.estimates, v.commands, v.heartbeats, v.ledger.frames, v.refused, v.late);
    if (run.record.contains("command_lines"))
        for (const auto& [name, line] : run.record["command_lines"].items())
            out += fmt::format("<pre>{}</pre>\n", escape(line.get<std::string>()));
    return out;
}

}  // namespace

std::string rehearsal_page(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict,
                           const nlohmann::json& record, const std::string& folder) {
    const Run run{scenario, bus, verdict, record, folder};
    return page_around(scenario.title, head(run) + gates(run) + approach(run) + motion(run) + errors(run) +
                                           contact(run) + pictures(run) + ledger(run) + events(run) + how(run));
}

}  // namespace narpa::rehearsal
