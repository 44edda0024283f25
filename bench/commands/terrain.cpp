// narpa bench terrain - time of a ray into terrain, compared with one into a mesh of only the visible triangles.
#include <fmt/format.h>

#include "bench/commands/commands.h"
#include "bench/terrain_cost.h"

namespace narpa::cli {
namespace {

struct TerrainBenchOptions {
    TerrainCostSettings settings;
    bool gates = false;
};

nlohmann::json ray_cost_json(const RayCost& c) {
    return {{"triangles", c.triangles}, {"ns", c.ns}};
}

nlohmann::json terrain_rows(const TerrainCost& cost) {
    nlohmann::json out = nlohmann::json::array();
    for (const TerrainCostRow& r : cost.rows)
        out.push_back({{"height_m", r.height_m},
                       {"terrain", ray_cost_json(r.terrain)},
                       {"visible", ray_cost_json(r.visible)},
                       {"met", ray_cost_json(r.met)},
                       {"for_this_height", ray_cost_json(r.for_this_height)},
                       {"ratio", r.ratio()},
                       {"rays", r.rays},
                       {"missed", r.missed},
                       {"from_below", r.from_below}});
    return out;
}

void print_terrain_table(const TerrainCost& cost) {
    say(fmt::format("{:>10} {:>12} | {:>22} {:>7} | {:>22} {:>7} | {:>22} | {:>10} {:>8} {:>8}", "height, m",
                    "terrain, ns", "visible: triangles, ns", "ratio", "met: triangles, ns", "ratio",
                    "for this height alone", "rays", "missed", "from below"));
    for (const TerrainCostRow& r : cost.rows) {
        const auto mesh = [](const RayCost& c) { return fmt::format("{:>14} {:>7.1f}", c.triangles, c.ns); };
        say(fmt::format("{:>10g} {:>12.1f} | {} {:>7.3f} | {} {:>7.3f} | {} | {:>10} {:>8} {:>8}", r.height_m,
                        r.terrain.ns, mesh(r.visible), r.ratio(), mesh(r.met), r.terrain.ns / r.met.ns,
                        mesh(r.for_this_height), r.rays, r.missed, r.from_below));
    }
}

Outcome bench_terrain(const TerrainBenchOptions& o) {
    Progress progress("measuring");
    const auto cost = measure_terrain_cost(o.settings, [&](const std::string& step) { progress.show(step); });
    if (!cost) return cost.error();
    say(fmt::format(
        "{0} x {0} posts, {1} of {2} triangles, {3:.1f} s of processor time to build; medians of {4} frames",
        o.settings.posts, cost->triangles, cost->all_triangles, cost->build_s, o.settings.turns));
    print_terrain_table(*cost);
    const std::vector<std::string> faults = terrain_cost_faults(*cost);
    for (const std::string& fault : faults) say((o.gates ? "failed: " : "not reached: ") + fault);
    return nlohmann::json{{"passed", !o.gates || faults.empty()},
                          {"faults", faults},
                          {"posts", o.settings.posts},
                          {"triangles", cost->triangles},
                          {"all_triangles", cost->all_triangles},
                          {"build_s", cost->build_s},
                          {"rows", terrain_rows(*cost)}};
}

}  // namespace

Command add_bench_terrain(Parser bench_command) {
    auto o = std::make_shared<TerrainBenchOptions>();
    const Parser c = bench_command.subcommand(
        "terrain", "Time of a ray into terrain beside one into a mesh of the visible triangles");
    c.option("--posts", o->settings.posts, "Posts of the elevation model along each side")
        .range(65, 20000)
        .shows_default();
    c.option("--heights", o->settings.heights_m, "Heights of the views above the ground, metres")
        .range(1.0, 1e6)
        .comma_separated()
        .shows_default();
    c.option("--visible-rays", o->settings.visible_rays, "Rays in a pixel, each way, that decide what is visible")
        .range(1, 64)
        .shows_default();
    c.option("--turns", o->settings.turns, "Frames that give a median").range(1, 1000).shows_default();
    c.flag("--gates", o->gates, "Exit status 1 where a ratio is above 1.3, or a ray passes a crack");
    return [o] { return bench_terrain(*o); };
}

}  // namespace narpa::cli
