// narpa-bench - measures narpa: speed against error, delays, deadlines. `narpa bench` starts it.
#include "apps/cli.h"
#include "bench/commands/commands.h"

int main(int argc, char** argv) {
    using namespace narpa::cli;
    return run_commands(argc, argv,
                        {"narpa bench",
                         "Measure speed against error",
                         {"narpa bench loop docking", "narpa bench render --spp 4,16,64 -o out/error.png"}},
                        {add_bench_render, add_bench_loop, add_bench_latency, add_bench_lidar, add_bench_atmosphere,
                         add_bench_estimate, add_bench_terrain, add_bench_frames});
}
