// narpa bench estimate - each estimator: error against its bound, failures, time.
#include <fmt/format.h>

#include <algorithm>

#include "emulator/cli/bench.h"
#include "emulator/cli/bench_scene.h"
#include "emulator/pnp_bench.h"
#include "emulator/realtime.h"

namespace narpa::cli {
namespace {

struct Options {
    std::vector<std::string> only;
    PnpBenchOptions pnp;
};

/// One estimator's part of the bench: says what it found, adds to `faults`, and returns its document.
using Part = nlohmann::json (*)(const Options&, std::vector<std::string>& faults);

nlohmann::json bench_pnp(const Options& o, std::vector<std::string>& faults) {
    const Progress progress;
    const std::vector<PnpCell> cells = run_pnp_bench(
        o.pnp,
        [&](std::size_t done, std::size_t of) {
            progress.tell(fmt::format("points: cell {} of {}", done + 1, of));
        },
        stop_flag());
    const PnpVerdict verdict = judge(cells);
    say(in_words(cells) + in_words(verdict));
    // Times are told, not judged: the machine may have other work.
    constexpr double kWorstRms = 1.1;
    if (verdict.worst_rms > kWorstRms)
        faults.push_back(
            fmt::format("points: RMS of {:.3f} bounds, expected at most {:g}", verdict.worst_rms, kWorstRms));
    if (verdict.more_failures > 0)
        faults.push_back(
            fmt::format("points: more failures than {} in {} cells", kPnpPeerCold, verdict.more_failures));
    return {{"cells", to_json(cells)}, {"verdict", to_json(verdict)}};
}

constexpr std::pair<const char*, Part> kParts[] = {{"pnp", bench_pnp}};

Outcome bench(const Options& o) {
    stop_on_signals();
    std::vector<std::string> faults;
    nlohmann::json document;
    for (const auto& [name, part] : kParts) {
        const bool wanted = o.only.empty() || std::find(o.only.begin(), o.only.end(), name) != o.only.end();
        if (wanted && !stop_flag()) document[name] = part(o, faults);
    }
    if (stop_flag()) faults.emplace_back("interrupted before the end");
    for (const std::string& fault : faults) say("failed: " + fault);
    document["passed"] = faults.empty();
    document["faults"] = faults;
    return document;
}

}  // namespace

Command add_bench_estimate(CLI::App& bench_command) {
    auto o = std::make_shared<Options>();
    CLI::App* c = bench_command.add_subcommand(
        "estimate", "Estimators of the relative pose: error against the Cramer-Rao bound, failures, time");
    std::vector<std::string> names;
    for (const auto& [name, part] : kParts) names.emplace_back(name);
    c->add_option("--only", o->only,
                  fmt::format("Only these parts, separated by commas: {}", fmt::join(names, ", ")))
        ->delimiter(',')
        ->check(CLI::IsMember(names));
    c->add_option("--trials", o->pnp.trials, "Draws of each cell")
        ->check(CLI::Range(1, 1'000'000))
        ->capture_default_str();
    c->add_option("--points", o->pnp.points, "pnp: numbers of points")->delimiter(',')->check(CLI::Range(4, 1000));
    c->add_option("--noise-px", o->pnp.noise_px, "pnp: standard deviations of a pixel")
        ->delimiter(',')
        ->check(CLI::Range(1e-6, 100.0));
    c->add_option("--ranges", o->pnp.ranges_m, "pnp: metres to the body")
        ->delimiter(',')
        ->check(CLI::Range(1.0, 1e6));
    CLI::Option* nominal = c->add_flag("!--nominal-only", o->pnp.hard_cases, "pnp: no hard cases");
    c->add_flag("!--hard-only", o->pnp.nominal, "pnp: only the hard cases")->excludes(nominal);
    c->add_option("--seed", o->pnp.seed, "Of all draws")->capture_default_str();
    c->footer("Exit status 1 where an estimator is less exact than it must be, or the bench was interrupted.");
    return [o] { return bench(*o); };
}

}  // namespace narpa::cli
