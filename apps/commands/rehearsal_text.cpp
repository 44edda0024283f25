#include "apps/commands/rehearsal_text.h"

#include <fmt/format.h>

#include "rehearsal/report/campaign_report.h"

namespace narpa::cli {

Outcome print_run(const Result<rehearsal::RehearsalResult>& done) {
    if (!done) return done.error();
    for (const rehearsal::GateResult& g : done->verdict.gates) {
        say(fmt::format("  {:<10} {:<19} {}", rehearsal::kGateStates[static_cast<std::size_t>(g.state)], g.name,
                        g.reason));
        for (const std::string& detail : g.details) say(fmt::format("{:33}{}", "", detail));
    }
    say(done->verdict.outcome);
    if (!done->page.empty()) say("wrote " + done->page);
    if (done->written) return done->result;
    say("narpa: " + done->written.error().text());
    nlohmann::json document = done->result;
    document.update(cli::to_json(done->written.error()));
    return document;
}

Outcome print_campaign(Result<nlohmann::json> summary, const std::string& folder) {
    if (!summary) return summary;
    const nlohmann::json& s = *summary;
    say(fmt::format("{}; with 95 % confidence {:.1f} to {:.1f} % of all do", rehearsal::campaign_headline(s),
                    s["success_interval_95"][0].get<double>() * 100,
                    s["success_interval_95"][1].get<double>() * 100));
    for (const auto& c : s["contact"])
        say(fmt::format("  {:<22} {:>8.4f} +- {:.4f}, at most {:.4f} {}; asked {:g} to {:g}",
                        c["title"].get<std::string>(), c["mean"].get<double>(), c["sigma"].get<double>(),
                        c["max"].get<double>(), c["unit"].get<std::string>(), c["asked_min"].get<double>(),
                        c["asked_max"].get<double>()));
    for (const auto& [gate, list] : s["failures"].items()) say(fmt::format("  {}: {} runs", gate, list.size()));
    say("wrote " + folder + "/index.html");
    return summary;
}

}  // namespace narpa::cli
