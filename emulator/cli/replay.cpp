// narpa replay - the frames of a logged run once more, beside what an unlimited budget would have shown.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "emulator/cli/cli.h"
#include "emulator/replay.h"
#include "emulator/threads.h"

namespace narpa::cli {
namespace {

struct Options {
    std::string folder, camera, scene;
    int reference = 256, frames = 20, threads = 0;
};

/// A frame and how far it is from its reference.
struct Row {
    LoggedFrame logged;
    ImageDifference difference;
};

nlohmann::json to_json(const Row& r, const Scene& scene) {
    nlohmann::json bodies = nlohmann::json::array();
    for (const BodyShift& b : r.difference.bodies)
        bodies.push_back(
            {{"body", scene.bodies[static_cast<std::size_t>(b.body)].name}, {"x_px", b.x_px}, {"y_px", b.y_px}});
    return {{"frame", r.logged.frame},
            {"t_s", static_cast<double>(r.logged.t_mid_ns) * 1e-9},
            {"rmse", r.difference.rmse / r.difference.full_scale},
            {"bias", r.difference.bias / r.difference.full_scale},
            {"expected_error", r.logged.expected_error},
            {"ssim", r.difference.ssim},
            {"edges",
             {{"pixels", r.difference.edges.count},
              {"mean_px", r.difference.edges.mean_px},
              {"rms_px", r.difference.edges.rms_px},
              {"largest_px", r.difference.edges.largest_px}}},
            {"bodies", bodies}};
}

double farthest(const ImageDifference& d) {
    double most = 0;
    for (const BodyShift& b : d.bodies) most = std::max(most, std::hypot(b.x_px, b.y_px));
    return most;
}

std::string in_words(const std::vector<Row>& rows) {
    std::string out = "  frame     t [s]   RMSE [% fs]   expected      SSIM   edges rms [px]   bodies [px]\n";
    for (const Row& r : rows)
        out += fmt::format("{:7} {:9.3f} {:13.4f} {:10.4f} {:9.5f} {:16.4f} {:13.4f}\n", r.logged.frame,
                           static_cast<double>(r.logged.t_mid_ns) * 1e-9,
                           100 * r.difference.rmse / r.difference.full_scale, 100 * r.logged.expected_error,
                           r.difference.ssim, r.difference.edges.rms_px, farthest(r.difference));
    return out;
}

/// Evenly spread over the run, first and last among them.
std::vector<std::size_t> chosen_frames(std::size_t frames, int wanted) {
    const std::size_t n = std::min(frames, static_cast<std::size_t>(wanted));
    std::vector<std::size_t> chosen;
    for (std::size_t k = 0; k < n; ++k) chosen.push_back(n > 1 ? k * (frames - 1) / (n - 1) : 0);
    return chosen;
}

Outcome replay(const Options& o) {
    TracingThreads threads(o.threads);
    auto run = Replay::open(o.folder, o.camera, o.scene);
    if (!run) return run.error();
    if ((*run)->frames().empty())
        return Error{fmt::format("the log holds no frame of camera \"{}\"", (*run)->camera().name), o.folder};

    const std::vector<std::size_t> chosen = chosen_frames((*run)->frames().size(), o.frames);
    const bool terminal = ::isatty(STDERR_FILENO) == 1;
    std::vector<Row> rows;
    Status status = Ok{};
    for (const std::size_t i : chosen) {
        if (terminal) fmt::print(stderr, "\r{}/{} ", rows.size(), chosen.size());
        threads.arena.execute([&] {
            status = (*run)->make(i);
            if (status) rows.push_back({(*run)->frames()[i], (*run)->against(o.reference)});
        });
        if (!status) return status.error();
    }
    if (terminal) fmt::print(stderr, "\r{:20}\r", "");
    say(fmt::format("{}: camera {}, {} of {} frames beside {} samples per pixel\n{}", o.folder,
                    (*run)->camera().name, rows.size(), (*run)->frames().size(), o.reference, in_words(rows)));
    nlohmann::json frames = nlohmann::json::array();
    for (const Row& r : rows) frames.push_back(to_json(r, (*run)->world().scene()));
    return nlohmann::json{{"log", o.folder},
                          {"camera", (*run)->camera().name},
                          {"reference_spp", o.reference},
                          {"full_scale_w_m2_sr", rows.front().difference.full_scale},
                          {"frames", frames}};
}

}  // namespace

Command add_replay(CLI::App& app) {
    auto o = std::make_shared<Options>();
    CLI::App* c = app.add_subcommand(
        "replay",
        "Render frames of a logged run once more and tell what their budget cost: error, similarity, shifts");
    c->add_option("DIR", o->folder, "Folder that `run --log` has written")->required();
    c->add_option("--camera", o->camera, "Name of the camera (default: the first of the scene)");
    c->add_option("--scene", o->scene, "Scene file (default: the one that the run had)");
    c->add_option("--reference", o->reference, "Samples per pixel of what the frames are compared with")
        ->check(CLI::Range(2, 65535));
    c->add_option("--frames", o->frames, "Frames to look at, spread over the run")->check(CLI::Range(1, 1000000));
    c->add_option("--threads", o->threads, "Threads (default: all cores)")->check(CLI::Range(0, 1024));
    c->footer(
        "RMSE, bias and expected error are of mean bands, relative to the radiance that fills the sensor's scale.");
    return [o] { return replay(*o); };
}

}  // namespace narpa::cli
