#include "apps/commands/body_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "apps/progress.h"
#include "apps/warnings.h"
#include "base/constants.h"
#include "renderer/geometry/shape_kind.h"

namespace narpa::cli {
namespace {

struct BodyBox {
    Vec3 centre_m{}, size_m{};
    double radius_m = 0;  ///< of a sphere about the centre that holds the body
};

BodyBox box_of(const Scene& scene, const Tracer& tracer, std::size_t body) {
    const Body& b = scene.bodies[body];
    if (const auto axes = semi_axes_m(b)) return {{}, 2.0 * *axes, std::max({axes->x, axes->y, axes->z})};
    const int* const index = std::get_if<int>(&b.shape);
    if (!index) {
        const BodyBounds& bounds = tracer.bounds(body);
        return {bounds.centre_m, 2.0 * bounds.semi_axes_m, tracer.bounding_radius_m(body)};
    }
    const Mesh& mesh = scene.meshes[static_cast<std::size_t>(*index)];
    Vec3 low{kInfinity, kInfinity, kInfinity}, high = -low;
    for (const Vec3f& p : mesh.positions)
        for (int k = 0; k < 3; ++k) {
            low[k] = std::min(low[k], static_cast<double>(p[k]));
            high[k] = std::max(high[k], static_cast<double>(p[k]));
        }
    return {mesh.origin_m + 0.5 * (low + high), high - low, 0.5 * norm(high - low)};
}

/// The place is inside a body if rays from there in all directions meet the inner side of its surface.
bool is_inside(const Tracer& tracer, const BodyPoses& at, int body, const Vec3& place) {
    constexpr std::array<double, 2> kSides{-1, 1};
    const std::array<std::uint32_t, 1> only{static_cast<std::uint32_t>(body)};
    RayBatch rays;
    for (const double x : kSides)
        for (const double y : kSides)
            for (const double z : kSides)  // off the diagonals, where a mesh may have edges
                rays.put(rays.n++, {place, normalized(Vec3{x, 0.83 * y, 0.71 * z})});
    HitBatch hits;
    tracer.intersect(at, rays, only, hits);
    for (std::size_t i = 0; i < rays.n; ++i)
        if (hits[i].body != body || hits[i].outside) return false;
    return true;
}

std::string size_words(const Vec3& size_m) {
    if (size_m.x == size_m.y && size_m.y == size_m.z) return fmt::format("{:.4g} m across", size_m.x);
    return fmt::format("{:.4g} x {:.4g} x {:.4g} m", size_m.x, size_m.y, size_m.z);
}

std::string view_words(const BodyView& view) {
    if (view.inside) return fmt::format("{:.4g} m away, around it", view.distance_m);
    if (std::isinf(view.size_px)) return fmt::format("{:.4g} m away, larger than the view", view.distance_m);
    return fmt::format("{:.4g} m away, {:.3g} px", view.distance_m, view.size_px);
}

/// What makes a mesh's unit doubtful: too small to be seen by any camera. Empty: nothing.
std::string doubt_of(const Scene& scene, std::size_t body, const Vec3& size_m, const std::vector<BodyView>& views) {
    constexpr double kTiny_px = 0.5, kTiny_m = 0.01;
    if (!std::holds_alternative<int>(scene.bodies[body].shape)) return {};
    const double largest_m = std::max({size_m.x, size_m.y, size_m.z});
    double most_px = -1;
    for (const BodyView& v : views)
        if (v.body == body) most_px = std::max(most_px, v.size_px);
    if (most_px < 0 || !(most_px < kTiny_px || (largest_m < kTiny_m && most_px < 10 * kTiny_px))) return {};
    return fmt::format(
        "body {} is {} and at most {:.2g} px in each camera; is its mesh in another unit? `scale` is "
        "metres per unit of the file",
        scene.bodies[body].name, size_words(size_m), most_px);
}

nlohmann::json view_json(const Scene& scene, const BodyView& v) {
    return {{"camera", scene.cameras[v.camera].name},
            {"distance_m", v.distance_m},
            {"size_px", std::isinf(v.size_px) ? nlohmann::json(nullptr) : nlohmann::json(v.size_px)},
            {"camera_inside", v.inside}};
}

void warn_of(const Scene& scene, const BodyView& v, const Vec3& size_m) {
    if (!v.inside) return;
    const Body& body = scene.bodies[v.body];
    const bool is_mesh = std::holds_alternative<int>(body.shape);
    warn(fmt::format("camera {} is inside body {}, which is {}; see the position_m of both{}",
                     scene.cameras[v.camera].name, body.name, size_words(size_m),
                     is_mesh ? ", and the `scale` of its mesh, metres per unit of the file" : ""));
}

}  // namespace

std::vector<Vec3> body_sizes_m(const Scene& scene, const Tracer& tracer) {
    std::vector<Vec3> sizes;
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) sizes.push_back(box_of(scene, tracer, i).size_m);
    return sizes;
}

std::vector<BodyView> body_views(const World& world) {
    const Scene& s = world.scene();
    std::vector<BodyView> views;
    for (std::size_t c = 0; c < s.cameras.size(); ++c) {
        const Camera& camera = s.cameras[c];
        BodyPoses at(s.bodies.size());
        world.place(0, camera.mount, at);
        const Vec3 eye = world.camera_pose(camera, 0, at).t;
        for (std::size_t b = 0; b < s.bodies.size(); ++b) {
            if (static_cast<int>(b) == camera.mount) continue;
            const BodyBox box = box_of(s, world.tracer(), b);
            const double distance = norm(at.T_world_body[b] * box.centre_m - eye), radius = box.radius_m;
            const double angle = distance > radius ? 2 * std::asin(radius / distance) : kInfinity;
            views.push_back({b, c, distance, angle * camera.model->pixels_per_radian(),
                             distance <= radius && is_inside(world.tracer(), at, static_cast<int>(b), eye)});
        }
    }
    return views;
}

void check_body_views(const World& world, nlohmann::json& document) {
    const Scene& s = world.scene();
    const std::vector<Vec3> sizes = body_sizes_m(s, world.tracer());
    const std::vector<BodyView> views = body_views(world);
    for (std::size_t b = 0; b < s.bodies.size(); ++b) {
        nlohmann::json& body = document["bodies"][b];
        body["size_m"] = {sizes[b].x, sizes[b].y, sizes[b].z};
        body["views"] = nlohmann::json::array();
        std::string text = fmt::format(
            "  body {}{}: {}", s.bodies[b].name,
            s.bodies[b].can_id ? fmt::format(", commanded on CAN at 0x{:03X}", *s.bodies[b].can_id) : "",
            size_words(sizes[b]));
        for (const BodyView& v : views) {
            if (v.body != b) continue;
            body["views"].push_back(view_json(s, v));
            text += fmt::format("; camera {}: {}", s.cameras[v.camera].name, view_words(v));
        }
        say(text);
        for (const BodyView& v : views)
            if (v.body == b) warn_of(s, v, sizes[b]);
        if (const std::string doubt = doubt_of(s, b, sizes[b], views); !doubt.empty()) warn(doubt);
    }
}

}  // namespace narpa::cli
