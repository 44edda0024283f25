// narpa render - renders one frame of one camera, as a run would, to an image file.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <set>

#include "apps/cli.h"
#include "apps/exposure_advice.h"
#include "apps/outputs.h"
#include "apps/scene_options.h"
#include "emulator/camera/camera_unit.h"
#include "emulator/clock.h"
#include "emulator/log/statistics.h"
#include "emulator/threads.h"
#include "renderer/image/image_file.h"
#include "renderer/integrator/integrator.h"

namespace narpa::cli {
namespace {

using Method = RenderSettings::Method;

struct RenderOptions {
    std::string scene, camera, format, out, aov, method;
    PoseOptions pose;
    std::optional<double> time_s;
    std::optional<std::uint32_t> frame;
    BudgetOptions budget;
    std::optional<int> max_depth;
    std::optional<std::uint64_t> seed;
    int threads = 0;
};

/// Applies the options that override the scene.
Status override_scene(const RenderOptions& o, Scene& scene, Camera& camera) {
    o.budget.override_scene(scene.render);
    if (o.seed) scene.render.seed = *o.seed;
    if (o.max_depth && scene.render.method == Method::direct)
        return Error{"--max-depth belongs to --method path, and the method is \"direct\""};
    if (o.max_depth) scene.render.max_depth = *o.max_depth;
    if (!o.format.empty()) {
        const auto format = pixel_format_from(o.format);
        if (!format)
            return Error{
                fmt::format("--format {}, expected one of {}", o.format, fmt::join(kPixelFormatNames, ", "))};
        if (const std::string what = unfit_size(*format, camera.width, camera.height); !what.empty())
            return Error{fmt::format("camera \"{}\": --format {}", camera.name, what)};
        camera.format = *format;
    }
    return o.pose.place(scene);
}

constexpr std::array<std::string_view, 8> kOutputs{"radiance", "depth", "range",  "normal",
                                                   "position", "body",  "albedo", "variance"};

/// The names in "depth,normal"; an Error for an unknown one.
Result<std::set<std::string>> parse_outputs(const std::string& list) {
    std::set<std::string> names;
    for (std::size_t start = 0; start < list.size();) {
        const std::size_t comma = std::min(list.find(',', start), list.size());
        const std::string name = list.substr(start, comma - start);
        start = comma + 1;
        if (std::find(kOutputs.begin(), kOutputs.end(), name) == kOutputs.end())
            return Error{fmt::format("--aov \"{}\", expected some of {}", name, fmt::join(kOutputs, ","))};
        names.insert(name);
    }
    return names;
}

/// The image file contains the outputs that are not empty.
void keep_only(const std::set<std::string>& names, Aovs& a) {
    if (!names.contains("depth")) a.depth_m.clear();
    if (!names.contains("range")) a.range_m.clear();
    if (!names.contains("normal")) a.normal.clear();
    if (!names.contains("position")) a.position.clear();
    if (!names.contains("body")) a.body.clear();
    if (!names.contains("albedo")) a.albedo.clear();
    if (!names.contains("variance")) a.variance.clear();
}

std::string_view name(Method m) {
    return integrator_kind(m).name;
}

Outcome render(const RenderOptions& o) {
    std::optional<Method> method;
    if (!o.method.empty()) method = std::ranges::find(integrator_kinds(), o.method, &IntegratorKind::name)->method;
    auto scene = load_scene(o.scene, method);
    if (!scene) return scene.error();
    auto index = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!index) return index.error();
    Camera& camera = scene->cameras[*index];
    if (auto good = override_scene(o, *scene, camera); !good) return good.error();
    if (auto good = check_image_name(o.out); !good) return good.error();
    auto outputs = parse_outputs(o.aov);
    if (!outputs) return outputs.error();
    if (!outputs->empty() && !o.out.ends_with(".exr"))
        return Error{fmt::format(
            "--aov with {}, expected FILE.exr: other files hold radiance or digital numbers alone", o.out)};

    const std::int64_t period_ns = camera.period_ns;
    const std::int64_t t_ns = o.time_s ? std::llround(*o.time_s * 1e9) : o.frame.value_or(0) * period_ns;
    const auto frame =
        o.frame.value_or(static_cast<std::uint32_t>(std::max<std::int64_t>(0, (t_ns + period_ns / 2) / period_ns)));

