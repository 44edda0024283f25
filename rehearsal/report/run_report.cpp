#include "rehearsal/report/run_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "base/text/base64.h"
#include "rehearsal/judge/judge.h"
#include "rehearsal/report/template.h"
#include "rehearsal/runner/child_process.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
constexpr std::size_t kPictures = 8;

double delta_v_m_s(const Scenario& scenario, const BusRecord& bus) {
    double sum = 0;
    for (const ActuatorCommand& c : bus.commands) sum += norm(c.impulse_n_s) / scenario.chaser.mass_kg;
    return sum;
}

/// Adds what draws a condition as a bar beside its limits.
void add_bar(json& condition) {
    const double value = condition["value"], min = condition["min"], max = condition["max"];
    // Full scale is a third beyond the limit, or just beyond the value if that is more.
    const double percent_of_one = 100 / std::max(max * 1.33, value * 1.05);
    condition.update({{"asked", min > 0 ? fmt::format("{:g} to {:g}", min, max) : fmt::format("at most {:g}", max)},
                      {"min_percent", min * percent_of_one},
                      {"width_percent", (max - min) * percent_of_one},
                      {"value_percent", std::max(0.3, value * percent_of_one)}});
}

/// "Holding: hold at 12 m (camera nav)" of hold_hold_at_12_m_nav.
std::string caption(const Scenario& scenario, std::string name) {
    std::string camera;
    for (const std::string& c : scenario.navigation.cameras)
        if (name.ends_with("_" + c)) camera = c;
    if (!camera.empty()) name.resize(name.size() - camera.size() - 1);
    std::replace(name.begin(), name.end(), '_', ' ');
    if (name.starts_with("hold ")) name = "Holding: " + name.substr(5);
    if (name == "contact" || name == "abort") name = "At the " + name;
    return camera.empty() ? name : fmt::format("{} (camera {})", name, camera);
}

json picture(const fs::path& file, const std::string& text) {
    return {{"text", text}, {"png", base64(read_text(file.string()))}};
}

/// Frames over the run, from the emulator's log, so independent of the navigation used.
json contact_sheets(const Scenario& scenario, const std::string& folder) {
    json out = json::array();
    std::error_code none;
    for (const std::string& camera : scenario.navigation.cameras)
        if (const fs::path sheet = folder + "/emulator/" + camera + ".png"; fs::exists(sheet, none))
            out.push_back(picture(sheet, fmt::format("Camera {}: frames over the whole run, row by row", camera)));
    return out;
}

/// In the order in which they were taken.
json pictures(const Scenario& scenario, const std::string& folder) {
    std::vector<std::pair<fs::file_time_type, fs::path>> files;
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder + "/navigation", none))
        if (entry.path().extension() == ".png") files.emplace_back(entry.last_write_time(none), entry.path());
    std::sort(files.begin(), files.end());
    json out = json::array();
    for (const auto& [time, file] : files)
        if (out.size() < kPictures) out.push_back(picture(file, caption(scenario, file.stem().string())));
    return out;
}

/// The files beside the page.
json log_files(const Scenario& scenario, const std::string& folder) {
    json out = json::array();
    const auto add = [&](const std::string& file, const std::string& content) {
        std::error_code none;
        // result.json and junit.xml may be written after the page.
        if (fs::exists(folder + "/" + file, none) || file == "result.json" || file == "junit.xml")
            out.push_back({{"file", file}, {"content", content}});
    };
    add("result.json", "the verdict");
    add("junit.xml", "the same for CI");
    add("scenario.toml", "the scenario with all that it is based on");
    add("scene.toml", "the scene, likewise");
    add("map.toml", "the scene as the navigation knows it");
    add("charts.json", "the data of the charts");
    add("emulator/can.log", "the CAN bus, as candump writes it");
    add("emulator/run.json", "settings of the emulator");
    add("dynamics/truth.csv", "the truth");
    add("navigation/navigation.csv", "estimate, reference and command of each period");
    add("navigation/measurements.csv", "each measurement");
    for (const char* program : {"emulator", "dynamics", "navigation"})
        add(fmt::format("{}.log", program), fmt::format("what the {} printed", program));
    for (const std::string& camera : scenario.navigation.cameras) {
        add(fmt::format("emulator/{}.ledger.csv", camera), fmt::format("time ledger of camera {}", camera));
        add(fmt::format("emulator/{}.truth.csv", camera), "every body's pose in each of its frames");
    }
    return out;
}

