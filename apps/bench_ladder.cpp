// narpa bench render --scenes - the standing scenes, one after another; --ablation - what each mechanism earns on
// them.
#include "apps/bench_ladder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "apps/bench_scene.h"
#include "emulator/trajectory.h"
#include "plot/plot.h"

namespace narpa::cli {
namespace {

struct Standing {
    const char *name, *file, *camera;
    RenderSettings::Method method;
    int max_depth;          ///< of paths
    double at_s;            ///< time on the approach; negative: no approach
    bool loop;              ///< the plain loop can render it
    double speed_up_least;  ///< over the plain loop at equal error; 0: not judged
    double speed_up_from;   ///< judged from so many rays a pixel on
    int size;               ///< px, the longer side
    bool far = false;       ///< on to 64 samples a pixel, as images converge
};
using Method = RenderSettings::Method;
constexpr std::array<Standing, 6> kStanding{{
    {"craft", "craft/craft.toml", "near", Method::direct, 1, -1, true, 2, 0, 512},
    {"craft-paths", "craft/craft.toml", "near", Method::path, 5, -1, true, 3, 16, 256, true},  // four bounces
    {"docking", "docking/docking.toml", "nav", Method::direct, 1, 27, false, 0, 0, 320},
    {"docking-contact", "docking/docking.toml", "nav", Method::direct, 1, 57, false, 0, 0, 320},
    {"cornell", "cornell/cornell.toml", "published", Method::path, 8, -1, true, 0, 0, 128},
    // Nothing was tuned on it.
    {"craft-and-ball", "craft/craft-and-ball.toml", "chase", Method::path, 5, -1, false, 0, 0, 128},
}};

constexpr int kReferenceSpp = 4096, kFarReferenceSpp = 16384;
/// Frames whose times give a median; quick: to see that everything runs.
constexpr int kLadderFrames = 9, kRatioFrames = 15, kLoads = 7, kQuick = 2;
static_assert(std::min({kLadderFrames, kRatioFrames, kLoads}) >= 7);

/// The scene with the camera and method that are measured.
Result<std::unique_ptr<World>> world_of(const Standing& s, int size, std::size_t& camera) {
    auto file = shipped_scene(s.file);
    if (!file) return file.error();
    auto scene = load_scene(*file, s.method);
    if (!scene) return scene.error();
    scene->render.max_depth = s.max_depth;
    auto index = sensor_named(scene->cameras, s.camera, "camera", scene->file);
    if (!index) return index.error();
    camera = *index;
    resize_longer_side(scene->cameras[camera], size);
    auto world = World::create(*std::move(scene));
    if (!world || s.at_s < 0) return world;
    auto rows = read_trajectory((*file).substr(0, file->rfind('/')) + "/approach.csv");
    if (!rows) return rows.error();
    const auto t_ns = static_cast<std::int64_t>(s.at_s * 1e9);
    if (auto loaded = (*world)->load(*rows, t_ns, t_ns); !loaded) return loaded.error();
    return world;
}

Result<SceneLadder> measure(const Standing& s, const LadderOptions& o, TracingThreads& threads) {
    SceneLadder l;
    l.scene = s.name;
    l.speed_up_least = s.speed_up_least;
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
        if (s.method == Method::path)
            settings.spp = {8, 16, 32}, settings.rays_per_pixel.clear();
        else
            settings.rays_per_pixel = {4, 8, 16}, settings.spp.clear();
        for (const NamedMechanism& m : kMechanisms) settings.without.emplace_back(m.name);
    } else if (s.far && !o.quick) {
        settings.spp.push_back(64);
        settings.rays_per_pixel.push_back(64);
        settings.loop_spp.push_back(1024);
    }
    std::optional<ReferenceLoop> loop;
    if (s.loop && !o.ablation) {
        BodyPoses at((*world)->scene().bodies.size());
        (*world)->place(settings.t_ns, -1, at);
        auto made = ReferenceLoop::create((*world)->scene(), at);
        if (!made) return made.error();
        loop.emplace(*std::move(made));
    }
    const Progress progress;
    l.ladder = measure_ladder(**world, camera, settings, loop ? &*loop : nullptr, threads,
                              [&](const std::string& step) { progress.show(std::string(s.name) + ": " + step); });
    return l;
}

Result<CraftRatios> measure_ratios(const LadderOptions& o, TracingThreads& threads) {
    auto file = shipped_scene("craft/craft.toml");
    if (!file) return file.error();
    const auto load = [&] {
        auto scene = load_scene(*file);
        if (scene && o.quick)
            for (Camera& c : scene->cameras) resize_longer_side(c, 128);
        return scene;
    };
    auto scene = load();
    if (!scene) return scene.error();
    constexpr std::array kCameras{"near", "far", "edge", "filled"};
    std::array<std::size_t, kCameras.size()> cameras{};
    for (std::size_t k = 0; k < cameras.size(); ++k) {
        auto index = sensor_named(scene->cameras, kCameras[k], "camera", scene->file);
        if (!index) return index.error();
        cameras[k] = *index;
    }
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    const int rounds = o.quick ? kQuick : kRatioFrames;
    const Progress progress;
    progress.show("craft: a frame beside Embree's calls");
    auto cost = frame_against_raw(**world, cameras[0], rounds, threads);
    if (!cost) return cost.error();
    progress.show("craft: empty space, moved bodies, first frames");
    auto far = frame_against_raw(**world, cameras[1], rounds, threads);
    if (!far) return far.error();
    const std::vector<double> space = frames_of(**world, std::span(cameras).subspan(1), rounds, threads);
    CraftRatios r{
        *cost, *far, {space[0], space[1], space[2]}, still_and_moved(**world, cameras[0], rounds, threads), 0};
    auto load_s = load_to_first_frame(load, cameras[0], o.quick ? 1 : kLoads, threads);
    if (!load_s) return load_s.error();
    r.load_s = *load_s;
    return r;
}

}  // namespace

std::vector<std::string> standing_scenes() {
    std::vector<std::string> names{"all"};
    for (const Standing& s : kStanding) names.emplace_back(s.name);
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
        auto measured = measure_ratios(o, threads);
        if (!measured) return measured.error();
        ratios = *measured;
        print_ratios(*ratios);
    }
    std::vector<SceneLadder> ladders;
    for (const Standing& s : kStanding) {
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
    }
    return document;
}

}  // namespace narpa::cli
