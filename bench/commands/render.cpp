// narpa bench render - how fast the error of an image falls: RMSE, bias and time at several numbers of samples.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <numeric>

#include "apps/warnings.h"
#include "bench/budget_ladder.h"
#include "bench/commands/commands.h"
#include "bench/commands/ladder.h"
#include "bench/commands/scene.h"
#include "plot/plot.h"

namespace narpa::cli {
namespace {

constexpr int kDefaultSize = 64;  // px, the longer side

struct RenderBenchOptions {
    SceneArgument scene;
    std::string camera, size, plot;
    std::vector<int> spp{4, 8, 16, 32};
    int reference_spp = 4096, seeds = 16, threads = 0;
    LadderOptions ladder;
};

Status choose_size(const std::string& text, Camera& camera) {
    if (text.empty()) {
        resize_longer_side(camera, kDefaultSize);
        return Ok{};
    }
    int width = 0, height = 0, end = 0;
    if (std::sscanf(text.c_str(), "%5dx%5d%n", &width, &height, &end) != 2 ||
        end != static_cast<int>(text.size()) || width < 1 || height < 1 || width > 16384 || height > 16384)
        return Error{fmt::format("--size {}, expected WIDTHxHEIGHT in pixels, 1 to 16384 each", text)};
    resize(camera, width, height);
    return Ok{};
}

double mean_s(const Rung& r) {
    return std::accumulate(r.seconds.begin(), r.seconds.end(), 0.0) / static_cast<double>(r.seconds.size());
}

double samples_per_second(const Rung& r, const Camera& c) {
    return static_cast<double>(c.width) * c.height * r.spp / mean_s(r);
}

nlohmann::json rows(const Ladder& ladder, const Camera& c) {
    nlohmann::json rows = nlohmann::json::array();
    for (const Rung& r : ladder.rungs)
        rows.push_back({{"spp", r.spp},
                        {"seeds", r.images},
                        {"rmse", to_json(r.rmse)},
                        {"relative_rmse", to_json(r.relative_rmse)},
                        {"bias", to_json(r.bias)},
                        {"pixel_bias_squared", to_json(r.pixel_bias_squared)},
                        {"render_s", mean_s(r)},
                        {"samples_per_s", samples_per_second(r, c)}});
    return rows;
}

std::string text(const Estimate& e, int digits) {
    return fmt::format("{:.{}f} +- {:.{}f}", e.value, digits, e.standard_error, digits);
}

void print_table(const Ladder& ladder, const Camera& c) {
    say(fmt::format("{:>6} {:>24} {:>8} {:>18} {:>20} {:>6} {:>10} {:>10}", "spp", "RMSE, W/(m^2 sr)", "of mean",
                    "relative, %", "mean error, sigmas", "pixels", "s/image", "Msample/s"));
    for (const Rung& r : ladder.rungs) {
        const Estimate relative{100 * r.relative_rmse.value, 100 * r.relative_rmse.standard_error};
        say(fmt::format(
            "{:>6} {:>12.5g} +- {:<8.2g} {:>7.2f}% {:>18} {:>13.2e} {:>+6.1f} {:>+6.1f} {:>10.4g} {:>10.3f}", r.spp,
            r.rmse.value, r.rmse.standard_error, 100 * r.rmse.value / ladder.level, text(relative, 2), r.bias.value,
            r.bias.sigmas(), r.pixel_bias_squared.sigmas(), mean_s(r), 1e-6 * samples_per_second(r, c)));
    }
}

Outcome bench_render(RenderBenchOptions o) {
    if (o.ladder.ablation && o.ladder.scenes.empty()) o.ladder.scenes = {"all"};
    if (o.ladder.quick && o.ladder.scenes.empty()) return Error{"--quick needs --scenes or --ablation"};
    if (auto made = make_folder_of_picture(o.plot); !made) return made.error();
    if (!o.ladder.scenes.empty()) {
        o.ladder.threads = o.threads;
        o.ladder.plot = o.plot;
        return bench_ladder(o.ladder);
    }
    for (const int spp : o.spp)
        if (spp < 2 || spp > 65535)
            return Error{fmt::format(
                "--spp {}, expected 2 to 65535: 1 is no sample but the ray through the pixel's centre", spp)};
    std::sort(o.spp.begin(), o.spp.end());
    o.spp.erase(std::unique(o.spp.begin(), o.spp.end()), o.spp.end());

    auto scene = scene_or_shipped(o.scene, "cornell/cornell.toml");
    if (!scene) return scene.error();
    auto index = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!index) return index.error();
    Camera& camera = scene->cameras[*index];
    if (auto good = choose_size(o.size, camera); !good) return good.error();
    camera.format = PixelFormat::grey;  // only the radiance is compared
    camera.embedded_line = false;

