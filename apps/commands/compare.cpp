// narpa compare - a frame of a real camera beside the render of the scene: overlap, brightness, shift, residuals.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "apps/cli.h"
#include "apps/outputs.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "base/write_file.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/threads.h"
#include "emulator/world.h"
#include "estimator/view/frame_comparison.h"
#include "plot/plot.h"
#include "tracking/frame_tracker.h"

namespace narpa::cli {
namespace {

struct CompareOptions {
    SceneArgument scene;
    std::string frame, camera, target, out;
    PoseOptions pose;
    double time_s = 0;
    int spp = 64, frame_spp = 0, threads = 0;
    bool only_target = false;
    std::optional<double> min_overlap, min_correlation, max_shift_px;
};

/// Why the shift is not determined; empty: it is.
std::string why_no_shift(const FrameComparison& c) {
    return c.shift ? c.shift->not_determined : "the render is uniform";
}

/// The limits that the comparison does not meet, a sentence each.
std::vector<std::string> faults_of(const FrameComparison& c, const CompareOptions& o) {
    std::vector<std::string> faults;
    if (o.min_overlap && c.overlap_beyond_noise() < *o.min_overlap)
        faults.push_back(
            fmt::format("overlap {:.4f}, expected at least {:g}", c.overlap_beyond_noise(), *o.min_overlap));
    if (o.min_correlation && c.correlation.value_or(-1) < *o.min_correlation)
        faults.push_back(fmt::format("correlation {}, expected at least {:g}",
                                     c.correlation ? fmt::format("{:.4f}", *c.correlation) : "not known",
                                     *o.min_correlation));
    if (!o.max_shift_px) return faults;
    const std::string why_none = why_no_shift(c);
    const double shift_px = c.shift ? std::hypot(c.shift->x_px, c.shift->y_px) : 0;
    if (!why_none.empty() || c.shift->is_at_limit || shift_px > *o.max_shift_px)
        faults.push_back(fmt::format(
            "shift {}, expected at most {:g} px",
            why_none.empty() ? fmt::format("{:.2f} px{}", shift_px, c.shift->is_at_limit ? " or more" : "")
                             : "not determined",
            *o.max_shift_px));
    return faults;
}

template <class T>
nlohmann::json or_null(const std::optional<T>& value) {
    return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

nlohmann::json numbers_of(const FrameComparison& c) {
    nlohmann::json document{{"overlap", c.overlap()},
                            {"overlap_beyond_noise", c.overlap_beyond_noise()},
                            {"lit_frame_px", c.lit_frame},
                            {"lit_render_px", c.lit_render},
                            {"lit_both_px", c.lit_both},
                            {"black_dn", c.black_dn},
                            {"gain", c.gain},
                            {"correlation", or_null(c.correlation)},
                            {"mean_dn", c.mean_dn},
                            {"residual_dn", c.residual_dn},
                            {"residual_over_noise", or_null(c.residual_noise)},
                            {"shift", nullptr},
                            {"shift_not_determined", nullptr}};
    if (const std::string why_none = why_no_shift(c); !why_none.empty())
        document["shift_not_determined"] = why_none;
    else
        document["shift"] = {{"x_px", c.shift->x_px},
                             {"y_px", c.shift->y_px},
                             {"sigma_x_px", c.shift->sigma_x_px},
                             {"sigma_y_px", c.shift->sigma_y_px},
                             {"correlation", c.shift->correlation},
                             {"is_at_limit", c.shift->is_at_limit}};
    return document;
}

std::string words_of(const FrameComparison& c) {
    std::string out = fmt::format(
        "  lit in both: {:.1f} % of the pixels lit in either ({} in the frame, {} in the render); {:.1f} % without "
        "differences that noise explains\n"
        "  brightness: frame = {:.6g} DN + {:.4g} x render{}\n"
        "  residuals: {:.4g} DN RMS, {:.1f} % of the mean{}\n",
        100 * c.overlap(), c.lit_frame, c.lit_render, 100 * c.overlap_beyond_noise(), c.black_dn, c.gain,
        c.correlation ? fmt::format(", correlation {:.4f}", *c.correlation) : ", uniform", c.residual_dn,
        100 * c.residual_dn / c.mean_dn,
        c.residual_noise ? fmt::format(", {:.3g} times the noise of detector and samples", *c.residual_noise) : "");
    if (const std::string why_none = why_no_shift(c); !why_none.empty())
        return out + "  shift: not determined, " + why_none;
    return out +
           fmt::format(
               "  shift: the frame shows it {:.2f} +- {:.2f} px further {} and {:.2f} +- {:.2f} px further {} "
               "than the render{}, correlation {:.4f} there",
               std::abs(c.shift->x_px), c.shift->sigma_x_px, c.shift->x_px < 0 ? "left" : "right",
               std::abs(c.shift->y_px), c.shift->sigma_y_px, c.shift->y_px < 0 ? "up" : "down",
               c.shift->is_at_limit ? ", or more" : "", c.shift->correlation);
}

/// The document of the picture (python/narpa/plots/estimation.py): both images at the frame's brightness, and the
/// residuals of the usable pixels, 128 where there is none.
nlohmann::json picture(const std::string& title, const MeasuredImage& frame, const SensorModel& sensor,
                       const ExpectedFrame& render, const FrameComparison& c) {
    std::vector<double> signal, expected;
    for (std::size_t p = 0; p < frame.dn.size(); ++p) {
        signal.push_back(static_cast<double>(frame.dn[p]) - c.black_dn);
        expected.push_back(std::min(c.gain * static_cast<double>(render.signal[p]), sensor.top_dn - c.black_dn));
    }
    // White point: 1 % of the lit pixels (glints) may saturate.
    std::vector<double> sorted = expected;
    const auto bright = sorted.begin() + static_cast<std::ptrdiff_t>(c.lit_render / 100);
    std::nth_element(sorted.begin(), bright, sorted.end(), std::greater<>());
    const double brightest = std::max(*bright, 1e-300), range = std::min(4 * c.residual_dn, brightest);
    const auto shown = [&](const auto& byte) {
        std::vector<std::uint8_t> bytes(signal.size());
        for (std::size_t p = 0; p < bytes.size(); ++p) bytes[p] = byte(p);
        return plot_image(frame.width, frame.height, 1, bytes);
    };
    return {{"plot", "comparison"},
            {"title", title},
            {"frame", shown([&](std::size_t p) { return srgb_byte(signal[p] / brightest); })},
            {"render", shown([&](std::size_t p) { return srgb_byte(expected[p] / brightest); })},
            {"residual_range_dn", range},
            {"residual", shown([&](std::size_t p) {
                 const double part = range > 0 && c.usable[p] ? (signal[p] - expected[p]) / range : 0;
                 return static_cast<std::uint8_t>(std::lround(128 + 127 * std::clamp(part, -1.0, 1.0)));
             })}};
}

/// An Error where the picture, or the document beside it, would overwrite an input.
Status check_output(const CompareOptions& o, const Scene& scene) {
    if (o.out.empty()) return Ok{};
    if (auto kept = keep_inputs({o.out, document_beside(o.out)}, scene, {o.frame, o.pose.trajectory}); !kept)
        return kept;
    return make_folder_of_picture(o.out);
}

/// Renders as `narpa render` does. The caller has changed the seed, because an emulated frame may have the scene's.
ExpectedFrame expected_frame(const CompareOptions& o, const World& world, std::size_t camera, std::int64_t t_ns) {
    CameraUnit unit(world, camera);
    Aovs shown;
    TracingThreads threads(o.threads);
    {
        const Progress progress("rendering what " + o.frame + " should show");
        threads.arena.execute([&] { unit.expose(0, t_ns, 0, &shown); });
    }
    ExpectedFrame out{expected_signal(unit.camera(), unit.radiance()), std::move(shown.variance),
                      std::move(shown.body), o.frame_spp > 0 ? static_cast<double>(o.spp) / o.frame_spp : 0};
    out.knows_background = !o.only_target;
    const auto& [r, g, b] = sensor_model(unit.camera()).dn_per_radiance;
    for (float& v : out.variance) v *= static_cast<float>(std::pow(r + g + b, 2));
    return out;
}

Outcome compare(const CompareOptions& o) {
    auto scene = o.scene.load();
    if (!scene) return scene.error();
    if (auto good = check_output(o, *scene); !good) return good.error();
    const auto index = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!index) return index.error();
    scene->render.seed = ~scene->render.seed;
    BudgetOptions{.spp = o.spp, .budget_ms = {}, .budget_rays = {}}.override_scene(scene->render);
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    if (auto loaded = o.pose.load(**world, t_ns, t_ns); !loaded) return loaded.error();
    const Camera& camera = (*world)->scene().cameras[*index];
    const auto target = target_of(**world, camera.mount, camera.name, o.target);
    if (!target) return target.error();
    const auto bytes = load_frame(o.frame, camera);
    if (!bytes) return bytes.error();
    const auto frame = measured_image(camera, *bytes);
    if (!frame) return Error{frame.error().what, o.frame};
    const ExpectedFrame render = expected_frame(o, **world, *index, t_ns);
    const SensorModel sensor = sensor_model(camera);
    const auto found = compare_frame(*frame, sensor, render, *target);
    if (!found) return Error{found.error().what, o.frame, 0, 0, ErrorKind::failed};
    const std::string title =
        fmt::format("{}: {} in camera {}", o.frame, (*world)->scene().bodies[*target].name, camera.name);
    say(title + "\n" + words_of(*found));
    const std::vector<std::string> faults = faults_of(*found, o);
    for (const std::string& fault : faults) say("failed: " + fault);
    nlohmann::json document = numbers_of(*found);
    document["passed"] = faults.empty(), document["faults"] = faults;
    document["frame"] = o.frame, document["camera"] = camera.name;
    document["target"] = (*world)->scene().bodies[*target].name;
    if (o.out.empty()) return document;
    if (auto drawn = write_plot(o.out, picture(title, *frame, sensor, render, *found)); !drawn)
        return drawn.error();
    say("wrote " + o.out);
    return document;
}

}  // namespace

Command add_compare(Parser app) {
    auto o = std::make_shared<CompareOptions>();
    const Parser c =
        app.subcommand("compare", "Compare a frame, also of a real camera, with a render of the scene");
    o->scene.add_to(c);
    c.option("--frame", o->frame,
             "FILE.png, .tif or .pgm in the camera's size and format, or the bytes in FILE.raw")
        .type_name("FILE")
        .required();
    c.option("--camera", o->camera, "Name of the camera (default: the first)").type_name("NAME");
    c.option("--target", o->target,
             "Body that is compared (default: the first with a mesh that does not carry the camera)")
        .type_name("BODY");
    c.flag("--only-target", o->only_target,
           "Only the target's pixels count: behind it the frame shows what the scene has not, such as a room");
    c.option("--time", o->time_s, "Simulation time of the frame (default: 0)")
        .type_name("SECONDS")
        .range(-9e9, 9e9);
    o->pose.add_to(c);
    c.option("--spp", o->spp, "Samples per pixel of the render").range(1, 65535).shows_default();
    c.option("--frame-spp", o->frame_spp,
             "Samples per pixel of a frame that narpa rendered: their noise counts as noise (default: of a real "
             "camera)")
        .range(1, 65535);
    c.option("--threads", o->threads, "Threads (default: all cores)").range(0, 1024);
    c.option("-o,--output", o->out,
             "Frame, render and residuals side by side; their numbers in FILE.json beside it")
        .type_name("FILE.png");
    c.group("Results");
    for (const Option& option :
         {c.option("--min-overlap", o->min_overlap,
                   "Least part of the pixels lit in either that is lit in both, not counting differences that "
                   "noise explains")
              .range(0.0, 1.0),
          c.option("--min-correlation", o->min_correlation, "Least correlation of their brightness")
              .range(-1.0, 1.0),
          c.option("--max-shift", o->max_shift_px,
                   "Largest shift of the target; one that is not determined fails too")
              .type_name("PX")
              .range(0.0, 32.0)})
        (void)option.group("Limits: exit status 1 where one is missed");
    c.examples({"narpa compare docking --frame out/frame.png -o out/residuals.png",
                "narpa compare docking --frame out/frame.png --frame-spp 1 --min-overlap 0.95 --max-shift 0.5"});
    return [o] { return compare(*o); };
}

}  // namespace narpa::cli
