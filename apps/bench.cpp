// narpa bench - speed against error, one subcommand for each thing that is measured.
#include "apps/bench.h"

#include "apps/cli.h"

namespace narpa::cli {

Command add_bench(CLI::App& app) {
    CLI::App* bench = app.add_subcommand("bench", "Measure speed against error");
    bench->require_subcommand(1);
    auto chosen = std::make_shared<Command>();
    for (const auto& add : {add_bench_render, add_bench_loop, add_bench_estimate}) {
        const Command command = add(*bench);
        CLI::App* subcommand = bench->get_subcommands([](const CLI::App*) { return true; }).back();
        subcommand->final_callback([chosen, command] { *chosen = command; });
    }
    return [chosen] { return (*chosen)(); };
}

}  // namespace narpa::cli
