// The page of one run.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/base64.h"
#include "rehearsal/judge/judge.h"
#include "rehearsal/runner/child_process.h"
#include "rehearsal/runner/report.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
constexpr std::size_t kPictures = 8;

/// Input of all sections.
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
                                  badge(v.passed), escape(v.headline));
    out += fmt::format("<p class=\"soft\">{}, seed {}, {:.1f} s simulated in {:.1f} s, narpa {}, {}</p>\n",
                       escape(run.record.value("mode", "")), run.record.value("seed", std::uint64_t{0}), v.t_end_s,
                       run.record.value("wall_s", 0.0), escape(run.record.value("version", "")),
                       escape(run.record.value("begun", "")));
    return out;
}

std::string gates(const Run& run) {
    HtmlTable table{"gate", "asked", "", "what there was", "#margin"};
    for (const GateResult& g : run.verdict.gates) {
        const auto state = static_cast<std::size_t>(g.state);
        constexpr const char* kClasses[] = {"good", "bad", "none"};
        table.row({fmt::format("<b>{}</b>", escape(g.name)), escape(g.asked),
                   fmt::format("<span class=\"badge {}\">{}</span>", kClasses[state], kGateStates[state]),
                   escape(g.reason),
                   g.margin && std::isfinite(*g.margin) ? fmt::format("{:.3g} {}", *g.margin, g.unit) : ""});
    }
    return "<h2>Gates</h2>\n" + table.html();
}

std::string descent(const Run& run) {
    return "<h2>Descent</h2>\n<p>The middle of the lander's feet about the site. The line is the truth, as the "
           "dynamics "
           "sent it; the circles are the navigation's estimates, a few of them.</p>\n" +
           charts_of(run.folder, {{"profile", "From the side"}, {"track", "From above"}}) +
           "<h2>Height, velocity, distance from the site</h2>\n<p>Shaded: phase of the guidance and number of the "
           "leg.</p>\n" +
           charts_of(run.folder, {{"height", "Height over time"},
                                  {"velocity", "Velocity over time"},
                                  {"site", "Distance from the site over time"}});
}

std::string approach(const Run& run) {
    if (run.scenario.gear) return descent(run);
    return "<h2>Approach</h2>\n<p>The chaser's port in the target's port axes: x out of the docking interface. "
           "Scales differ across and along. The line is the truth, as the dynamics sent it; the circles are the "
           "navigation's estimates, a few of them.</p>\n" +
           charts_of(run.folder, {{"above", "From above"},
                                  {"side", "From the side"},
                                  {"front", "From the front"},
                                  {"contact", "The last three metres, from the front"}}) +
           "<h2>Range and rates</h2>\n<p>Shaded: phase of the guidance and number of the leg.</p>\n" +
           charts_of(run.folder, {{"range", "Range over time"}, {"rates", "Rates over time"}});
}

std::string thrusters(const Run& run) {
    if (run.bus.commands.empty()) return "";
    double delta_v = 0;
    for (const ActuatorCommand& c : run.bus.commands) delta_v += norm(c.impulse_n_s) / run.scenario.chaser.mass_kg;
    return fmt::format(
               "<h2>Thrusters</h2>\n<p>Impulses that the navigation commanded, along the chaser's body axes; in "
               "all a delta-v of {:.3f} m/s in {} commands.</p>\n",
               delta_v, run.bus.commands.size()) +
           charts_of(run.folder, {{"impulses", "Commanded impulses over time"}, {"delta_v", "Delta-v over time"}});
}

std::string errors(const Run& run) {
    const NavigationStatistics& n = run.verdict.navigation;
    return fmt::format(
               "<h2>Navigation error and bound</h2>\n<p>The estimated minus the true pose of the target in the "
               "chaser's "
               "body axes, with three of the standard deviations sent on CAN. {} estimates, {:.2f} % within the "
               "gate's "
               "limits in all six components; the mean of the squared errors over variances is {:.2f} (6 for an "
               "exact "
               "covariance).</p>\n",
               n.estimates, n.share_within * 100, n.nees) +
           (run.bus.estimates.empty() ? "<p>No estimates.</p>\n"
                                      : charts_of(run.folder, {{"position_x", "Position error along x"},
                                                               {"position_y", "Position error along y"},
                                                               {"position_z", "Position error along z"},
                                                               {"attitude_x", "Attitude error about x"},
                                                               {"attitude_y", "Attitude error about y"},
                                                               {"attitude_z", "Attitude error about z"}}));
}

