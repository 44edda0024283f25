/// bench/commands/commands.h - the subcommands of `narpa bench`, one file each.
#pragma once

#include "apps/cli.h"

namespace narpa::cli {

/// Each adds its subcommand and returns what runs when it is chosen.
Command add_bench_render(Parser bench);
Command add_bench_loop(Parser bench);
Command add_bench_latency(Parser bench);
Command add_bench_lidar(Parser bench);
Command add_bench_atmosphere(Parser bench);
Command add_bench_estimate(Parser bench);
Command add_bench_terrain(Parser bench);
Command add_bench_frames(Parser bench);

}  // namespace narpa::cli