    if (auto kept = keep_inputs({o.out}, *scene, {o.pose.trajectory}); !kept) return kept.error();
    if (auto made = make_folder_of(o.out); !made) return made.error();
    TracingThreads threads(o.threads);
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    if (auto loaded = o.pose.load(**world, t_ns, t_ns); !loaded) return loaded.error();
    CameraUnit unit(**world, *index);
    Aovs values;
    Aovs* const aovs = outputs->empty() ? nullptr : &values;
    const std::int64_t budget_ns = (*world)->scene().render.budget_ns;
    // In a run, earlier frames calibrate the renderer and the time for the hand-over.
    if (budget_ns > 0)
        threads.arena.execute([&] {
            unit.embed(unit.expose(frame, t_ns, monotonic_ns() + budget_ns));
            unit.handed_over(monotonic_ns());
        });
    const std::int64_t start_ns = monotonic_ns();
    FrameLedger ledger;
    {
        std::atomic<std::size_t> pixels_done{0};
        const auto pixels = static_cast<double>(unit.radiance().pixels.size());
        const Progress progress("rendering " + o.out, [&] {
            return Step{static_cast<double>(pixels_done) / pixels, {}};
        });
        threads.arena.execute([&] {
            ledger = unit.expose(frame, t_ns, budget_ns > 0 ? start_ns + budget_ns : 0, aovs, &pixels_done);
            unit.embed(ledger);
        });
    }
    const double seconds = static_cast<double>(monotonic_ns() - start_ns) * 1e-9;
    keep_only(*outputs, values);

    auto written = write_image(o.out, {unit.camera(), unit.radiance(), aovs, unit.bytes()});
    if (!written) return written.error();
    const RenderSettings& settings = (*world)->scene().render;
    const SignalLevels levels = signal_levels(unit.camera(), unit.radiance());
    if (const std::string advice = exposure_advice(unit.camera(), levels); !advice.empty())
        say(fmt::format("warning: camera {}: {}", unit.camera().name, advice));
    if (!(levels.brightest > 0))
        say(
            fmt::format("warning: every pixel is black: camera {} sees no lit surface from where it is; see its "
                        "position_m, look_at or attitude_wxyz, its mount, --pose, --time and the light",
                        unit.camera().name));
    say(
        fmt::format("wrote {}: {} x {}, {}, {:.6g} samples per pixel on average ({}), {}, frame {} at {:.6f} s, {} "
                    "triangles, {:.1f} ms",
                    o.out, unit.camera().width, unit.camera().height, name(settings.method),
                    ledger.samples_per_pixel, kSamplesPerPixelNote, kStepNames[ledger.step], frame,
                    static_cast<double>(t_ns) * 1e-9, (*world)->tracer().triangle_count(), 1e3 * seconds));
    nlohmann::json document{{"file", o.out},
                            {"camera", unit.camera().name},
                            {"frame", frame},
                            {"t_ns", t_ns},
                            {"width", unit.camera().width},
                            {"height", unit.camera().height},
                            {"method", name(settings.method)},
                            {"samples_per_pixel", ledger.samples_per_pixel},
                            {"samples", ledger.samples},
                            {"rays", ledger.rays},
                            {"passes", ledger.passes},
                            {"step", kStepNames[ledger.step]},
                            {"triangles", (*world)->tracer().triangle_count()},
                            {"render_s", seconds},
                            {"signal", signal_json(levels)}};
    if (ledger.expected_error >= 0) document["expected_error"] = ledger.expected_error;
    if (settings.method == Method::path) document["max_depth"] = settings.max_depth;
    return document;
}

}  // namespace

Command add_render(Parser app) {
    auto o = std::make_shared<RenderOptions>();
    const Parser c = app.subcommand(
        "render", "Render one frame of a camera, byte for byte as `run` does (except with a time budget)");
    c.option("SCENE", o->scene, "Scene file (TOML), or a name that `narpa list` shows").required();
    c.option("--camera", o->camera, "Name of the camera (default: the first)").type_name("NAME");
    c.option("--time", o->time_s, "Simulation time (default: that of --frame)")
        .type_name("SECONDS")
        .range(-9e9, 9e9);
    c.option("--frame", o->frame,
             "Frame number, which seeds the noise (default: the one nearest to --time; 0 without)");
    o->pose.add_to(c);
    c.option("--format", o->format, "GREY, Y16, YUYV, RGB24, RGGB8, RGGB16 ... instead of the scene's")
        .type_name("FORMAT");
    o->budget.add_to(c);
    std::vector<std::string> methods, explained;
    for (const IntegratorKind& kind : integrator_kinds()) {
        methods.emplace_back(kind.name);
        explained.push_back(fmt::format("{}: {}", kind.name, kind.help));
    }
    c.option("--method", o->method, fmt::format("{}", fmt::join(explained, "; "))).one_of(methods);
    c.option("--max-depth", o->max_depth, "With path: surfaces that a path may hit").range(1, 40);
    c.option("--seed", o->seed, "Seed instead of the scene's");
    c.option("--threads", o->threads, "Threads (default: all cores); the bytes do not depend on it").range(0, 1024);
    c.option("--aov", o->aov, "With .exr: depth,range,normal,position,body,albedo,variance beside radiance")
        .type_name("LIST");
    c.option("-o,--output", o->out,
             "FILE.png (digital numbers), .raw (the device's bytes), .exr or .pfm (linear radiance)")
        .type_name("FILE")
        .required();
    c.group("Sensors");
    c.examples({"narpa render docking -o out/view.png",
                "narpa render cornell --spp 256 -o out/cornell.exr --aov depth,normal",
                "narpa render docking --pose chaser=20,0,0,0,0,0,1 -o out/near.png"});
    return [o] { return render(*o); };
}

}  // namespace narpa::cli