/// A table: each condition as a bar beside its limits.
std::string contact_bars(const ContactConditions& conditions) {
    std::string rows;
    for (const ContactCondition& c : conditions) {
        // Full scale is a third beyond the limit, or just beyond the value if that is more.
        const double percent = 100 / std::max(c.max * 1.33, c.value * 1.05);
        const std::string asked =
            c.min > 0 ? fmt::format("{:g} to {:g}", c.min, c.max) : fmt::format("at most {:g}", c.max);
        rows += fmt::format(
            "<tr><td>{}</td><td class=\"bar\"><i class=\"asked\" style=\"left:{:.1f}%;width:{:.1f}%\"></i>"
            "<i class=\"{}\" style=\"width:{:.1f}%\"></i></td><td class=\"n\"><b>{:.4g}</b> "
            "{}</td><td>{}{}</td></tr>\n",
            escape(c.title), c.min * percent, (c.max - c.min) * percent, c.within() ? "value" : "value beyond",
            std::max(0.3, c.value * percent), c.value, escape(c.unit), asked, c.within() ? "" : " - beyond");
    }
    return "<table class=\"bars\"><tr><th>condition</th><th></th><th class=\"n\">value</th><th>asked</th></tr>\n" +
           rows + "</table>\n";
}

std::string contact(const Run& run) {
    if (!run.verdict.contact) return "";
    const Contact& c = *run.verdict.contact;
    if (run.scenario.gear)
        return fmt::format(
            "<h2>Touchdown</h2>\n<p>At t = {:.2f} s; {}. Green: what the scenario's gates allow.</p>\n{}", c.t_s,
            c.captured ? "it came to rest" : "it came to no rest", contact_bars(c.conditions));
    return fmt::format(
        "<h2>Contact</h2>\n<p>At t = {:.2f} s, {}. Green: what the International Docking System "
        "Standard's initial contact conditions allow (Interface Definition Document, revision E), or "
        "the scenario in their place.</p>\n{}",
        c.t_s, c.captured ? "captured" : "bounced off", contact_bars(c.conditions));
}

std::string ledger(const Run& run) {
    const LedgerStatistics& l = run.verdict.ledger;
    std::string out = fmt::format(
        "<h2>Time ledger</h2>\n<p>{} frames, {} handed over, {} deadlines met ({:.2f} %), {} "
        "on stale poses.{}</p>\n",
        l.frames, l.handed_over, l.deadlines_met,
        l.frames > 0 ? 100.0 * static_cast<double>(l.deadlines_met) / static_cast<double>(l.frames) : 0.0, l.stale,
        run.verdict.lockstep ? " In lockstep the clock stands still while a frame is made: "
                               "these times mean nothing here."
                             : "");
    if (run.verdict.lockstep || l.frames == 0) return out;
    HtmlTable table{"[ms]", "#p50", "#p90", "#p99", "#p99.9", "#max"};
    const auto row = [&](const char* name, const Distribution& d, const auto& text) {
        if (d.count > 0) table.row({name, text(d.p50), text(d.p90), text(d.p99), text(d.p999), text(d.max)});
    };
    const auto plain = [](double v) { return fmt::format("{:.2f}", v); };
    row("pose command to hand-over", l.latency_ms, plain);
    row("middle of the exposure to hand-over", l.exposure_to_hand_over_ms, plain);
    row("rendering", l.render_ms, plain);
    row("hand-over, from its deadline", l.late_ms,
        [](double v) { return fmt::format("{:.2f} {}", std::abs(v), v > 0 ? "after" : "before"); });
    return out + table.html() + charts_of(run.folder, {{"latency", "Pose command to hand-over, for each frame"}});
}

