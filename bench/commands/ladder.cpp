// narpa bench render --scenes - time and error on the benchmark scenes; --ablation - the effect of each rendering
// technique, switched off in turn.
#include "bench/commands/ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "bench/commands/scene.h"
#include "bench/gates.h"
#include "plot/plot.h"
#include "renderer/trajectory/trajectory.h"

namespace narpa::cli {
namespace {

struct BenchmarkScene {
    const char *name, *file, *camera;
    RenderSettings::Method method;
    int max_depth;         ///< of paths
    double at_s;           ///< time on the approach; negative: no approach
    bool loop;             ///< the plain loop can render it
    double speed_up_min;   ///< over the plain loop at equal error; 0: not checked
    double speed_up_from;  ///< checked from this many rays per pixel on
    int size;              ///< px, the longer side
    bool far = false;      ///< up to 64 samples per pixel, to show the convergence
};
using Method = RenderSettings::Method;
constexpr std::array<BenchmarkScene, 6> kBenchmarkScenes{{
    {"craft", "craft/craft.toml", "near", Method::direct, 1, -1, true, 2, 0, 512},
    {"craft-paths", "craft/craft.toml", "near", Method::path, 5, -1, true, 3, 16, 256, true},  // four bounces
    {"docking", "docking/docking.toml", "nav", Method::direct, 1, 27, false, 0, 0, 320},
    {"docking-contact", "docking/docking.toml", "nav", Method::direct, 1, 57, false, 0, 0, 320},
    {"cornell", "cornell/cornell.toml", "published", Method::path, 8, -1, true, 0, 0, 128},
    // Held-out scene: nothing was tuned on it.
    {"craft-and-ball", "craft/craft-and-ball.toml", "chase", Method::path, 5, -1, false, 0, 0, 128},
}};

constexpr int kReferenceSpp = 4096, kFarReferenceSpp = 16384;
/// Numbers of frames whose median time is reported; kQuick: smoke test.
constexpr int kLadderFrames = 9, kRatioFrames = 15, kLoads = 7, kQuick = 2;
static_assert(std::min({kLadderFrames, kRatioFrames, kLoads}) >= 7);

/// The scene with the camera and method that are measured.
Result<std::unique_ptr<World>> world_of(const BenchmarkScene& s, int size, std::size_t& camera) {
    auto scene = scene_or_shipped({}, s.file, s.method);
    if (!scene) return scene.error();
    const std::string folder = scene->file.substr(0, scene->file.rfind('/'));
    scene->render.max_depth = s.max_depth;
    auto index = sensor_named(scene->cameras, s.camera, "camera", scene->file);
    if (!index) return index.error();
    camera = *index;
    resize_longer_side(scene->cameras[camera], size);
    auto world = World::create(*std::move(scene));
    if (!world || s.at_s < 0) return world;
    auto rows = read_trajectory(folder + "/approach.csv");
    if (!rows) return rows.error();
    const auto t_ns = static_cast<std::int64_t>(s.at_s * 1e9);
    if (auto loaded = (*world)->load(*rows, t_ns, t_ns); !loaded) return loaded.error();
    return world;
}

Result<SceneLadder> measure(const BenchmarkScene& s, const LadderOptions& o, TracingThreads& threads) {
    SceneLadder l;
    l.scene = s.name;
    l.speed_up_min = s.speed_up_min;
    l.speed_up_from = s.speed_up_from;
    l.reference_spp = o.quick ? 256 : s.far ? kFarReferenceSpp : kReferenceSpp;
    std::size_t camera = 0;
    auto world = world_of(s, o.quick ? 48 : s.size, camera);
    if (!world) return world.error();
    l.width = (*world)->scene().cameras[camera].width;
    l.height = (*world)->scene().cameras[camera].height;

    LadderSettings settings;
    settings.reference_spp = l.reference_spp;
    settings.t_ns = static_cast<std::int64_t>(std::max(0.0, s.at_s) * 1e9);
    settings.frames = o.quick ? kQuick : kLadderFrames;
    if (o.ablation) {
        settings.loop_spp.clear();
        settings.spp.clear(), settings.rays_per_pixel.clear();
        if (s.method == Method::direct)
            settings.rays_per_pixel = {4, 8, 16};
        else if ((*world)->scene().sun)
            settings.rays_per_pixel = {8, 16, 32};
        else
            settings.spp = {8, 16, 32};
        settings.ablation = true;
    } else if (s.far && !o.quick) {
        settings.spp.push_back(64);
        settings.rays_per_pixel.push_back(64);
        settings.loop_spp.push_back(1024);
    }
    ReferenceLoop loop;
    if (s.loop && !o.ablation) {
        BodyPoses at((*world)->scene().bodies.size());
        (*world)->place(settings.t_ns, -1, at);
        auto made = reference_loop((*world)->scene(), at);
        if (!made) return made.error();
        loop = *std::move(made);
    }
    Progress progress(s.name);
    l.ladder = measure_ladder(**world, camera, settings, loop, threads,
                              [&](const std::string& step) { progress.show(step); });
    return l;
}

Result<CraftRatios> measure_craft(const LadderOptions& o, TracingThreads& threads) {
    const auto load = [&] {
        auto scene = scene_or_shipped({}, "craft/craft.toml");
        if (scene && o.quick)
            for (Camera& c : scene->cameras) resize_longer_side(c, 128);
        return scene;
    };
    Progress progress("craft");
    return measure_ratios(load, o.quick ? kQuick : kRatioFrames, o.quick ? 1 : kLoads, threads,
                          [&](const std::string& step) { progress.show(step); });
}

// Tables and JSON

nlohmann::json describe(const PhaseTimes& times) {
    nlohmann::json out = nlohmann::json::object();
    for (std::size_t k = 0; k < kPhases; ++k) out[kPhaseNames[k]] = static_cast<double>(times[k]) * 1e-9;
    return out;
}

/// "rays 41 %, shading 20 %", in the order of the phases.
std::string shares(const PhaseTimes& times) {
    double sum = 0;
    for (const std::int64_t t : times) sum += static_cast<double>(t);
    std::string text;
    for (std::size_t k = 0; k < kPhases && sum > 0; ++k)
        if (times[k] > 0)
            text += fmt::format("{}{} {:.0f} %", text.empty() ? "" : ", ", kPhaseNames[k],
                                100 * static_cast<double>(times[k]) / sum);
    return text;
}

void print_ratios(const CraftRatios& r) {
    const FrameCost& c = r.near;
    const auto ms = [](double s) { return 1e3 * s; };
    say(fmt::format("craft, {} px, {:.1f} % of them covered, direct, 1 spp", c.raw.primaries,
                    100 * static_cast<double>(c.raw.hits) / static_cast<double>(c.raw.primaries)));
    say(fmt::format("  Embree's calls alone  {:>9.3f} ms   primary {:.3f}, shadow {:.3f} ({} rays)",
                    ms(c.raw.seconds()), ms(c.raw.primary_s), ms(c.raw.shadow_s), c.raw.shadow_rays));
    say(fmt::format(
        "  whole frame           {:>9.3f} ms   radiance {:.3f}, detector and conversion {:.3f}; copy {:.3f}",
        ms(c.frame_s), ms(c.radiance_s), ms(c.detector_s), ms(c.hand_over_s)));
    if (const std::string text = shares(c.phase_ns); !text.empty()) say("  radiance goes to      " + text);
    say(fmt::format("  frame / Embree        {:>9.3f}", c.to_raw()));
    say(fmt::format("  1 % / full cover      {:>9.4f}      {:.3f} / {:.3f} ms", r.edge_s / r.filled_s, ms(r.edge_s),
                    ms(r.filled_s)));
    say(fmt::format("  the same, from afar   {:>9.4f}      {:.3f} ms; Embree's calls on its rays alone {:.3f} ms",
                    r.far_s / r.filled_s, ms(r.far_s), ms(r.far.raw.seconds())));
    say(fmt::format("  a moved body costs    {:>9.3f} ms", ms(r.moved_s - r.still_s)));
    say(fmt::format("  load to first frame   {:>9.3f} s", r.load_s));
}

void print_ladder(const SceneLadder& l) {
    say(fmt::format(
        "{}, {} x {}, reference {} spp: mean {:.5g} W/(m^2 sr), noise {:.2g} (subtracted); detector and "
        "conversion {:.3f} ms",
        l.scene, l.width, l.height, l.reference_spp, l.ladder.level, l.ladder.reference_noise,
        1e3 * l.ladder.detector_s));
    say(fmt::format("  {:<14} {:>10} {:>10} {:>12} {:>20} {:>9} {:>10} {:>9}  {}", "budget", "ms", "CPU ms", "rays",
                    "RMSE", "bias, %", "predicted", "to loop", "where the time goes"));
    for (const Rung& r : l.ladder.rungs) {
        const auto s = r.loop ? std::nullopt : speed_up(l.ladder, r);
        // Frames without random numbers differ only by the rounding of their sums.
        const double error = r.rmse.standard_error < 1e-9 * r.rmse.value ? 0 : r.rmse.standard_error;
        const std::string predicted = r.loop        ? ""
                                      : r.predicted ? fmt::format("x {:.2f}", r.predicted_to_measured())
                                                    : "unknown";
        say(fmt::format("  {:<14} {:>10.3f} {:>10.3f} {:>12.0f} {:>10.4g} +- {:<6.1g} {:>+9.3f} {:>10} {:>9}  {}",
                        r.name, 1e3 * r.median_s(), 1e3 * r.median_cpu_s(), r.rays, r.rmse.value, error,
                        100 * r.bias.value / l.ladder.level, predicted,
                        r.loop ? ""
                        : s    ? fmt::format("x {:.2f}", *s)
                               : "-",
                        shares(r.phase_ns)));
    }
    for (const bool adaptive : {true, false}) {
        const auto s = speed_ups(l.ladder, adaptive), cpu = speed_ups(l.ladder, adaptive, TimeBy::cpu);
        if (!s) continue;
        say(fmt::format(
            "  at equal error {:.2f} times as fast as the plain loop: {}, median of {} ({:.2f} to {:.2f}); "
            "by CPU time {:.2f}",
            s->median, adaptive ? "budgets in rays" : "fixed spp", s->budgets, s->least, s->most, cpu->median));
    }
}

void print_ablation(const SceneLadder& l) {
    say(fmt::format("{}, {} x {}, reference {} spp: mean {:.5g} W/(m^2 sr)", l.scene, l.width, l.height,
                    l.reference_spp, l.ladder.level));
    say(fmt::format("  {:<14} {:<20} {:>10} {:>20} {:>18} {:>9} {:>14}", "budget", "without", "CPU ms", "RMSE",
                    "bias, %", "predicted", "at equal error"));
    for (const Rung& r : l.ladder.rungs) {
        const auto cost = r.without.empty() ? std::nullopt : cost_at_equal_error(l.ladder, r);
        const double percent = 100 / l.ladder.level;
        say(fmt::format("  {:<14} {:<20} {:>10.3f} {:>10.4g} +- {:<6.1g} {:>+9.3f} +- {:<5.2g} {:>9} {:>14}",
                        r.name, r.without, 1e3 * r.median_cpu_s(), r.rmse.value, r.rmse.standard_error,
                        percent * r.bias.value, percent * r.bias.standard_error,
                        r.predicted ? fmt::format("x {:.2f}", r.predicted_to_measured()) : "unknown",
                        cost ? fmt::format("x {:.2f}", *cost) : ""));
    }
}

nlohmann::json describe(const CraftRatios& r) {
    return {{"pixels", r.near.raw.primaries},
            {"covered", static_cast<double>(r.near.raw.hits) / static_cast<double>(r.near.raw.primaries)},
            {"raw",
             {{"primary_s", r.near.raw.primary_s},
              {"shadow_s", r.near.raw.shadow_s},
              {"shadow_rays", r.near.raw.shadow_rays},
              {"shadowed", r.near.raw.shadowed}}},
            {"frame_s", r.near.frame_s},
            {"radiance_s", r.near.radiance_s},
            {"detector_s", r.near.detector_s},
            {"hand_over_s", r.near.hand_over_s},
            {"phase_s", describe(r.near.phase_ns)},
            {"frame_to_raw", r.near.to_raw()},
            {"edge_s", r.edge_s},
            {"filled_s", r.filled_s},
            {"edge_to_filled", r.edge_s / r.filled_s},
            {"far_s", r.far_s},
            {"far_to_filled", r.far_s / r.filled_s},
            {"far_raw_s", r.far.raw.seconds()},
            {"still_s", r.still_s},
            {"moved_s", r.moved_s},
            {"load_s", r.load_s}};
}

nlohmann::json describe(const SceneLadder& l) {
    nlohmann::json rungs = nlohmann::json::array();
    for (const Rung& r : l.ladder.rungs) {
        nlohmann::json rung{{"name", r.name},           {"loop", r.loop},       {"adaptive", r.adaptive},
                            {"median_s", r.median_s()}, {"seconds", r.seconds}, {"cpu_seconds", r.cpu_seconds},
                            {"rays", r.rays},           {"samples", r.samples}, {"rmse", to_json(r.rmse)},
                            {"bias", to_json(r.bias)}};
        if (!r.loop) {
            rung["step"] = kStepNames[static_cast<std::size_t>(r.step)];
            rung["predicted"] = r.predicted ? nlohmann::json(*r.predicted) : nlohmann::json(nullptr);
            rung["phase_s"] = describe(r.phase_ns);
            if (const auto s = speed_up(l.ladder, r)) rung["speed_up"] = *s;
            if (!r.without.empty()) {
                rung["without"] = r.without;
                if (const auto cost = cost_at_equal_error(l.ladder, r)) rung["cost_at_equal_error"] = *cost;
            }
        }
        rungs.push_back(std::move(rung));
    }
    nlohmann::json out{
        {"scene", l.scene},
        {"width", l.width},
        {"height", l.height},
        {"reference",
         {{"spp", l.reference_spp}, {"mean", l.ladder.level}, {"noise_rms", l.ladder.reference_noise}}},
        {"detector_s", l.ladder.detector_s},
        {"rungs", std::move(rungs)}};
    for (const bool adaptive : {true, false}) {
        const auto s = speed_ups(l.ladder, adaptive), cpu = speed_ups(l.ladder, adaptive, TimeBy::cpu);
        if (!s) continue;
        out["speed_up"][adaptive ? "rays" : "spp"] = {{"median", s->median},
                                                      {"least", s->least},
                                                      {"most", s->most},
                                                      {"budgets", s->budgets},
                                                      {"median_by_cpu", cpu->median}};
    }
    return out;
}

}  // namespace

nlohmann::json to_json(const Estimate& e) {
    return {{"value", e.value}, {"standard_error", e.standard_error}};
}

std::vector<std::string> benchmark_scenes() {
    std::vector<std::string> names{"all"};
    for (const BenchmarkScene& s : kBenchmarkScenes) names.emplace_back(s.name);
    return names;
}

Outcome bench_ladder(const LadderOptions& o) {
    const auto wanted = [&](const char* name) {
        return std::any_of(o.scenes.begin(), o.scenes.end(),
                           [&](const std::string& s) { return s == "all" || s == name; });
    };
    if (!o.plot.empty())
        if (auto writable = can_write_plot(o.plot); !writable) return writable.error();
    TracingThreads threads(o.threads);
    std::optional<CraftRatios> ratios;
    if (wanted("craft") && !o.ablation) {
        auto measured = measure_craft(o, threads);
        if (!measured) return measured.error();
        ratios = *measured;
        print_ratios(*ratios);
    }
    std::vector<SceneLadder> ladders;
    for (const BenchmarkScene& s : kBenchmarkScenes) {
        if (!wanted(s.name)) continue;
        auto measured = measure(s, o, threads);
        if (!measured) return measured.error();
        o.ablation ? print_ablation(*measured) : print_ladder(*measured);
        ladders.push_back(*std::move(measured));
    }
    std::vector<std::string> faults;
    const auto judge = [&](const auto& measured) {
        for (std::string& fault : bench_faults(measured)) faults.push_back(std::move(fault));
    };
    if (ratios) judge(*ratios);
    for (const SceneLadder& l : ladders)
        if (!o.ablation) judge(l);
    for (const std::string& fault : faults) say((o.gates ? "failed: " : "not reached: ") + fault);

    const int n_threads = threads.arena.max_concurrency();
    nlohmann::json document{{"passed", !o.gates || faults.empty()},
                            {"faults", faults},
                            {"threads", n_threads},
                            {"scenes", nlohmann::json::array()}};
    if (ratios) document["craft"] = describe(*ratios);
    for (const SceneLadder& l : ladders) document["scenes"].push_back(describe(l));
    if (!o.plot.empty()) {
        nlohmann::json plot = document;
        plot["plot"] = "ladder";
        plot["title"] = fmt::format("Error against time, {} threads; medians of {} frames", n_threads,
                                    o.quick ? kQuick : kLadderFrames);
        if (auto written = write_plot(o.plot, plot); !written) return written.error();
        say("wrote " + o.plot);
    }
    return document;
}

}  // namespace narpa::cli
