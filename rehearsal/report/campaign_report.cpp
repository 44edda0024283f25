#include "rehearsal/report/campaign_report.h"

#include <fmt/format.h>

#include <array>
#include <map>

#include "rehearsal/judge/verdict.h"
#include "rehearsal/report/run_report.h"
#include "rehearsal/report/template.h"

namespace narpa::rehearsal {

using nlohmann::json;

std::vector<json> contacts_of(const std::vector<RunResult>& runs) {
    std::vector<json> all;
    for (const RunResult& run : runs)
        if (run.result.is_object() && run.result["contact"].is_object()) all.push_back(run.result["contact"]);
    return all;
}

namespace {

/// The first gate that a run failed; else its trouble, or that it has no result.
std::pair<std::string, std::string> cause(const RunResult& run) {
    if (!run.result.is_object()) return {"no result", fmt::format("see {}.log", run.folder)};
    if (const std::string trouble = run.result.value("trouble", ""); !trouble.empty()) return {"trouble", trouble};
    std::pair<std::string, std::string> first{"", run.result.value("headline", "")};
    double t_first = 1e300;
    for (const json& g : run.result.value("gates", json::array())) {
        if (g.value("state", "") != "failed") continue;
        const double t =
            g.contains("t_first_s") && g["t_first_s"].is_number() ? g["t_first_s"].get<double>() : 1e299;
        if (t < t_first) t_first = t, first = {g.value("name", ""), g.value("reason", "")};
    }
    return first;
}

bool passed(const RunResult& run) {
    return run.result.is_object() && run.result.value("passed", false);
}

/// The values of one contact condition over the runs, in the order of the standard's table.
struct Condition {
    std::string name, title, unit;
    double min = 0, max = 0;
    std::vector<double> values;
};
std::vector<Condition> conditions_over(const std::vector<RunResult>& runs) {
    std::vector<Condition> all;
    for (const json& contact : contacts_of(runs)) {
        const json& conditions = contact["conditions"];
        if (all.empty())
            for (const json& c : conditions)
                all.push_back({c["name"], c["title"], c["unit"], c["min"], c["max"], {}});
        for (std::size_t i = 0; i < all.size() && i < conditions.size(); ++i)
            all[i].values.push_back(conditions[i]["value"]);
    }
    return all;
}

}  // namespace

json summarise(const Scenario& scenario, const std::vector<RunResult>& runs) {
    std::size_t good = 0, known = 0;
    std::map<std::string, json> failures;
    std::vector<double> nees, position, attitude, duration;
    json each = json::array();
    for (const RunResult& run : runs) {
        if (run.result.is_null()) continue;
        ++known;
        good += passed(run);
        each.push_back({{"run", run.run}, {"seed", run.seed}, {"folder", run.folder}, {"passed", passed(run)}});
        if (run.draws.is_object()) each.back()["draws"] = run.draws;
        if (run.result.contains("contact") && run.result["contact"].is_object())
            for (const json& c : run.result["contact"]["conditions"])
                each.back()["contact"][c["name"].get<std::string>()] = c["value"];
        if (!passed(run)) {
            const auto [gate, reason] = cause(run);
            each.back()["gate"] = gate;
            each.back()["reason"] = reason;
            failures[gate].push_back(
                {{"run", run.run}, {"seed", run.seed}, {"folder", run.folder}, {"reason", reason}});
        }
        const json& n = run.result["navigation"];
        if (n.value("estimates", 0) == 0) continue;
        nees.push_back(n["nees"]);
        position.push_back(n["position_m"]["max"]);
        attitude.push_back(n["attitude_deg"]["max"]);
        duration.push_back(run.result["t_end_s"]);
    }
    json contact = json::array();
    for (const Condition& c : conditions_over(runs)) {
        json d = to_json(distribution(c.values));
        d.update(
            {{"name", c.name}, {"title", c.title}, {"unit", c.unit}, {"asked_min", c.min}, {"asked_max", c.max}});
        contact.push_back(d);
    }
    const auto [low, high] = known > 0 ? success_interval(good, known) : std::pair{0.0, 1.0};
    return {{"passed", known == runs.size() && good == known},
            {"scenario", scenario.name},
            {"runs", runs.size()},
            {"judged", known},
            {"complete", known == runs.size()},
            {"succeeded", good},
            {"success_rate", known > 0 ? static_cast<double>(good) / static_cast<double>(known) : 0.0},
            {"success_interval_95", {low, high}},
            {"failures", failures},
            {"contact", contact},
            {"navigation",
             {{"nees", to_json(distribution(nees))},
              {"largest_position_error_m", to_json(distribution(position))},
              {"largest_attitude_error_deg", to_json(distribution(attitude))}}},
            {"duration_s", to_json(distribution(duration))},
            {"each", each}};
}

std::string campaign_junit(const std::string& suite, const std::vector<RunResult>& runs) {
    json cases = json::array();
    for (const RunResult& run : runs) {
        const auto [gate, reason] = cause(run);
        cases.push_back({{"name", fmt::format("run {} seed {}", run.run, run.seed)},
                         {"state", run.result.is_null() ? "not judged"
                                   : passed(run)        ? "passed"
                                                        : "failed"},
                         {"type", gate},
                         {"reason", run.result.is_null() ? "it has no result" : reason},
                         {"text", run.folder}});
    }
    return junit(suite, 0, cases);
}

std::string campaign_headline(const json& s) {
    const int runs = s["runs"], judged = s["judged"], good = s["succeeded"];
    if (judged < runs)
        return fmt::format(
            "Incomplete: {} of {} runs were flown, {} of them succeeded. The same command goes on with "
            "the rest",
            judged, runs, good);
    return fmt::format("{} of {} runs succeeded: {:.1f} %", good, runs, s["success_rate"].get<double>() * 100);
}

namespace {

/// What the dynamics draw for the start of a run.
constexpr std::array<const char*, 4> kStartDraws{"start_position", "start_velocity", "start_attitude",
                                                 "start_rate"};

/// A row for each run: the draws of its start, its contact, its outcome.
json draws_table(const json& summary) {
    json rows = json::array();
    for (const json& run : summary["each"]) {
        json row{{"run", run["run"]},
                 {"folder", run["folder"]},
                 {"seed", run["seed"]},
                 {"page", run.value("page", true)}};
        for (const char* draw : kStartDraws) {
            const json three = run.contains("draws") ? run["draws"].value(draw, json()) : json();
            row["cells"].push_back(three.is_array() && three.size() == 3
                                       ? fmt::format("{:.2f}, {:.2f}, {:.2f}", three[0].get<double>(),
                                                     three[1].get<double>(), three[2].get<double>())
                                       : "");
        }
        for (const json& condition : summary["contact"]) {
            const auto name = condition["name"].get<std::string>();
            const bool made = run.contains("contact") && run["contact"].contains(name);
            row["cells"].push_back(made ? fmt::format("{:.4f}", run["contact"][name].get<double>()) : "");
        }
        const bool passed = run["passed"];
        row["outcome"] = passed ? "passed" : "failed";
        row["reason"] = passed ? "" : fmt::format("{}: {}", run.value("gate", ""), run.value("reason", ""));
        rows.push_back(row);
    }
    return rows;
}

}  // namespace

std::string campaign_page(const Scenario& scenario, const json& summary, const std::string& folder) {
    const bool complete = summary["judged"] == summary["runs"], passed = summary["passed"];
    json page = summary, failed = json::array();
    for (const auto& [gate, runs] : summary["failures"].items())
        failed.push_back({{"gate", gate}, {"count", runs.size()}, {"runs", runs}});
    page.update({{"title", scenario.title},
                 {"outcome", !complete ? "incomplete"
                             : passed  ? "passed"
                                       : "failed"},
                 {"headline", campaign_headline(summary)},
                 {"low_percent", summary["success_interval_95"][0].get<double>() * 100},
                 {"high_percent", summary["success_interval_95"][1].get<double>() * 100},
                 {"made_contact", !summary["contact"].empty()},
                 {"where", scenario.gear ? "Where they touched down" : "Where the ports met"},
                 {"charts", drawn_charts(folder)},
                 {"table", draws_table(summary)},
                 {"failed", failed}});
    return filled(template_text("campaign.html"), page);
}

}  // namespace narpa::rehearsal
