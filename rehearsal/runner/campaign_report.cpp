// The summary of a campaign as JSON, JUnit and HTML.
#include <fmt/format.h>

#include <map>

#include "rehearsal/judge/verdict.h"
#include "rehearsal/runner/campaign.h"
#include "rehearsal/runner/report.h"

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
    std::size_t failed = 0, missing = 0;
    for (const RunResult& run : runs)
        failed += !passed(run) && !run.result.is_null(), missing += run.result.is_null();
    std::string out =
        fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"0\" skipped=\"{}\">\n",
                    escape(suite), runs.size(), failed, missing);
    for (const RunResult& run : runs) {
        out +=
            fmt::format("    <testcase classname=\"{}\" name=\"run {} seed {}\"", escape(suite), run.run, run.seed);
        if (run.result.is_null()) {
            out += "><skipped message=\"it has no result\"/></testcase>\n";
        } else if (passed(run)) {
            out += "/>\n";
        } else {
            const auto [gate, reason] = cause(run);
            out += fmt::format("><failure type=\"{}\" message=\"{}\">{}</failure></testcase>\n", escape(gate),
                               escape(reason), escape(run.folder));
        }
    }
    return out + "  </testsuite>\n";
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

std::string campaign_page(const Scenario& scenario, const json& s, const std::string& folder) {
    const auto percent = [](const json& v) { return v.get<double>() * 100; };
    std::string body = fmt::format(
        "<h1>{}</h1>\n<p class=\"lead\">{} {}</p>\n<p>With 95 % confidence between {:.1f} and {:.1f} % of all runs "
        "succeed (Clopper and Pearson).</p>\n",
        escape(scenario.title),
        s["judged"] == s["runs"] ? badge(s["passed"]) : "<span class=\"badge none\">incomplete</span>",
        escape(campaign_headline(s)), percent(s["success_interval_95"][0]), percent(s["success_interval_95"][1]));
    const auto value = [](const json& d, const char* key, int digits) {
        return fmt::format("{:.{}f}", d[key].get<double>(), digits);
    };
    if (!s["contact"].empty()) {
        HtmlTable table{"condition", "#asked", "#mean", "#sigma", "#least", "#p99", "#most", ""};
        for (const json& c : s["contact"])
            table.row({c["title"],
                       fmt::format("{:g} to {:g}", c["asked_min"].get<double>(), c["asked_max"].get<double>()),
                       value(c, "mean", 4), value(c, "sigma", 4), value(c, "min", 4), value(c, "p99", 4),
                       value(c, "max", 4), c["unit"]});
        body += "<h2>Contact</h2>\n" +
                charts_of(folder, {{"where", scenario.gear ? "Where they touched down" : "Where the ports met"},
                                   {"rates", "Rates at contact"},
                                   {"angles", "Angles at contact"},
                                   {"tilt", "Tilt and angular rate at the touchdown"}}) +
                table.html();
    }
    HtmlTable navigation{"of each run", "#mean", "#p50", "#p99", "#most"};
    const auto row = [&](const char* title, const json& d) {
        if (d.is_object())
            navigation.row(
                {title, value(d, "mean", 3), value(d, "p50", 3), value(d, "p99", 3), value(d, "max", 3)});
    };
    row("squared errors over variances (6 is right)", s["navigation"]["nees"]);
    row("largest position error [m]", s["navigation"]["largest_position_error_m"]);
    row("largest attitude error [deg]", s["navigation"]["largest_attitude_error_deg"]);
    row("time until the end [s]", s["duration_s"]);
    body += "<h2>Navigation</h2>\n" + navigation.html() + "<h2>Failures</h2>\n";
    if (s["failures"].empty()) body += "<p>None.</p>\n";
    const auto link = [](const json& run, std::string_view words) {
        return fmt::format("<a href=\"{}/index.html\">{}{}</a>", run["folder"].get<std::string>(),
                           run["run"].get<int>(), words);
    };
    for (const auto& [gate, list] : s["failures"].items()) {
        HtmlTable table{"run", "seed", "reason"};
        for (const json& f : list)
            table.row({link(f, ""), f["seed"].dump(), escape(f["reason"].get<std::string>())});
        body += fmt::format("<h3>{}: {} runs</h3>\n", escape(gate), list.size()) + table.html();
    }
    body += "<h2>All runs</h2>\n<p>";
    for (const json& run : s["each"]) body += link(run, run["passed"].get<bool>() ? "" : " (failed)") + " ";
    return page_around(scenario.title, body + "</p>\n");
}

}  // namespace narpa::rehearsal
