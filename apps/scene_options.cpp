#include "apps/scene_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <utility>

#include "apps/warnings.h"
#include "base/text/nearest_name.h"
#include "renderer/keys/shipped_file.h"

namespace narpa::cli {
namespace {

/// `given` is BODY=NUMBERS, for messages.
Result<Rigid3> parse_pose(const std::string& numbers, const std::string& given) {
    std::array<double, 7> v{};
    const char* at = numbers.data();
    const char* end = at + numbers.size();
    for (std::size_t i = 0; i < v.size(); ++i) {
        const auto [next, error] = std::from_chars(at, end, v[i]);
        const bool last = i + 1 == v.size();
        if (error != std::errc{} || !std::isfinite(v[i]) || (last ? next != end : next == end || *next != ','))
            return Error{
                fmt::format("--pose \"{}\", expected BODY=x,y,z,qw,qx,qy,qz (metres, unit quaternion)", given)};
        at = next + 1;
    }
    Rigid3 T{{v[3], v[4], v[5], v[6]}, {v[0], v[1], v[2]}};
    if (!accept_attitude(T.q))
        return Error{fmt::format("--pose \"{}\": the quaternion's norm is {:.6g}, expected 1", given,
                                 norm(Quat{v[3], v[4], v[5], v[6]}))};
    return T;
}

/// `told`: those that an estimator can be told.
std::vector<ModelErrorName> model_errors(bool told) {
    std::vector<ModelErrorName> out(kModelErrors.begin(), kModelErrors.end());
    if (told) out.insert(out.end(), kToldErrors.begin(), kToldErrors.end());
    return out;
}

std::string names_of_model_errors(bool told) {
    std::string names;
    for (const ModelErrorName& n : model_errors(told)) names += (names.empty() ? "" : ", ") + std::string(n.name);
    return names;
}

Error no_such_body(const std::string& name, const std::string& given, const Scene& scene) {
    std::vector<std::string> names;
    for (const Body& b : scene.bodies) names.push_back(b.name);
    return {fmt::format("--pose \"{}\": no body named \"{}\" in the scene, expected one of {}{}", given, name,
                        fmt::join(names, ", "), did_you_mean(name, names)),
            scene.file};
}

/// Warns of bodies without a pose at a time that is wanted, or so near it that `run` would not report them as
/// stale.
void warn_of_missing_times(const std::vector<TrajectoryRow>& rows, const std::string& file, std::int64_t t_from_ns,
                           std::int64_t t_to_ns, double stale_after_s) {
    std::map<std::string, std::pair<std::int64_t, std::int64_t>> times_ns;  // first and last, by body
    for (const TrajectoryRow& row : rows) {
        auto& [first, last] = times_ns.try_emplace(row.body, row.t_ns, row.t_ns).first->second;
        first = std::min(first, row.t_ns), last = std::max(last, row.t_ns);
    }
    const std::int64_t stale_after_ns = std::llround(stale_after_s * 1e9);
    for (const auto& [body, times] : times_ns) {
        const auto [first, last] = times;
        const bool is_early = t_from_ns < first - stale_after_ns;
        if (!is_early && t_to_ns <= last + stale_after_ns) continue;
        warn(
            fmt::format("{}: has poses of body \"{}\" from {:g} to {:g} s, not at {:g} s; there it rests "
                        "near the {} of them",
                        file, body, static_cast<double>(first) * 1e-9, static_cast<double>(last) * 1e-9,
                        static_cast<double>(is_early ? t_from_ns : t_to_ns) * 1e-9, is_early ? "first" : "last"));
    }
}

}  // namespace

void BudgetOptions::add_to(Parser app) {
    const Option samples = app.option("--spp", spp, "Samples per pixel instead of the scene's").range(1, 65535);
    const Option time =
        app.option("--budget-ms", budget_ms, "Time budget per frame in milliseconds, in place of samples")
            .range(0.001, 1e6);
    const Option rays = app.option("--budget-rays", budget_rays, "Budget per frame in rays, in place of samples")
                            .range(std::uint64_t{1}, std::uint64_t{1'000'000'000'000});
    for (const Option& option : {samples, time, rays}) (void)option.group("Budget of a frame");
    samples.excludes(time).excludes(rays);
    time.excludes(rays);
}

void BudgetOptions::override_scene(RenderSettings& render) const {
    if (!spp && !budget_ms && !budget_rays) return;
    render.spp = spp.value_or(render.spp);
    render.keep_deadline = render.keep_deadline && !spp;
    render.budget_ns = budget_ms ? std::llround(*budget_ms * 1e6) : 0;
    render.budget_rays = budget_rays.value_or(0);
}

void PoseOptions::add_to(Parser app) {
    app.option("--trajectory", trajectory,
               "The bodies' poses: trajectory or truth log (CSV), or description of files (TOML)")
        .type_name("FILE");
    app.option("--pose", poses, "A body's constant pose (metres; body to world)")
        .type_name("BODY=x,y,z,qw,qx,qy,qz")
        .values(1, 1)
        .repeatable();
}

Status PoseOptions::place(Scene& scene) const {
    std::set<std::string> placed;
    for (const std::string& text : poses) {
        auto pair = split_pair(text, "BODY=x,y,z,qw,qx,qy,qz");
        if (!pair) return pair.error();
        auto T = parse_pose(pair->second, text);
        if (!T) return T.error();
        const auto body = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                       [&](const Body& b) { return b.name == pair->first; });
        if (body == scene.bodies.end()) return no_such_body(pair->first, text, scene);
        if (!placed.insert(pair->first).second)
            return Error{
                fmt::format("--pose \"{}\": body \"{}\" has a pose already, expected one", text, pair->first)};
        body->initial = {*T, {}, {}};
    }
    return Ok{};
}

