// narpa bench - speed against error, one subcommand for each thing that is measured.
#include "apps/bench.h"

#include "apps/cli.h"

namespace narpa::cli {

Command add_bench(Parser app) {
    const Parser bench = app.subcommand("bench", "Measure speed against error");
    auto chosen = std::make_shared<Command>();
    bench.choice<Command>({add_bench_render, add_bench_loop, add_bench_estimate}, *chosen);
    return [chosen] { return (*chosen)(); };
}

}  // namespace narpa::cli
