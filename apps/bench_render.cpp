// narpa bench render - how fast the error of a image falls: RMSE, bias and time at several numbers of samples.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <memory>

#include "apps/bench_ladder.h"
#include "apps/bench_scene.h"
#include "apps/cli.h"
#include "bench/convergence.h"
#include "emulator/camera_unit.h"
#include "emulator/clock.h"
#include "emulator/threads.h"
#include "plot/plot.h"

namespace narpa::cli {
namespace {

constexpr std::uint32_t kReferenceImages = 16;  // their scatter is the reference's own noise
constexpr int kDefaultSize = 64;                // px, the longer side

struct RenderBenchOptions {
    std::string scene, camera, size, plot;
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

/// The camera's images at one number of samples, each with random numbers of its own: frame k has those of k.
class ImageSeries {
public:
    static Result<ImageSeries> create(Scene scene, std::size_t camera, int spp, std::uint64_t seed) {
        scene.render.spp = spp;
        scene.render.seed = seed;
        auto world = World::create(std::move(scene));
        if (!world) return world.error();
        return ImageSeries(*std::move(world), camera);
    }
    /// All images show the scene at its beginning. The first call takes memory, so it is not one to measure.
    std::span<const Rgb> render(TracingThreads& threads, std::uint32_t frame) {
        const std::int64_t start_ns = monotonic_ns();
        threads.arena.execute([&] { unit_->expose(frame, 0); });
        seconds_ = static_cast<double>(monotonic_ns() - start_ns) * 1e-9;
        return unit_->radiance().pixels;
    }
    /// Of the last image.
    [[nodiscard]] double seconds() const noexcept { return seconds_; }

private:
    ImageSeries(std::unique_ptr<World> world, std::size_t camera)
        : world_(std::move(world)), unit_(std::make_unique<CameraUnit>(*world_, camera)) {}
    std::unique_ptr<World> world_;
    std::unique_ptr<CameraUnit> unit_;
    double seconds_ = 0;
};

struct Measured {
    std::vector<ErrorRow> rows;
    std::vector<double> seconds;  ///< a image, mean
    double reference_level = 0, reference_noise = 0, reference_seconds = 0;
};

Result<Measured> measure(const RenderBenchOptions& o, const Scene& scene, std::size_t camera,
                         TracingThreads& threads) {
    Measured m;
    Progress progress;
    const auto pixels = static_cast<std::size_t>(scene.cameras[camera].width) *
                        static_cast<std::size_t>(scene.cameras[camera].height);

    ImageMean reference(pixels);
    const int reference_spp = o.reference_spp / static_cast<int>(kReferenceImages);
    auto many = ImageSeries::create(scene, camera, reference_spp, scene.render.seed + 1);
    if (!many) return many.error();
    for (std::uint32_t k = 0; k < kReferenceImages; ++k) {
        progress.show(fmt::format("reference {}/{}", k, kReferenceImages));
        reference.add(many->render(threads, k));
        m.reference_seconds += many->seconds();
    }
    m.reference_level = reference.level().value;
    m.reference_noise = std::sqrt(reference.variance_of_mean());

    std::uint32_t frame = 0;  // goes on from row to row: no two images share random numbers
    for (const int spp : o.spp) {
        auto images = ImageSeries::create(scene, camera, spp, scene.render.seed);
        if (!images) return images.error();
        ErrorAgainst error(reference);
        double seconds = 0;
        images->render(threads, frame);
        for (int k = 0; k < o.seeds; ++k) {
            progress.show(fmt::format("{} spp {}/{}", spp, k, o.seeds));
            error.add(images->render(threads, frame++));
            seconds += images->seconds();
        }
        m.rows.push_back(error.row(spp));
        m.seconds.push_back(seconds / o.seeds);
    }
    return m;
}

nlohmann::json estimate_json(const Estimate& e) {
    return {{"value", e.value}, {"standard_error", e.standard_error}};
}

double samples_per_second(const Camera& c, int spp, double seconds) {
    return static_cast<double>(c.width) * c.height * spp / seconds;
}

nlohmann::json describe(const Measured& m, const Camera& c) {
    nlohmann::json rows = nlohmann::json::array();
    for (std::size_t i = 0; i < m.rows.size(); ++i) {
        const ErrorRow& r = m.rows[i];
        rows.push_back({{"spp", r.spp},
                        {"seeds", r.images},
                        {"rmse", estimate_json(r.rmse)},
                        {"relative_rmse", estimate_json(r.relative_rmse)},
                        {"bias", estimate_json(r.bias)},
                        {"pixel_bias_squared", estimate_json(r.pixel_bias_squared)},
                        {"render_s", m.seconds[i]},
                        {"samples_per_s", samples_per_second(c, r.spp, m.seconds[i])}});
    }
    return rows;
}

std::string text(const Estimate& e, int digits) {
    return fmt::format("{:.{}f} +- {:.{}f}", e.value, digits, e.standard_error, digits);
}

void tell_table(const Measured& m, const Camera& c) {
    say(fmt::format("{:>6} {:>24} {:>8} {:>18} {:>20} {:>6} {:>10} {:>10}", "spp", "RMSE, W/(m^2 sr)", "of mean",
                    "relative, %", "mean error, sigmas", "pixels", "s/image", "Msample/s"));
    for (std::size_t i = 0; i < m.rows.size(); ++i) {
        const ErrorRow& r = m.rows[i];
        const Estimate relative{100 * r.relative_rmse.value, 100 * r.relative_rmse.standard_error};
        say(fmt::format(
            "{:>6} {:>12.5g} +- {:<8.2g} {:>7.2f}% {:>18} {:>13.2e} {:>+6.1f} {:>+6.1f} {:>10.4g} {:>10.3f}", r.spp,
            r.rmse.value, r.rmse.standard_error, 100 * r.rmse.value / m.reference_level, text(relative, 2),
            r.bias.value, r.bias.sigmas(), r.pixel_bias_squared.sigmas(), m.seconds[i],
            1e-6 * samples_per_second(c, r.spp, m.seconds[i])));
    }
    say(fmt::format("slope: RMSE {}, relative {}", text(fit_slope(m.rows), 3),
                    text(fit_slope(m.rows, &ErrorRow::relative_rmse), 3)));
}

Outcome bench_render(RenderBenchOptions o) {
    if (o.ladder.ablation && o.ladder.scenes.empty()) o.ladder.scenes = {"all"};
    if (o.ladder.quick && o.ladder.scenes.empty()) return Error{"--quick needs --scenes or --ablation"};
    if (!o.ladder.scenes.empty()) {
        o.ladder.threads = o.threads;
        o.ladder.plot = o.plot;
        return bench_ladder(o.ladder);
    }
    for (const int spp : o.spp)
        if (spp < 2 || spp > 65535)
            return Error{fmt::format(
                "--spp {}, expected 2 to 65535: 1 is no sample but the ray through the pixel's centre", spp)};
    if (o.scene.empty()) {
        auto shipped = shipped_scene("cornell/cornell.toml");
        if (!shipped) return shipped.error();
        o.scene = *shipped;
    }
    std::sort(o.spp.begin(), o.spp.end());
    o.spp.erase(std::unique(o.spp.begin(), o.spp.end()), o.spp.end());

    auto scene = load_scene(o.scene);
    if (!scene) return scene.error();
    auto index = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!index) return index.error();
    Camera& camera = scene->cameras[*index];
    if (auto good = choose_size(o.size, camera); !good) return good.error();
    camera.format = PixelFormat::grey;  // radiance is what is looked at
    camera.embedded_line = false;

