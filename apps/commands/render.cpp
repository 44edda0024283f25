// narpa render - renders frames of one camera, as a run would, to image files.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <regex>
#include <set>

#include "apps/cli.h"
#include "apps/frame_renderer.h"
#include "apps/outputs.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "renderer/image/image_file.h"
#include "renderer/integrator/integrator.h"
#include "renderer/keys/toml_override.h"

namespace narpa::cli {
namespace {

using Method = RenderSettings::Method;

struct RenderOptions {
    SceneArgument scene;
    std::string camera, format, out, aov, method;
    PoseOptions pose;
    std::optional<double> time_s, every_s;
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

// --- A series: times of a trajectory, values of --set ---

/// Each choice of one value for every --set, the last option's fastest.
Result<std::vector<std::vector<std::string>>> choices_of(const std::vector<std::string>& sets) {
    std::vector<std::vector<std::string>> choices{{}};
    for (const std::string& set : sets) {
        const auto values = values_of_override(set);
        if (!values) return values.error();
        std::vector<std::vector<std::string>> longer;
        for (const auto& choice : choices)
            for (const std::string& value : *values) {
                longer.push_back(choice);
                longer.back().push_back(value);
            }
        choices = std::move(longer);
    }
    return choices;
}

/// Where a file name has %d or %05d; an empty match: nowhere.
std::smatch number_in(const std::string& name) {
    static const std::regex kNumber("%(0[1-9])?d");
    std::smatch found;
    std::regex_search(name, found, kNumber);
    return found;
}

/// The name of the k-th file of a series.
std::string numbered(const std::string& pattern, std::size_t k) {
    const std::smatch found = number_in(pattern);
    if (found.empty()) return pattern;
    const int digits = found[1].matched ? found[1].str()[1] - '0' : 0;
    return found.prefix().str() + fmt::format("{:0{}}", k, digits) + found.suffix().str();
}

/// Frame numbers are those nearest to the times, unless there is an option.
FrameRequest request_at(const RenderOptions& o, std::int64_t t_ns, std::int64_t period_ns) {
    const auto nearest = static_cast<std::uint32_t>(std::max<std::int64_t>(0, (t_ns + period_ns / 2) / period_ns));
    return {t_ns, o.frame.value_or(nearest), o.out};
}

/// The one frame, or with --every those from --time, or the trajectory's begin, to its end.
Result<std::vector<FrameRequest>> requests_of(const RenderOptions& o, const std::vector<TrajectoryRow>& rows,
                                              std::int64_t period_ns) {
    constexpr std::int64_t kMostFrames = 1'000'000;
    const auto ns = [](double s) { return static_cast<std::int64_t>(std::llround(s * 1e9)); };
    const std::int64_t given_ns = o.time_s ? ns(*o.time_s) : o.frame.value_or(0) * period_ns;
    if (!o.every_s) return std::vector{request_at(o, given_ns, period_ns)};
    if (rows.empty()) return Error{"has no poses, expected rows to step through", o.pose.trajectory};
    std::vector<FrameRequest> all;
    const auto [first, last] = std::ranges::minmax_element(rows, {}, &TrajectoryRow::t_ns);
    const std::int64_t from_ns = o.time_s ? given_ns : first->t_ns, step_ns = ns(*o.every_s);
    if (from_ns > last->t_ns) return Error{"ends before --time, expected a time within it", o.pose.trajectory};
    if ((last->t_ns - from_ns) / step_ns >= kMostFrames)
        return Error{fmt::format("--every {:g} makes more than {} frames", *o.every_s, kMostFrames)};
    for (std::int64_t t_ns = from_ns; t_ns <= last->t_ns; t_ns += step_ns)
        all.push_back(request_at(o, t_ns, period_ns));
    return all;
}

Status check_series(const RenderOptions& o, bool is_series) {
    if (o.every_s && o.pose.trajectory.empty())
        return Error{"--every steps through a trajectory, expected --trajectory FILE too"};
    if (is_series && o.out != kStandardOutput && number_in(o.out).empty())
        return Error{"a series of images needs a number in the name, expected one like frame_%05d.png", o.out};
    return Ok{};
}

/// All frames of one choice of values; `done` counts the files of the series.
Status render_choice(const RenderOptions& o, const std::vector<std::string>& sets, bool is_series,
                     const std::set<std::string>& outputs, TracingThreads& threads, std::size_t& done,
                     nlohmann::json& documents) {
    std::optional<Method> method;
    if (!o.method.empty()) method = std::ranges::find(integrator_kinds(), o.method, &IntegratorKind::name)->method;
    auto scene = SceneArgument{o.scene.file, sets}.load(method);
    if (!scene) return scene.error();
    auto index = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!index) return index.error();
    Camera& camera = scene->cameras[*index];
    const std::int64_t period_ns = camera.period_ns;
    if (auto good = override_scene(o, *scene, camera); !good) return good.error();
    const auto rows = o.pose.rows();
    if (!rows) return rows.error();
    auto requests = requests_of(o, *rows, period_ns);
    if (!requests) return requests.error();
    std::vector<std::string> names;
    for (FrameRequest& r : *requests) {
        if (is_series) r.out = numbered(o.out, done++);
        if (r.out != kStandardOutput) names.push_back(r.out);
    }
    if (auto kept = keep_inputs(names, *scene, {o.pose.trajectory}); !kept) return kept.error();
    auto renderer = FrameRenderer::create(*std::move(scene), *index, outputs, threads);
    if (!renderer) return renderer.error();
    for (const FrameRequest& r : *requests) {
        if (auto loaded = o.pose.load((*renderer)->world(), *rows, r.t_ns, r.t_ns); !loaded) return loaded.error();
        auto document = (*renderer)->render(r);
        if (!document) return document.error();
        documents.push_back(*std::move(document));
    }
    return Ok{};
}

Outcome render(const RenderOptions& o) {
    if (auto good = check_image_name(o.out); !good) return good.error();
    auto outputs = parse_outputs(o.aov);
    if (!outputs) return outputs.error();
    if (!outputs->empty() && !o.out.ends_with(".exr"))
        return Error{fmt::format(
            "--aov with {}, expected FILE.exr: other files hold radiance or digital numbers alone", o.out)};
    const auto choices = choices_of(o.scene.sets);
    if (!choices) return choices.error();
    const bool is_series = choices->size() > 1 || o.every_s.has_value();
    if (auto good = check_series(o, is_series); !good) return good.error();
    if (o.out != kStandardOutput)
        if (auto made = make_folder_of(o.out); !made) return made.error();
    nlohmann::json documents = nlohmann::json::array();
    TracingThreads threads(o.threads);
    std::size_t done = 0;
    for (const std::vector<std::string>& sets : *choices)
        if (auto good = render_choice(o, sets, is_series, *outputs, threads, done, documents); !good)
            return good.error();
    if (o.out == kStandardOutput) return nlohmann::json();
    if (!is_series) return documents[0];
    return nlohmann::json{{"frames", documents}};
}

}  // namespace

Command add_render(Parser app) {
    auto o = std::make_shared<RenderOptions>();
    const Parser c = app.subcommand(
        "render", "Render one frame of a camera, byte for byte as `run` does (except with a time budget)");
    o->scene.add_to(c);
    c.option("--camera", o->camera, "Name of the camera (default: the first)").type_name("NAME");
    c.option("--time", o->time_s, "Simulation time (default: that of --frame)")
        .type_name("SECONDS")
        .range(-9e9, 9e9);
    const Option frame = c.option(
        "--frame", o->frame, "Frame number, which seeds the noise (default: the one nearest to --time; 0 without)");
    o->pose.add_to(c);
    c.option("--every", o->every_s,
             "With --trajectory: a frame each so many seconds, from --time or its begin to its end")
        .type_name("SECONDS")
        .range(1e-6, 9e9)
        .excludes(frame);
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
             "FILE.png (digital numbers), .raw (the device's bytes), .exr or .pfm (linear radiance); -: a PNG on "
             "standard output. Of a series, from --every or from --set KEY=A,B,C, the name has a number: "
             "frame_%05d.png")
        .type_name("FILE")
        .required();
    c.group("Sensors");
    c.examples({"narpa render docking -o out/view.png",
                "narpa render cornell --spp 256 -o out/cornell.exr --aov depth,normal",
                "narpa render docking --pose chaser=20,0,0,0,0,0,1 -o out/near.png",
                "narpa render docking --set camera.nav.detector.exposure_s=1e-4,2e-4,4e-4 -o out/stops_%d.png"});
    return [o] { return render(*o); };
}

}  // namespace narpa::cli
