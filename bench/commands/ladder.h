/// bench/commands/ladder.h - `narpa bench render --scenes`: time and error on the benchmark scenes at several
/// sample budgets, and the ratios that the gates check; --ablation: the same with each rendering technique switched
/// off in turn.
#pragma once

#include <string>
#include <vector>

#include "apps/cli.h"
#include "bench/convergence.h"

namespace narpa::cli {

struct LadderOptions {
    std::vector<std::string> scenes;
    std::string plot;  ///< PNG; empty: none
    int threads = 0;
    bool quick = false, gates = false, ablation = false;
};

/// The names that --scenes takes.
[[nodiscard]] std::vector<std::string> benchmark_scenes();

Outcome bench_ladder(const LadderOptions& options);

[[nodiscard]] nlohmann::json to_json(const Estimate& e);

}  // namespace narpa::cli