    TracingThreads threads(o.threads);
    auto measured = measure(o, *scene, *index, threads);
    if (!measured) return measured.error();

    const std::vector<std::string> faults = convergence_faults(measured->rows);
    const std::string title = fmt::format("{}, camera \"{}\", {} x {}, {} seeds, reference {} spp", scene->name,
                                          camera.name, camera.width, camera.height, o.seeds, o.reference_spp);
    say(title);
    say(fmt::format("reference: mean {:.6g} W/(m^2 sr), noise {:.2g} RMS (taken out), {:.1f} s, {} threads",
                    measured->reference_level, measured->reference_noise, measured->reference_seconds,
                    threads.arena.max_concurrency()));
    tell_table(*measured, camera);
    for (const std::string& fault : faults) say("failed: " + fault);
    nlohmann::json document{{"passed", faults.empty()},
                            {"faults", faults},
                            {"scene", scene->file},
                            {"camera", camera.name},
                            {"width", camera.width},
                            {"height", camera.height},
                            {"threads", threads.arena.max_concurrency()},
                            {"reference",
                             {{"spp", o.reference_spp},
                              {"mean", measured->reference_level},
                              {"noise_rms", measured->reference_noise},
                              {"render_s", measured->reference_seconds}}},
                            {"rows", describe(*measured, camera)},
                            {"slope", estimate_json(fit_slope(measured->rows))},
                            {"relative_slope", estimate_json(fit_slope(measured->rows, &ErrorRow::relative_rmse))}};
    if (!o.plot.empty()) {
        nlohmann::json plot = document;
        plot.update({{"plot", "convergence"}, {"title", title}});
        if (auto written = write_plot(o.plot, plot); !written) return written.error();
    }
    return document;
}

}  // namespace

Command add_bench_render(Parser bench_command) {
    auto o = std::make_shared<RenderBenchOptions>();
    const Parser c = bench_command.subcommand(
        "render", "Error of an image against samples and time, beside a reference of many samples");
    const std::array of_one_scene{
        c.option("SCENE", o->scene, "Scene file (TOML; default: the Cornell box that comes with narpa)"),
        c.option("--camera", o->camera, "Name of the camera (default: the first)"),
        c.option("--spp", o->spp, "Samples per pixel to measure at").comma_separated().shows_default(),
        c.option("--reference-spp", o->reference_spp, "Samples per pixel of the reference, a multiple of 16")
            .range(32, 16 * 65535)
            .check([](const std::string& text) {
                return std::stoll(text) % kReferenceImages == 0 ? "" : "expected a multiple of 16";
            })
            .shows_default(),
        c.option("--size", o->size,
                 fmt::format("WxH: the camera's view with so many pixels (default: the longer side has {})",
                             kDefaultSize)),
        c.option("--seeds", o->seeds, "Independent images at each number of samples")
            .range(2, 65535)
            .shows_default()};
    c.option("--threads", o->threads, "Threads (default: all cores)").range(0, 1024);
    const Option scenes =
        c.option("--scenes", o->ladder.scenes,
                 "Instead: time and error at a ladder of budgets, on the standing scenes: all, craft, "
                 "craft-paths, docking, docking-contact, cornell, craft-and-ball")
            .comma_separated()
            .one_of(standing_scenes());
    const Option ablation =
        c.flag("--ablation", o->ladder.ablation,
               "Instead: each adaptive mechanism switched off in turn, with time and error beside the "
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
             "FILE.png: error over samples and over time; with --scenes error over time, and where time goes");
    c.footer(
        "Without --scenes, exit status 1 where a bias is beyond three standard errors, or an error falls more "
        "slowly than spp^-0.47.");
    return [o] { return bench_render(*o); };
}

}  // namespace narpa::cli