/// In order of time.
json events(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict) {
    std::vector<std::pair<double, std::string>> all;
    for (std::size_t i = 0; i < bus.commands.size(); ++i) {
        const ActuatorCommand &c = bus.commands[i], before = i > 0 ? bus.commands[i - 1] : ActuatorCommand{};
        const double t = bus.seconds(c.t_ns);
        if (i == 0 || c.phase != before.phase || c.leg != before.leg)
            all.emplace_back(t, fmt::format("guidance: {}, {}", kGuidancePhases[static_cast<std::size_t>(c.phase)],
                                            leg_text(scenario, c.leg)));
        if (c.abort != AbortReason::none && before.abort == AbortReason::none)
            all.emplace_back(t, fmt::format("abort: {}", kAbortReasons[static_cast<std::size_t>(c.abort)]));
    }
    for (std::size_t i = 1; i < bus.reports.size(); ++i)
        if (bus.reports[i].phase != bus.reports[i - 1].phase)
            all.emplace_back(
                bus.seconds(bus.reports[i].t_ns),
                fmt::format("dynamics: {}", kDynamicsPhases[static_cast<std::size_t>(bus.reports[i].phase)]));
    for (const Fault& f : scenario.faults) {
        const std::string what = fmt::format("fault: {} {}", f.kind->title, f.axis);
        all.emplace_back(f.from_s, what);
        if (std::isfinite(f.until_s)) all.emplace_back(f.until_s, what + " is over");
    }
    for (const GateResult& g : verdict.gates)
        if (g.state == GateState::failed && g.t_first_s) all.emplace_back(*g.t_first_s, "gate failed: " + g.name);
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    json out = json::array();
    for (const auto& [t_s, text] : all) out.push_back({{"t_s", t_s}, {"text", text}});
    return out;
}

}  // namespace

std::string rehearsal_page(const Scenario& scenario, const BusRecord& bus, const Verdict& verdict,
                           const json& record, const std::string& folder) {
    const LedgerStatistics& frames = verdict.ledger;
    json page = to_json(verdict);
    if (verdict.contact)
        for (json& condition : page["contact"]["conditions"]) add_bar(condition);
    page.update({{"title", scenario.title},
                 {"outcome", verdict.passed ? "passed" : "failed"},
                 {"record", record},
                 {"landing", scenario.gear.has_value()},
                 {"charts", drawn_charts(folder)},
                 {"within_percent", verdict.navigation.share_within * 100},
                 {"lockstep", verdict.lockstep},
                 {"timed", !verdict.lockstep && frames.frames > 0},
                 {"deadlines_percent", 100.0 * static_cast<double>(frames.deadlines_met) /
                                           static_cast<double>(std::max<std::size_t>(frames.frames, 1))},
                 {"pictures", pictures(scenario, folder)},
                 {"sheets", contact_sheets(scenario, folder)},
                 {"events", events(scenario, bus, verdict)},
                 {"files", log_files(scenario, folder)}});
    page["seen"] = !page["pictures"].empty() || !page["sheets"].empty();
    if (!bus.commands.empty()) page["thrusters"] = {{"delta_v_m_s", delta_v_m_s(scenario, bus)}};
    return filled(template_text("run.html"), page);
}

std::string junit(const std::string& suite, double wall_s, json cases) {
    std::map<std::string, int> states;
    for (json& c : cases) {
        const auto state = c["state"].get<std::string>();
        ++states[state];
        c[state] = true;  // a section of the template
    }
    return filled(template_text("junit.xml"), {{"suite", suite},
                                               {"wall_s", wall_s},
                                               {"tests", cases.size()},
                                               {"failures", states["failed"]},
                                               {"skipped", states["not judged"]},
                                               {"cases", cases}});
}

std::string junit(const Verdict& verdict, const std::string& suite, double wall_s) {
    json cases = json::array();
    for (const GateResult& g : verdict.gates) {
        const std::string asked = "asked: " + g.asked;
        cases.push_back({{"name", g.name},
                         {"state", kGateStates[static_cast<std::size_t>(g.state)]},
                         {"type", "gate"},
                         {"reason", g.reason},
                         {"text", asked + "; " + full_reason(g)}});
    }
    return junit(suite, wall_s, cases);
}

}  // namespace narpa::rehearsal