/// "Holding: hold at 12 m (camera nav)" of hold_hold_at_12_m_nav.
std::string caption(const Run& run, std::string name) {
    std::string camera;
    for (const std::string& c : run.scenario.navigation.cameras)
        if (name.ends_with("_" + c)) camera = c;
    if (!camera.empty()) name.resize(name.size() - camera.size() - 1);
    std::replace(name.begin(), name.end(), '_', ' ');
    if (name.starts_with("hold ")) name = "Holding: " + name.substr(5);
    if (name == "contact" || name == "abort") name = "At the " + name;
    return camera.empty() ? name : fmt::format("{} (camera {})", name, camera);
}

std::string picture(const fs::path& file, const std::string& text, std::string_view style = "") {
    return fmt::format(
        "<figure{0}><img alt=\"{1}\" src=\"data:image/png;base64,{2}\"/><figcaption>{1}</figcaption></figure>\n",
        style, escape(text), base64(read_text(file.string())));
}

/// Frames over the run, from the emulator's log, so independent of the navigation used.
std::string contact_sheets(const Run& run) {
    std::string out;
    std::error_code none;
    for (const std::string& camera : run.scenario.navigation.cameras)
        if (const fs::path sheet = run.folder + "/emulator/" + camera + ".png"; fs::exists(sheet, none))
            out += picture(sheet, fmt::format("Camera {}: frames over the whole run, row by row", camera),
                           " class=\"sheet\"");
    return out;
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
    const std::string sheets = contact_sheets(run);
    if (files.empty() && sheets.empty()) return "";
    std::string out = "<h2>What the navigation saw</h2>\n<div class=\"charts\">";
    for (const fs::path& file : files) out += picture(file, caption(run, file.stem().string()));
    return out + "</div>\n" + sheets;
}

/// Links to the files beside the page.
std::string logs(const Run& run) {
    constexpr std::array<std::pair<const char*, const char*>, 14> kFiles{
        {{"result.json", "the verdict"},
         {"junit.xml", "the same for CI"},
         {"scenario.toml", "the scenario with all that it is based on"},
         {"scene.toml", "the scene, likewise"},
         {"map.toml", "the scene as the navigation knows it"},
         {"charts.json", "the data of the charts"},
         {"emulator/can.log", "the CAN bus, as candump writes it"},
         {"emulator/run.json", "settings of the emulator"},
         {"dynamics/truth.csv", "the truth"},
         {"navigation/navigation.csv", "estimate, reference and command of each period"},
         {"navigation/measurements.csv", "each measurement"},
         {"emulator.log", "what the emulator printed"},
         {"dynamics.log", "what the dynamics printed"},
         {"navigation.log", "what the navigation printed"}}};
    HtmlTable table{"file", "content"};
    const auto add = [&](const std::string& file, const std::string& what) {
        std::error_code none;
        // result.json and junit.xml are written after the page.
        if (fs::exists(run.folder + "/" + file, none) || file == "result.json" || file == "junit.xml")
            table.row({fmt::format("<a href=\"{0}\">{0}</a>", escape(file)), escape(what)});
    };
    for (const auto& [file, what] : kFiles) add(file, what);
    for (const std::string& camera : run.scenario.navigation.cameras) {
        add(fmt::format("emulator/{}.ledger.csv", camera), fmt::format("time ledger of camera {}", camera));
        add(fmt::format("emulator/{}.truth.csv", camera), "every body's pose in each of its frames");
    }
    return "<h2>Logs</h2>\n" + table.html();
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
    for (const Fault& f : run.scenario.faults) {
        const std::string what = fmt::format("fault: {} {}", f.kind->title, f.axis);
        all.emplace_back(f.from_s, what);
        if (std::isfinite(f.until_s)) all.emplace_back(f.until_s, what + " is over");
    }
    for (const GateResult& g : run.verdict.gates)
        if (g.state == GateState::failed && g.t_first_s) all.emplace_back(*g.t_first_s, "gate failed: " + g.name);
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    HtmlTable table{"#t [s]", "event"};
    for (const auto& [t, what] : all) table.row({fmt::format("{:.2f}", t), escape(what)});
    return "<h2>What happened</h2>\n" + table.html();
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
    return page_around(scenario.title, head(run) + gates(run) + approach(run) + thrusters(run) + errors(run) +
                                           contact(run) + pictures(run) + ledger(run) + events(run) + logs(run) +
                                           how(run));
}

}  // namespace narpa::rehearsal
