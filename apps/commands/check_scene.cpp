#include "apps/commands/check_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "apps/cli.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/material/bsdf_kind.h"

namespace narpa::cli {
namespace {

/// The number of materials of each kind.
std::map<std::string_view, int> material_kinds(const Scene& scene) {
    std::map<std::string_view, int> count;
    for (const Material& m : scene.materials) ++count[m.kind->name];
    return count;
}

nlohmann::json describe_shape(const Scene& scene, const Body& body) {
    if (const int* const mesh = std::get_if<int>(&body.shape))
        return {{"triangles", scene.meshes[static_cast<std::size_t>(*mesh)].faces.size()}};
    const auto& [kind, values, material] = std::get<ExactShape>(body.shape);
    nlohmann::json out;
    auto value = values.begin();
    for (const TableKey& key : kind->keys.rows) {
        const int count = key.value.counts[0];  // 0: a number
        auto& of_key = out[fmt::format("{}_{}", kind->name, key.name)];
        if (count == 0) of_key = *value++;
        for (int i = 0; i < count; ++i) of_key.push_back(*value++);
    }
    return out;
}

std::string_view kind_name(const Light& light) {
    return Light::kKindNames[static_cast<std::size_t>(light.kind)];
}

std::string light_words(const Light& l) {
    switch (l.kind) {
        case Light::Kind::rectangle: return fmt::format("rectangle of {:g} x {:g} m", l.width_m, l.height_m);
        case Light::Kind::disc: return fmt::format("disc of radius {:g} m", l.radius_m);
        case Light::Kind::point:
        case Light::Kind::directional: break;
    }
    return std::string(kind_name(l));
}

std::string budget_words(const RenderSettings& r) {
    if (r.budget_rays > 0) return fmt::format("at most {} rays per frame", r.budget_rays);
    if (r.budget_ns > 0)
        return fmt::format("{:g} ms from the end of an exposure to the hand-over",
                           static_cast<double>(r.budget_ns) * 1e-6);
    return fmt::format("{} sample{} per pixel", r.spp, r.spp > 1 ? "s" : "");
}

void print_light(const Scene& s) {
    const bool path = s.render.method == RenderSettings::Method::path;
    say(fmt::format(
        "  render: {}, {}",
        path ? fmt::format("path tracing over at most {} surfaces", s.render.max_depth) : "direct light",
        budget_words(s.render)));
    std::string kinds;
    for (const auto& [kind, count] : material_kinds(s))
        kinds += fmt::format("{}{} {}", kinds.empty() ? "" : ", ", count, kind);
    if (!kinds.empty()) say("  materials: " + kinds);
    for (const Light& l : s.lights)
        say(fmt::format("  light {}: {}{}", l.name, light_words(l),
                        l.mount < 0 ? "" : " on body " + s.bodies[static_cast<std::size_t>(l.mount)].name));
}

/// Stars in the view of a camera at time 0, hidden by bodies or not.
std::size_t stars_in_view(const World& world, const Camera& camera) {
    const StarField& field = *world.scene().stars;
    BodyPoses at(world.scene().bodies.size());
    world.place(0, camera.mount, at);
    const Quat q_icrs_camera = field.q_icrs_world * world.camera_pose(camera, 0, at).q;
    const CameraModel& model = *camera.model;
    return static_cast<std::size_t>(std::ranges::count_if(field.stars, [&](const Star& star) {
        const auto p = model.project(conjugate(q_icrs_camera) * star.direction);
        return p && p->x > -0.5 && p->x < camera.width - 0.5 && p->y > -0.5 && p->y < camera.height - 0.5 &&
               model.sees(*p);
    }));
}

}  // namespace

nlohmann::json describe_scene(const World& world) {
    const Scene& s = world.scene();
    nlohmann::json bodies = nlohmann::json::array(), cameras = nlohmann::json::array(),
                   lidars = nlohmann::json::array(), lights = nlohmann::json::array();
    for (const Body& b : s.bodies) {
        nlohmann::json body{{"name", b.name},
                            {"can_id", b.can_id ? nlohmann::json(*b.can_id) : nlohmann::json(nullptr)}};
        body.update(describe_shape(s, b));
        bodies.push_back(body);
    }
    for (const Camera& c : s.cameras)
        cameras.push_back({{"name", c.name},
                           {"width", c.width},
                           {"height", c.height},
                           {"format", link_text(c.format, c.link)},
                           {"rate_hz", 1e9 / static_cast<double>(c.period_ns)},
                           {"detector", c.detector.has_value()},
                           {"lens", c.optics.lens.has_value()}});
    for (const Lidar& l : s.lidars)
        lidars.push_back({{"name", l.name}, {"model", l.model->spec().name}, {"rate_hz", l.model->spec().rate_hz}});
    for (const Light& l : s.lights) lights.push_back({{"name", l.name}, {"kind", kind_name(l)}});
    const std::size_t stars = s.stars ? s.stars->stars.size() : 0;
    nlohmann::json render{{"method", RenderSettings::kMethodNames[static_cast<std::size_t>(s.render.method)]}};
    if (s.render.budget_rays > 0)
        render["budget_rays"] = s.render.budget_rays;
    else if (s.render.budget_ns > 0)
        render["budget_ms"] = static_cast<double>(s.render.budget_ns) * 1e-6;
    else
        render["spp"] = s.render.spp;
    if (s.render.method == RenderSettings::Method::path) render["max_depth"] = s.render.max_depth;
    return {{"name", s.name},
            {"render", render},
            {"lights", lights},
            {"stars", stars},
            {"bodies", bodies},
            {"cameras", cameras},
            {"lidars", lidars},
            {"triangles", world.tracer().triangle_count()},
            {"materials", s.materials.size()},
            {"material_kinds", material_kinds(s)},
            {"textures", s.textures.size()},
            {"warnings", s.warnings}};
}

void print_scene(const World& world) {
    const Scene& s = world.scene();
    say(fmt::format("scene \"{}\": {} bodies, {} triangles, {} materials, {} textures", s.name, s.bodies.size(),
                    world.tracer().triangle_count(), s.materials.size(), s.textures.size()));
    print_light(s);
    for (const Camera& c : s.cameras)
        say(fmt::format("  camera {}: {} x {} {} at {:.6g} Hz{}", c.name, c.width, c.height,
                        link_text(c.format, c.link), 1e9 / static_cast<double>(c.period_ns),
                        c.optics.lens ? ", with a lens" : ""));
    if (s.stars) {
        say(fmt::format("  stars: {}", s.stars->stars.size()));
        for (const Camera& c : s.cameras)
            say(fmt::format("  camera {}: {} stars in its view at time 0", c.name, stars_in_view(world, c)));
    }
    for (const Lidar& l : s.lidars)
        say(fmt::format("  lidar {}: {} at {} turns per second", l.name, l.model->spec().name,
                        l.model->spec().rate_hz));
}

}  // namespace narpa::cli
