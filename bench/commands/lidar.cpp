// narpa bench lidar - time on one core and range error of a LiDAR against its number of sub-rays.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "apps/scene_options.h"
#include "base/time.h"
#include "bench/commands/commands.h"
#include "bench/commands/scene.h"
#include "bench/lidar_cost.h"
#include "protocols/lidar/lidar_model.h"

namespace narpa::cli {
namespace {

constexpr double kDivergence_rad = 3e-3;  // where the scene states none: that of a VLP-16
constexpr double kShippedTime_s = 50;     // of the shipped scene: the station is then 1.2 m away

struct LidarBenchOptions {
    SceneArgument scene;
    std::string lidar;
    PoseOptions pose;
    std::optional<double> time_s, divergence_rad;
    LidarCostSettings settings;
    bool gates = false;
};

Status check_sub_rays(std::vector<int>& sub_rays) {
    using Model = LidarReceiverModel;
    for (const int n : sub_rays)
        if (n != 1 && (n < Model::kMinSubRays || n > Model::kMaxSubRays))
            return Error{
                fmt::format("--sub-rays {}, expected 1, or {} to {}", n, Model::kMinSubRays, Model::kMaxSubRays)};
    std::sort(sub_rays.begin(), sub_rays.end());
    sub_rays.erase(std::unique(sub_rays.begin(), sub_rays.end()), sub_rays.end());
    return Ok{};
}

/// The scene with its poses; the shipped one flies its own approach.
Result<Scene> load(LidarBenchOptions& o) {
    auto scene = scene_or_shipped(o.scene, "docking/docking.toml");
    if (!scene) return scene.error();
    if (o.scene.file.empty() && o.pose.trajectory.empty() && o.pose.poses.empty()) {
        o.pose.trajectory = std::filesystem::path(scene->file).replace_filename("approach.csv");
        if (!o.time_s) o.time_s = kShippedTime_s;
    }
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    return scene;
}

nlohmann::json range_error(const RangeError& e) {
    return {{"shots", e.shots},         {"lost", e.lost},   {"extra", e.extra},
            {"other_surface", e.other}, {"rms_m", e.rms_m}, {"same_surface_rms_m", e.same_surface_rms_m},
            {"p50_m", e.p50_m},         {"p99_m", e.p99_m}};
}

nlohmann::json rows(const LidarCost& cost) {
    nlohmann::json out = nlohmann::json::array();
    for (const LidarCostRow& r : cost.rows) {
        nlohmann::json row{{"sub_rays", r.sub_rays},       {"fire_s", r.fire_s},
                           {"tracer_s", r.tracer_s},       {"shots_per_s", cost.shots_per_s(r)},
                           {"load", cost.load(r)},         {"to_tracer", r.fire_s / r.tracer_s},
                           {"error", range_error(r.error)}};
        if (r.embree_s) {
            row["embree_s"] = *r.embree_s;
            row["to_embree"] = r.fire_s / *r.embree_s;
        }
        out.push_back(std::move(row));
    }
    return out;
}

void print_table(const LidarCost& cost) {
    say(fmt::format("{:>8} {:>10} {:>10} {:>9} {:>10} {:>10} {:>12} {:>12} {:>10} {:>10} {:>8} {:>6} {:>6}",
                    "sub-rays", "ms/turn", "kshot/s", "of a core", "to tracer", "to Embree", "RMS, mm",
                    "same surface", "median", "99 %", "other", "lost", "extra"));
    for (const LidarCostRow& r : cost.rows)
        say(fmt::format(
            "{:>8} {:>10.3f} {:>10.0f} {:>7.2f} % {:>10.2f} {:>10} {:>12.3f} {:>12.3f} {:>10.4f} {:>10.3f} {:>8} "
            "{:>6} {:>6}",
            r.sub_rays, 1e3 * r.fire_s, 1e-3 * cost.shots_per_s(r), 100 * cost.load(r), r.fire_s / r.tracer_s,
            r.embree_s ? fmt::format("{:.2f}", r.fire_s / *r.embree_s) : "-", 1e3 * r.error.rms_m,
            1e3 * r.error.same_surface_rms_m, 1e3 * r.error.p50_m, 1e3 * r.error.p99_m, r.error.other, r.error.lost,
            r.error.extra));
}

Outcome bench_lidar(LidarBenchOptions o) {
    if (auto good = check_sub_rays(o.settings.sub_rays); !good) return good.error();
    auto scene = load(o);
    if (!scene) return scene.error();
    auto index = sensor_named(scene->lidars, o.lidar, "LiDAR", scene->file);
    if (!index) return index.error();
    const Lidar& lidar = scene->lidars[*index];
    LidarCostSettings& s = o.settings;
    s.lidar = *index;
    const double own_rad = lidar.receiver.beam_divergence_rad;
    s.beam_divergence_rad = o.divergence_rad.value_or(own_rad > 0 ? own_rad : kDivergence_rad);
    s.from_ns = std::llround(o.time_s.value_or(0) * 1e9);
    const std::string file = scene->file, name = lidar.name;
    const std::int64_t to_ns = s.from_ns + static_cast<std::int64_t>(1e9 / lidar.model->spec().rate_hz);

    Progress progress("measuring");
    const auto cost = measure_lidar_cost(
        *std::move(scene), s, [&](World& world) { return o.pose.load(world, s.from_ns, to_ns); },
        [&](const std::string& step) { progress.show(step); });
    if (!cost) return cost.error();
    say(
        fmt::format("{}, LiDAR \"{}\" ({} at {:g} Hz), beam of {:g} mrad; one turn from {:g} s: {} packets, {} "
                    "shots, {} returns",
                    file, name, cost->make, cost->rate_hz, 1e3 * cost->beam_divergence_rad, to_seconds(s.from_ns),
                    cost->packets, cost->shots, cost->returns));
    say(fmt::format("CPU time of one thread, medians of {} turns; range error against {} sub-rays ({:.1f} s)",
                    s.turns, cost->reference_sub_rays, cost->reference_s));
    print_table(*cost);
    const std::vector<std::string> faults = lidar_cost_faults(*cost);
    for (const std::string& fault : faults) say((o.gates ? "failed: " : "not reached: ") + fault);
    return nlohmann::json{{"passed", !o.gates || faults.empty()},
                          {"faults", faults},
                          {"scene", file},
                          {"lidar", name},
                          {"make", cost->make},
                          {"rate_hz", cost->rate_hz},
                          {"beam_divergence_rad", cost->beam_divergence_rad},
                          {"pulse_length_m", cost->pulse_length_m},
                          {"time_s", to_seconds(s.from_ns)},
                          {"turns", s.turns},
                          {"packets", cost->packets},
                          {"shots", cost->shots},
                          {"returns", cost->returns},
                          {"reference", {{"sub_rays", cost->reference_sub_rays}, {"fire_s", cost->reference_s}}},
                          {"rows", rows(*cost)}};
}

}  // namespace

Command add_bench_lidar(Parser bench_command) {
    auto o = std::make_shared<LidarBenchOptions>();
    const Parser c = bench_command.subcommand(
        "lidar", "Time and range error of a LiDAR's turn at several numbers of sub-rays, beside Embree alone");
    c.option(
        "SCENE", o->scene.file,
        fmt::format("Scene file (TOML; default: the docking scene that is installed with narpa, {:g} s into its "
                    "approach)",
                    kShippedTime_s));
    o->scene.add_settings_to(c);
    c.option("--lidar", o->lidar, "Name of the LiDAR (default: the first)").type_name("NAME");
    c.option("--time", o->time_s, "Simulation time of the turn's start (default: 0)")
        .type_name("SECONDS")
        .range(0.0, 9e9);
    o->pose.add_to(c);
    c.option("--sub-rays", o->settings.sub_rays, "Sub-rays to measure with")
        .comma_separated()
        .type_name("LIST")
        .shows_default();
    c.option(
         "--divergence", o->divergence_rad,
         fmt::format("Full angle of the beam (default: the scene's, or {:g} where it has none)", kDivergence_rad))
        .type_name("RAD")
        .range(1e-6, 0.1);
    c.option("--reference-sub-rays", o->settings.reference_sub_rays, "Sub-rays of the reference")
        .range(128, 65536)
        .shows_default();
    c.option("--turns", o->settings.turns, "Turns that give a median time").range(1, 1000).shows_default();
    c.flag("--gates", o->gates,
           "Exit status 1 where a VLP-16 at up to 10 Hz takes more than 5 % of a core with 1 sub-ray, or 25 % with "
           "16");
    return [o] { return bench_lidar(*o); };
}

}  // namespace narpa::cli
