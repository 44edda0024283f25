/// apps/bench.h - the subcommands of `narpa bench`, one file each.
#pragma once

#include "apps/cli.h"

namespace narpa::cli {

Command add_bench_render(Parser bench);
Command add_bench_loop(Parser bench);
Command add_bench_estimate(CLI::App& bench);

}  // namespace narpa::cli