Result<std::vector<TrajectoryRow>> PoseOptions::rows() const {
    if (trajectory.empty()) return std::vector<TrajectoryRow>{};
    auto rows = read_trajectory(own_or_shipped(trajectory));
    if (!rows) return rows;
    for (const std::string& text : poses) {
        const std::string body = text.substr(0, text.find('='));
        const auto row = std::ranges::find(*rows, body, &TrajectoryRow::body);
        if (row != rows->end())
            return Error{
                fmt::format("has poses of body \"{}\", and --pose has another, expected only one of the two", body),
                trajectory, row->line};
    }
    return rows;
}

Status PoseOptions::load(World& world, const std::vector<TrajectoryRow>& rows, std::int64_t t_from_ns,
                         std::int64_t t_to_ns) const {
    if (trajectory.empty()) return Ok{};
    if (auto loaded = world.load(rows, t_from_ns, t_to_ns); !loaded) return loaded;
    warn_of_missing_times(rows, trajectory, t_from_ns, t_to_ns, world.scene().render.stale_after_s);
    return Ok{};
}

Status PoseOptions::load(World& world, std::int64_t t_from_ns, std::int64_t t_to_ns) const {
    const auto all = rows();
    if (!all) return all.error();
    return load(world, *all, t_from_ns, t_to_ns);
}

Result<ModelUncertainty> model_uncertainty(const std::string& text, const std::string& option, double* distortion) {
    const std::vector<ModelErrorName> known = model_errors(!distortion);
    ModelUncertainty u;
    std::set<std::string> given;
    for (std::size_t from = 0; from < text.size();) {
        const std::size_t end = std::min(text.find(',', from), text.size());
        const std::string item = text.substr(from, end - from);
        from = end + 1;
        const std::size_t equals = std::min(item.find('='), item.size());
        const std::string name = item.substr(0, equals);
        const auto field = std::ranges::find(known, name, &ModelErrorName::name);
        const bool is_distortion = distortion && name == "distortion";
        if (field == known.end() && !is_distortion)
            return Error{fmt::format("{} \"{}\": expected NAME=VALUE with one of {}{}", option, item,
                                     names_of_model_errors(!distortion), distortion ? ", distortion" : "")};
        if (!given.insert(name).second) return Error{fmt::format("{}: {} is given twice", option, name)};
        double value = 0;
        const char* const last = item.data() + item.size();
        const auto [read, error] = std::from_chars(item.data() + std::min(equals + 1, item.size()), last, value);
        if (error != std::errc{} || read != last || !std::isfinite(value) || (value < 0 && !is_distortion))
            return Error{fmt::format("{} \"{}\": expected {}=NUMBER{}", option, item, name,
                                     is_distortion ? "" : ", 0 or more")};
        if (is_distortion)
            *distortion = value;
        else
            u.*(field->field) = field->unit * value;
    }
    return u;
}

void TrackerFlags::add_to(Parser app, const std::string& prefix) {
    dashes = "--" + prefix;
    app.option(dashes + "target", tracker.target,
               "Body whose pose is estimated (default: the first with a mesh that does not carry the camera)")
        .type_name("BODY");
    std::vector<std::string> methods;
    for (const CameraMethod& m : camera_methods()) methods.emplace_back(m.name);
    app.option(dashes + "method", method, help_of_camera_methods()).one_of(methods).shows_default();
    app.option(
           dashes + "start", start,
           "Error of the first guess, made from the truth: attitude, and part of the range; search: no guess, for "
           "frames but of the range")
        .type_name("DEG,PERCENT|search")
        .shows_default();
    app.option(dashes + "range-guess", tracker.range_guess_m,
               "For a start by search in frames: range, known to 30 % (default: the truth, off by up to 30 % at "
               "random)")
        .type_name("METRES")
        .range(1e-3, 1e9);
    app.option(dashes + "uncertainty", uncertainty,
               "What is not exact in the scene, standard deviations: " + names_of_model_errors(true))
        .type_name("NAME=VALUE,...");
    app.option(dashes + "frame-noise", tracker.frame_noise_dn,
               "With " + camera_methods_that_take_noise() +
                   " or search: noise of the frames beside the detector's, standard deviation; 0 of a real "
                   "camera (default: estimated as sampling noise, which grows with the contrast in a pixel)")
        .type_name("DN")
        .range(0.0, 1e5);
    app.option(dashes + "seed", tracker.seed, "Seed of the first guess and of the renders").shows_default();
}

Result<TrackerOptions> TrackerFlags::options() const {
    TrackerOptions o = tracker;
    auto model = model_uncertainty(uncertainty, dashes + "uncertainty");
    if (!model) return model.error();
    o.model = *model;
    o.method = find_camera_method(method);  // `method` is one of the table's
    o.search = start == "search";
    if (o.frame_noise_dn && !o.method->takes_frame_noise && !o.search)
        return Error{fmt::format("{}frame-noise is for all pixels: expected --method {}, or --start search", dashes,
                                 camera_methods_that_take_noise())};
    if (o.search) return o;
    if (o.range_guess_m > 0)
        return Error{fmt::format("a range is guessed for a start by search, not \"{}\"", start)};
    double deg = 0, percent = 0;
    int used = 0;
    const bool read = std::sscanf(start.c_str(), "%lf,%lf%n", &deg, &percent, &used) == 2 &&
                      used == static_cast<int>(start.size());
    if (!read || !(deg >= 0 && deg <= 180) || !(percent >= 0 && percent <= 100))
        return Error{
            fmt::format("start \"{}\", expected DEG,PERCENT from 0,0 to 180,100, like 5,5, or search", start)};
    o.start_deg = deg, o.start_percent = percent;
    return o;
}

}  // namespace narpa::cli
