// narpa map - depth or height of the surface that a camera sees, with contour lines: picture, lines and numbers.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <utility>

#include "apps/cli.h"
#include "apps/outputs.h"
#include "apps/scene_argument.h"
#include "apps/scene_options.h"
#include "apps/warnings.h"
#include "base/text/base64.h"
#include "base/text/nearest_name.h"
#include "base/write_file.h"
#include "emulator/world.h"
#include "plot/plot.h"
#include "renderer/image/image_file.h"
#include "renderer/map/surface_map.h"

namespace narpa::cli {
namespace {

struct MapOptions {
    SceneArgument scene;
    std::string camera, out, body, of = "depth";
    PoseOptions pose;
    double time_s = 0, datum_m = 0;
    std::vector<double> up;  ///< empty: along z
    std::optional<double> interval_m;
};

constexpr std::array<std::pair<std::string_view, MapQuantity::Kind>, 4> kQuantities{
    {{"depth", MapQuantity::Kind::depth},
     {"range", MapQuantity::Kind::range},
     {"height", MapQuantity::Kind::height},
     {"radius", MapQuantity::Kind::radius}}};

Vec3 direction_of_height(const MapOptions& o) {
    return o.up.empty() ? Vec3{0, 0, 1} : Vec3{o.up[0], o.up[1], o.up[2]};
}

/// Refuses options that would have no effect.
Status check_options(const MapOptions& o, std::string_view extension) {
    if (!o.up.empty() && o.of != "height")
        return Error{fmt::format("--up is the direction of height, expected --of height, not {}", o.of)};
    if (o.interval_m && extension == ".pfm")
        return Error{"a PFM file holds no contour lines, expected no --interval, or another kind of file", o.out};
    return Ok{};
}

Result<MapQuantity> read_quantity(const MapOptions& o, const Scene& scene) {
    MapQuantity q;
    for (const auto& [name, kind] : kQuantities)
        if (name == o.of) q.kind = kind;
    q.datum_m = o.datum_m;
    const Vec3 up = direction_of_height(o);
    if (!(norm(up) > 0)) return Error{fmt::format("--up {:g},{:g},{:g}, expected a direction", up.x, up.y, up.z)};
    q.up = normalized(up);
    if (o.body.empty()) return q;
    std::vector<std::string> names;
    for (const Body& b : scene.bodies) names.push_back(b.name);
    const auto found = std::ranges::find(names, o.body);
    if (found == names.end())
        return Error{fmt::format("--body {}: no such body in the scene, expected one of {}{}", o.body,
                                 fmt::join(names, ", "), did_you_mean(o.body, names)),
                     scene.file};
    q.body = static_cast<int>(found - names.begin());
    return q;
}

/// The map of what a camera sees at one time.
struct View {
    std::unique_ptr<World> world;
    std::string camera;
    SurfaceMap map;
    std::vector<double> levels_m;
    std::vector<ContourLine> lines;
    double lowest_m = INFINITY, highest_m = -INFINITY;
    std::size_t pixels = 0;  ///< with a surface
};

/// All output files: a picture also gets a document beside it.
std::vector<std::string> outputs_of(const MapOptions& o) {
    if (o.out.ends_with(".pfm") || o.out.ends_with(".json")) return {o.out};
    return {o.out, document_beside(o.out)};
}

Result<View> map_view(const MapOptions& o) {
    auto scene = o.scene.load();
    if (!scene) return scene.error();
    if (auto kept = keep_inputs(outputs_of(o), *scene, {o.pose.trajectory}); !kept) return kept.error();
    const auto index = sensor_named(scene->cameras, o.camera, "camera", scene->file);
    if (!index) return index.error();
    if (auto placed = o.pose.place(*scene); !placed) return placed.error();
    const auto quantity = read_quantity(o, *scene);
    if (!quantity) return quantity.error();
    scene->atmosphere.reset();  // a map needs surfaces alone: no tables of light
    scene->sky.reset();
    auto world = World::create(*std::move(scene));
    if (!world) return world.error();
    const std::int64_t t_ns = std::llround(o.time_s * 1e9);
    if (auto loaded = o.pose.load(**world, t_ns, t_ns); !loaded) return loaded.error();

    const Camera& camera = (*world)->scene().cameras[*index];
    BodyPoses at((*world)->scene().bodies.size());
    (*world)->place(t_ns, camera.mount, at);
    const Rigid3 T_world_camera = (*world)->camera_pose(camera, o.time_s, at);
    const SurfaceMapper mapper((*world)->tracer(), at, camera, T_world_camera, *quantity);
    const Progress progress("mapping to " + o.out);
    View view{*std::move(world), camera.name, mapper.map(), {}, {}};
    for (const double v : view.map.quantity.values) {
        if (std::isnan(v)) continue;
        view.lowest_m = std::min(view.lowest_m, v), view.highest_m = std::max(view.highest_m, v);
        ++view.pixels;
    }
    if (view.pixels == 0) {
        const std::string what = fmt::format(
            "camera {} sees no surface{} from where it is; see its position_m, look_at or attitude_wxyz, its "
            "mount, "
            "--pose and --time",
            camera.name, o.body.empty() ? "" : " of body " + o.body);
        if (o.body.empty()) return Error{what, view.world->scene().file};
        warn("the map is empty: " + what);  // a mask of a body that is out of view
    }
    if (!o.interval_m || view.pixels == 0) return view;
    auto levels = contour_levels(view.lowest_m, view.highest_m, *o.interval_m);
    if (!levels) return Error{"--interval: " + levels.error().what};
    view.levels_m = *std::move(levels);
    view.lines = contour_lines(view.map.quantity, view.levels_m, [&](std::size_t a, std::size_t b) {
        const auto width = static_cast<std::size_t>(camera.width);
        const auto pixel = [&](std::size_t i) {
            return ImagePoint{static_cast<double>(i % width), static_cast<double>(i / width)};
        };
        return mapper.is_continuous(pixel(a), pixel(b));
    });
    return view;
}

nlohmann::json to_json(const ContourLine& line, const SurfaceMap& map) {
    nlohmann::json pixels = nlohmann::json::array(), positions = nlohmann::json::array();
    for (const ImagePoint& p : line.points) {
        const Vec3 m = map.position_at(p);
        pixels.push_back({p.x, p.y});
        positions.push_back({m.x, m.y, m.z});
    }
    return {{"level_m", line.level},
            {"closed", line.closed},
            {"px", std::move(pixels)},
            {"position_m", std::move(positions)}};
}

/// Extremes of an empty map are no numbers.
nlohmann::json number_or_null(double x) {
    return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(nullptr);
}

/// The document of the picture (python/narpa/plots/surface.py), which docs/maps.md describes.
nlohmann::json to_json(const MapOptions& o, const View& view) {
    const ScalarField& field = view.map.quantity;
    const std::vector<float> values(field.values.begin(), field.values.end());
    std::vector<std::uint8_t> shade(view.map.shade.size());
    std::ranges::transform(view.map.shade, shade.begin(),
                           [](float s) { return static_cast<std::uint8_t>(std::lround(255 * s)); });
    nlohmann::json lines = nlohmann::json::array();
    for (const ContourLine& line : view.lines) lines.push_back(to_json(line, view.map));
    nlohmann::json document{
        {"plot", "map"},
        {"title", fmt::format("{}: {}{}, camera {}", view.world->scene().name, o.of,
                              o.body.empty() ? "" : " of " + o.body, view.camera)},
        {"of", o.of},
        {"body", o.body},
        {"camera", view.camera},
        {"t_s", o.time_s},
        {"datum_m", o.datum_m},
        {"lowest_m", number_or_null(view.lowest_m)},
        {"highest_m", number_or_null(view.highest_m)},
        {"width", field.width},
        {"height", field.height},
        {"values_m", base64({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float)})},
        {"shade", plot_image(field.width, field.height, 1, shade)},
        {"levels_m", view.levels_m},
        {"lines", std::move(lines)}};
    const Vec3 up = direction_of_height(o);
    if (o.of == "height") document["up"] = {up.x, up.y, up.z};
    if (o.interval_m) document["interval_m"] = *o.interval_m;
    return document;
}

Status write_document(const std::string& path, const nlohmann::json& document) {
    return write_file(path, document.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + '\n');
}

Status write_map(const MapOptions& o, const std::string& extension, const View& view) {
    const ScalarField& field = view.map.quantity;
    if (extension == ".pfm") return write_pfm(o.out, field.width, field.height, field.values);
    const nlohmann::json document = to_json(o, view);
    return extension == ".json" ? write_document(o.out, document) : write_plot(o.out, document);
}

Outcome map(const MapOptions& o) {
    constexpr std::array<std::string_view, 5> kExtensions{".png", ".svg", ".pdf", ".json", ".pfm"};
    const std::string extension = std::filesystem::path(o.out).extension().string();
    if (std::ranges::find(kExtensions, extension) == kExtensions.end())
        return Error{
            fmt::format("unknown kind of file \"{}\", expected {}", extension, fmt::join(kExtensions, ", ")),
            o.out};
    if (auto good = check_options(o, extension); !good) return good.error();
    if (auto made = make_folder_of(o.out); !made) return made.error();
    const auto view = map_view(o);
    if (!view) return view.error();
    if (auto written = write_map(o, extension, *view); !written) return written.error();

    const ScalarField& field = view->map.quantity;
    const std::size_t points =
        std::accumulate(view->lines.begin(), view->lines.end(), std::size_t{0},
                        [](std::size_t n, const ContourLine& line) { return n + line.points.size(); });
    if (o.interval_m && view->lines.empty() && view->pixels > 0)
        warn(
            fmt::format("no contour line: {} reaches from {:.6g} to {:.6g} m, and the lines would be at "
                        "multiples of {:g} m",
                        o.of, view->lowest_m, view->highest_m, *o.interval_m));
    const std::string extent =
        view->pixels > 0 ? fmt::format("{} from {:.6g} to {:.6g} m", o.of, view->lowest_m, view->highest_m)
                         : "no surface";
    say(fmt::format("wrote {}: {} x {}, {}, {} levels, {} contour lines", o.out, field.width, field.height, extent,
                    view->levels_m.size(), view->lines.size()));
    return nlohmann::json{{"file", o.out},
                          {"camera", view->camera},
                          {"of", o.of},
                          {"pixels", view->pixels},
                          {"lowest_m", number_or_null(view->lowest_m)},
                          {"highest_m", number_or_null(view->highest_m)},
                          {"levels_m", view->levels_m},
                          {"lines", view->lines.size()},
                          {"points", points}};
}

}  // namespace