    auto world = World::create(*scene);
    if (!world) return world.error();
    TracingThreads threads(o.threads);
    const int n_threads = threads.arena.max_concurrency();
    LadderSettings settings;
    settings.spp = o.spp;
    settings.rays_per_pixel.clear();
    settings.frames = o.seeds;
    settings.reference_spp = o.reference_spp;
    settings.bands = true;
    Progress progress("measuring");
    const Ladder ladder = measure_ladder(**world, *index, settings, {}, threads,
                                         [&](const std::string& step) { progress.show(step); });

    const std::vector<ErrorRow> errors(ladder.rungs.begin(), ladder.rungs.end());
    const Estimate slope = fit_slope(errors), relative_slope = fit_slope(errors, &ErrorRow::relative_rmse);
    const std::vector<std::string> faults = convergence_faults(errors);
    const std::string title = fmt::format("{}, camera \"{}\", {} x {}, {} seeds, reference {} spp", scene->name,
                                          camera.name, camera.width, camera.height, o.seeds, o.reference_spp);
    say(title);
    say(fmt::format("reference: mean {:.6g} W/(m^2 sr), noise {:.2g} RMS (taken out), {:.1f} s, {} threads",
                    ladder.level, ladder.reference_noise, ladder.reference_s, n_threads));
    print_table(ladder, camera);
    say(fmt::format("slope: RMSE {}, relative {}", text(slope, 3), text(relative_slope, 3)));
    for (const std::string& fault : faults) say("failed: " + fault);
    nlohmann::json document{{"passed", faults.empty()},
                            {"faults", faults},
                            {"scene", scene->file},
                            {"camera", camera.name},
                            {"width", camera.width},
                            {"height", camera.height},
                            {"threads", n_threads},
                            {"reference",
                             {{"spp", o.reference_spp},
                              {"mean", ladder.level},
                              {"noise_rms", ladder.reference_noise},
                              {"render_s", ladder.reference_s}}},
                            {"rows", rows(ladder, camera)},
                            {"slope", to_json(slope)},
                            {"relative_slope", to_json(relative_slope)}};
    if (!o.plot.empty()) {
        nlohmann::json plot = document;
        plot.update({{"plot", "convergence"}, {"title", title}});
        if (auto written = write_plot(o.plot, plot); !written) return written.error();
        say("wrote " + o.plot);
    }
    return document;
}

}  // namespace

Command add_bench_render(Parser bench_command) {
    auto o = std::make_shared<RenderBenchOptions>();
    const Parser c = bench_command.subcommand(
        "render", "Error of an image against samples and time, beside a reference of many samples");
    add_strict_to(c);
    const std::array of_one_scene{
        SceneArgument::add_set_to(c, o->scene.sets),
        c.option("SCENE", o->scene.file, "Scene file (TOML; default: the Cornell box that comes with narpa)"),
        c.option("--camera", o->camera, "Name of the camera (default: the first)").type_name("NAME"),
        c.option("--spp", o->spp, "Samples per pixel to measure at").comma_separated().shows_default(),
        c.option("--reference-spp", o->reference_spp, "Samples per pixel of the reference, a multiple of 16")
            .range(32, 16 * 65535)
            .check([](const std::string& text) {
                return std::stoll(text) % kReferenceImages == 0 ? "" : "expected a multiple of 16";
            })
            .shows_default(),
        c.option(
             "--size", o->size,
             fmt::format("The camera's view with so many pixels (default: the longer side has {})", kDefaultSize))
            .type_name("WxH"),
        c.option("--seeds", o->seeds, "Independent images at each number of samples")
            .range(2, 65535)
            .shows_default()};
    c.option("--threads", o->threads, "Threads (default: all cores)").range(0, 1024);
    const Option scenes =
        c.option("--scenes", o->ladder.scenes,
                 "Measure time and error at a ladder of budgets, on the benchmark scenes: all, craft, "
                 "craft-paths, docking, docking-contact, cornell, craft-and-ball")
            .comma_separated()
            .one_of(benchmark_scenes())
            .type_name("LIST");
    const Option ablation =
        c.flag("--ablation", o->ladder.ablation,
               "Measure each adaptive mechanism switched off in turn, with time and error beside the "
               "full renderer's, on the scenes of --scenes (default: all)");
    for (const Option& option : of_one_scene) {
        scenes.excludes(option);
        ablation.excludes(option);
    }
    c.flag("--quick", o->ladder.quick,
           "With --scenes or --ablation: small images and few of them, to see that it works");
    c.flag("--gates", o->ladder.gates, "With --scenes: exit status 1 where a ratio is not what it should be")
        .needs(scenes);
    c.option("-o,--output", o->plot,
             "Error over samples and over time; with --scenes error over time, and where time goes")
        .type_name("FILE.png");
    c.footer(
        "Without --scenes, exit status 1 where a bias is beyond three standard errors, or an error falls more "
        "slowly than spp^-0.47.");
    return [o] { return bench_render(*o); };
}

}  // namespace narpa::cli
