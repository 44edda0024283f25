// narpa bench frames - milliseconds a frame in a loop that only renders: the reference for other loops, as that of
// the Python package.
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <numeric>
#include <vector>

#include "apps/scene_argument.h"
#include "base/time.h"
#include "bench/commands/commands.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/threads.h"

namespace narpa::cli {
namespace {

struct FrameBenchOptions {
    SceneArgument scene;
    std::string camera;
    int frames = 1000;
    int threads = 0;
};

/// CPU time of all threads so far, ms.
double cpu_ms() {
    timespec t{};
    ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

/// Renders the frames one after another, each at its own time; durations in ms. The first frame, which allocates,
/// is left out.
std::vector<double> frame_durations(CameraUnit& unit, TracingThreads& threads, int frames) {
    std::vector<double> ms;
    for (std::uint32_t frame = 0; frame <= static_cast<std::uint32_t>(frames); ++frame) {
        const std::int64_t start_ns = monotonic_ns();
        threads.arena.execute([&] { unit.embed(unit.expose(frame, unit.t_mid_ns(frame))); });
        if (frame > 0) ms.push_back(1e-6 * static_cast<double>(monotonic_ns() - start_ns));
    }
    return ms;
}

Outcome bench_frames(const FrameBenchOptions& o) {
    auto scene = o.scene.load();
    if (!scene) return scene.error();
    const auto camera = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!camera) return camera.error();
    if (scene->render.budget_ns > 0)
        return Error{"a time budget decides how long a frame takes, expected spp or budget_rays in [render]",
                     scene->file};
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    TracingThreads threads(o.threads);
    CameraUnit unit(**world, *camera);
    (void)frame_durations(unit, threads, 1);
    const double before_ms = cpu_ms();
    std::vector<double> ms = frame_durations(unit, threads, o.frames);
    const double cpu_mean = (cpu_ms() - before_ms) / (o.frames + 1);
    const double mean = std::accumulate(ms.begin(), ms.end(), 0.0) / static_cast<double>(ms.size());
    std::ranges::sort(ms);
    const double median = ms[ms.size() / 2], p99 = ms[ms.size() * 99 / 100];
    say(fmt::format("{}, {} x {}, {} frames: mean {:.3f} ms, median {:.3f} ms, p99 {:.3f} ms; {:.3f} ms of CPU",
                    unit.camera().name, unit.camera().width, unit.camera().height, o.frames, mean, median, p99,
                    cpu_mean));
    return nlohmann::json{{"camera", unit.camera().name},
                          {"width", unit.camera().width},
                          {"height", unit.camera().height},
                          {"frames", o.frames},
                          {"ms_mean", mean},
                          {"ms_median", median},
                          {"ms_p99", p99},
                          {"cpu_ms_mean", cpu_mean}};
}

}  // namespace

Command add_bench_frames(Parser bench_command) {
    auto o = std::make_shared<FrameBenchOptions>();
    const Parser c = bench_command.subcommand("frames", "Milliseconds a frame in a loop that only renders");
    o->scene.add_to(c);
    c.option("--camera", o->camera, "Name of the camera (default: the first)").type_name("NAME");
    c.option("--frames", o->frames, "Frames, after one that is not counted").range(1, 1'000'000).shows_default();
    c.option("--threads", o->threads, "Threads that trace rays (default: all cores)").range(0, 1024);
    return [o] { return bench_frames(*o); };
}

}  // namespace narpa::cli