Command add_map(Parser app) {
    auto o = std::make_shared<MapOptions>();
    const Parser c =
        app.subcommand("map", "Map the depth or height of what a camera sees, with contour lines (docs/maps.md)");
    o->scene.add_to(c);
    c.option("--camera", o->camera, "Name of the camera (default: the first)").type_name("NAME");
    c.option("--of", o->of,
             "depth: along the camera's axis; range: from the camera; height: along --up from the origin of the "
             "world, or of --body; radius: distance from that origin")
        .one_of({"depth", "range", "height", "radius"})
        .shows_default();
    c.option("--body", o->body, "Only the surface of this body, with heights and positions in its frame")
        .type_name("NAME");
    c.option("--interval", o->interval_m, "Contour lines at the multiples of this").type_name("METRES").finite();
    c.option("--datum", o->datum_m, "What counts as 0: subtracted from depth, range, height or radius")
        .type_name("METRES")
        .finite()
        .shows_default();
    c.option("--up", o->up, "With --of height: its direction (default: 0,0,1)")
        .type_name("X,Y,Z")
        .comma_separated()
        .values(3, 3);
    c.option("--time", o->time_s, "Simulation time").type_name("SECONDS").range(-9e9, 9e9).shows_default();
    o->pose.add_to(c);
    c.option(
         "-o,--output", o->out,
         "FILE.png, .svg or .pdf (the picture; lines and numbers in FILE.json beside it), .json (these alone) or "
         ".pfm (a 32-bit float for each pixel, NaN where there is no surface)")
        .type_name("FILE")
        .required();
    c.group("Sensors");
    c.examples({"narpa map descent -o out/depth.png",
                "narpa map descent --of height --interval 5 -o out/contours.svg",
                "narpa map docking --body station --interval 1 -o out/port.json"});
    return [o] { return map(*o); };
}

}  // namespace narpa::cli
