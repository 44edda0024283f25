#include "renderer/light/lights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "renderer/light/concentric_disc.h"

namespace narpa {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// What stands so close before a light cannot be told from what it is mounted on: a part of the size of both, for
/// rounding in single precision there, and of the distance, for rounding in double.
constexpr double kTouching = 4e-6, kTouchingFarOff = 1e-15;

Rigid3 frame_of(const BodyPoses& at, int mount) {
    return mount < 0 ? Rigid3{} : at.T_world_body[static_cast<std::size_t>(mount)];
}

/// From the receiver to a point that stands `from_origin` (world's axes) from the origin of a frame.
Vec3 way(const Receiver& to, const Rigid3& T_world_frame, const Vec3& from_origin) {
    return (T_world_frame.t - to.anchor) + (from_origin - to.offset);
}

double area_m2(const Light& l) {
    if (l.kind == Light::Kind::rectangle) return l.width_m * l.height_m;
    return std::numbers::pi * l.radius_m * l.radius_m;
}
bool has_extent(const Light& l) {
    return l.kind == Light::Kind::rectangle || l.kind == Light::Kind::disc;
}

/// Density per solid angle of a point that is chosen with this density per area of a surface.
double per_solid_angle(double per_area, double range_m, double cosine) {
    return per_area * range_m * range_m / std::abs(cosine);
}

bool is_mesh(const Body& body) {
    return std::holds_alternative<int>(body.shape);
}
std::size_t mesh_of(const Body& body) {
    return static_cast<std::size_t>(std::get<int>(body.shape));
}
/// Semi-axes of a body that is no mesh.
Vec3 semi_axes(const Body& body) {
    if (const Ellipsoid* e = std::get_if<Ellipsoid>(&body.shape)) return e->semi_axes_m;
    const double r = std::get<Sphere>(body.shape).radius_m;
    return {r, r, r};
}
int exact_material(const Body& body) {
    if (const Ellipsoid* e = std::get_if<Ellipsoid>(&body.shape)) return e->material;
    return std::get<Sphere>(body.shape).material;
}
/// An ellipsoid seen from outside, in its own frame with its axes scaled to 1: the cone of directions that meet it.
struct ScaledView {
    Vec3 semi_axes_m{};
    Vec3 towards{};            ///< from the receiver to the centre, scaled
    double distance2 = 0;      ///< of the scaled centre; not above 1 from inside
    double one_minus_cos = 0;  ///< of the cone's half angle

    ScaledView(const Body& body, const Vec3& to_centre_body)
        : semi_axes_m(semi_axes(body)), towards(to_centre_body / semi_axes_m), distance2(dot(towards, towards)) {
        const double sin2 = std::min(1.0, 1 / distance2);
        one_minus_cos = sin2 / (1 + std::sqrt(1 - sin2));
    }
    [[nodiscard]] bool from_outside() const { return distance2 > 1; }
    /// Density per solid angle of an even choice in the cone. A linear map A takes the scaled solid angle to
    /// |det A| / |A w|^3 times as much.
    [[nodiscard]] double pdf(const Vec3& direction_body) const {
        const double shrink = norm(direction_body / semi_axes_m);
        const double det = semi_axes_m.x * semi_axes_m.y * semi_axes_m.z;
        return 1 / (2 * std::numbers::pi * one_minus_cos * det * shrink * shrink * shrink);
    }
};

}  // namespace

Receiver receiver_at(const Vec3& position) noexcept {
    return {position, {}, {}, -1};
}
Receiver receiver_at(const BodyPoses& at, const Hit& from, const Vec3& up) noexcept {
    const Rigid3& T = at.T_world_body[static_cast<std::size_t>(from.body)];
    return {T.t, T.q * from.departure_body, up, from.body};
}

double power_heuristic(double own, double other) noexcept {
    if (other == 0 || own == kInfinity) return 1;
    const double ratio = other / own;
    return 1 / (1 + ratio * ratio);
}

Lights::Lights(const Scene& scene)
    : scene_(&scene), emitter_of_body_(scene.bodies.size(), -1), faces_(scene.meshes.size()) {
    if (scene.sun) sun_.emplace(*scene.sun);
    for (std::size_t i = 0; i < scene.lights.size(); ++i) add_light(i);
    lights_ = emitters_.size();
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) add_body(i);
}

void Lights::add_light(std::size_t index) {
    const Light& l = scene_->lights[index];
    Emitter e{static_cast<int>(index), -1, l.mount, l.T_mount_light.t, 0, mean_band(vec_cast<double>(l.emission))};
    if (e.power <= 0) return;
    e.touching_m = l.mount >= 0 ? kTouching * norm(e.centre) : 0;
    if (has_extent(l)) {
        any_with_extent_ = true;
        e.power *= area_m2(l);
        e.radius_m = l.kind == Light::Kind::disc ? l.radius_m : 0.5 * std::hypot(l.width_m, l.height_m);
        e.touching_m += kTouching * e.radius_m;
    }
    emitters_.push_back(e);
}

void Lights::add_body(std::size_t index) {
    const Body& body = scene_->bodies[index];
    Emitter e{-1, static_cast<int>(index), static_cast<int>(index)};
    if (is_mesh(body)) {
        const Mesh& mesh = scene_->meshes[mesh_of(body)];
        Faces& faces = faces_[mesh_of(body)];
        if (faces.face.empty()) faces = shining_faces(mesh);
        if (faces.face.empty()) return;
        e.power = faces.cumulative.back();
        Vec3 low{kInfinity, kInfinity, kInfinity}, high = -low;
        const auto each_corner = [&](const auto& visit) {
            for (const std::uint32_t face : faces.face)
                for (const std::uint32_t corner : mesh.faces[face]) visit(vec_cast<double>(mesh.positions[corner]));
        };
        each_corner([&](const Vec3& p) {
            for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
        });
        e.centre = 0.5 * (low + high);
        each_corner([&](const Vec3& p) { e.radius_m = std::max(e.radius_m, norm(p - e.centre)); });
    } else {
        const Vec3 a = semi_axes(body);
        const Material& m = scene_->materials[static_cast<std::size_t>(exact_material(body))];
        e.radius_m = std::max({a.x, a.y, a.z});
        e.power =
            mean_band(vec_cast<double>(m.emission)) * std::numbers::pi * std::cbrt(std::pow(a.x * a.y * a.z, 2));
        if (e.power <= 0) return;
    }
    emitter_of_body_[index] = static_cast<int>(emitters_.size());
    emitters_.push_back(e);
}

Lights::Faces Lights::shining_faces(const Mesh& mesh) const {
    Faces shining;
    double sum = 0;
    for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
        // A texture counts as white: it can only darken, so that all that shines can be chosen.
        const double radiance = mean_band(vec_cast<double>(scene_->materials[mesh.face_material[f]].emission));
        if (!(radiance > 0)) continue;
        const auto corner = [&](std::size_t k) { return vec_cast<double>(mesh.positions[mesh.faces[f][k]]); };
        const double area = 0.5 * norm(cross(corner(1) - corner(0), corner(2) - corner(0)));
        if (!(area > 0)) continue;
        shining.face.push_back(f);
        shining.cumulative.push_back(sum += area * radiance);
    }
    return shining;
}

std::span<const Lights::Emitter> Lights::emitters(Group group) const noexcept {
    return std::span(emitters_).first(group == Group::lights ? lights_ : emitters_.size());
}

double Lights::importance(const BodyPoses& at, const Receiver& to, const Emitter& e) const noexcept {
    const Rigid3 T = frame_of(at, e.mount);
    const Vec3 centre = way(to, T, T.q * e.centre);
    if (e.light >= 0) {
        const Light& l = scene_->lights[static_cast<std::size_t>(e.light)];
        const Vec3 shines_along = T.q * (l.T_mount_light.q * Vec3{0, 0, 1});
        if (l.kind == Light::Kind::directional) return e.power * std::max(0.0, -dot(to.up, shines_along));
        if (has_extent(l) && dot(centre, shines_along) >= 0) return 0;
    } else if (const Body& body = scene_->bodies[static_cast<std::size_t>(e.body)]; !is_mesh(body)) {
        // Convex: it does not light itself from outside, and from inside every direction meets it anyway.
        if (e.body == to.body || !ScaledView(body, conjugate(T.q) * centre).from_outside()) return 0;
    }
    const double distance = std::max(norm(centre), e.radius_m), highest = dot(centre, to.up) + e.radius_m;
    if (highest <= 0 || distance == 0) return 0;
    return e.power / (distance * distance) * std::min(1.0, highest / distance);
}

double Lights::chance(const BodyPoses& at, const Receiver& to, Group group, const Emitter& chosen) const noexcept {
    if (emitters(group).size() == 1) return importance(at, to, chosen) > 0 ? 1 : 0;
    double sum = 0;
    for (const Emitter& e : emitters(group)) sum += importance(at, to, e);
    return sum > 0 ? importance(at, to, chosen) / sum : 0;
}

std::optional<LightSample> Lights::sample(const BodyPoses& at, const Receiver& to, Group group, double choice,
                                          double u, double v) const noexcept {
    double sum = 0;
    for (const Emitter& e : emitters(group)) sum += importance(at, to, e);
    if (!(sum > 0)) return std::nullopt;
    double left = choice * sum, share = 0;
    const Emitter* chosen = nullptr;
    for (const Emitter& e : emitters(group)) {
        const double part = emitters(group).size() == 1 ? sum : importance(at, to, e);
        if (part == 0) continue;
        if (chosen != nullptr) left -= share;
        chosen = &e, share = part;
        if (left < share) break;
    }
    LightSample s;
    if (chosen->light >= 0) {
        s = sample_light(at, to, *chosen, u, v);
        s.pdf *= share / sum;
        s.radiance_per_pdf *= static_cast<float>(sum / share);
    } else if (is_mesh(scene_->bodies[static_cast<std::size_t>(chosen->body)])) {
        s = sample_mesh(at, to, *chosen, std::min(left / share, 1.0), u, v);
    } else {
        s = sample_exact(at, to, *chosen, u, v);
    }
    if (!is_finite(s.direction)) return std::nullopt;  // the point itself
    return s;
}

LightSample Lights::sample_light(const BodyPoses& at, const Receiver& to, const Emitter& e, double u,
                                 double v) const noexcept {
    const Light& l = scene_->lights[static_cast<std::size_t>(e.light)];
    const Rigid3 T = frame_of(at, e.mount);
    const Quat q_world_light = T.q * l.T_mount_light.q;
    const Vec3 shines_along = q_world_light * Vec3{0, 0, 1};
    LightSample s;
    if (l.kind == Light::Kind::directional) {
        s.direction = -shines_along;
        s.range_m = s.pdf = kInfinity;
        s.radiance_per_pdf = l.emission;
        return s;
    }
    Vec3 point{};
    if (l.kind == Light::Kind::rectangle) {
        point = {(u - 0.5) * l.width_m, (v - 0.5) * l.height_m, 0};
    } else if (l.kind == Light::Kind::disc) {
        const auto [x, y] = concentric_disc(u, v);
        point = {l.radius_m * x, l.radius_m * y, 0};
    }
    const Vec3 there = way(to, T, T.q * e.centre + q_world_light * point);
    const double distance = norm(there);
    s.direction = there / distance;
    s.range_m = distance * (1 - kTouchingFarOff) - e.touching_m;
    s.pdf = l.kind == Light::Kind::point
                ? kInfinity
                : per_solid_angle(1 / area_m2(l), distance, dot(s.direction, shines_along));
    const double per_pdf = l.kind == Light::Kind::point ? 1 / (distance * distance) : 1 / s.pdf;
    s.radiance_per_pdf = static_cast<float>(per_pdf) * l.emission;
    return s;
}

LightSample Lights::sample_mesh(const BodyPoses& at, const Receiver& to, const Emitter& e, double choice, double u,
                                double v) const noexcept {
    const std::size_t mesh_index = mesh_of(scene_->bodies[static_cast<std::size_t>(e.body)]);
    const Mesh& mesh = scene_->meshes[mesh_index];
    const Faces& faces = faces_[mesh_index];
    const auto chosen =
        std::upper_bound(faces.cumulative.begin(), faces.cumulative.end() - 1, choice * faces.cumulative.back());
    LightSample s;
    s.body = e.body;
    s.face = faces.face[static_cast<std::size_t>(chosen - faces.cumulative.begin())];
    const auto corner = [&](std::size_t k) { return vec_cast<double>(mesh.positions[mesh.faces[s.face][k]]); };
    const double from_first = std::sqrt(u);
    const Vec3 point = (1 - from_first) * corner(0) + from_first * ((1 - v) * corner(1) + v * corner(2));
    const Rigid3 T = frame_of(at, e.mount);
    s.direction = normalized(way(to, T, T.q * point));
    return s;
}

LightSample Lights::sample_exact(const BodyPoses& at, const Receiver& to, const Emitter& e, double u,
                                 double v) const noexcept {
    const Rigid3 T = frame_of(at, e.mount);
    const ScaledView view(scene_->bodies[static_cast<std::size_t>(e.body)], conjugate(T.q) * way(to, T, {}));
    const double drop = u * view.one_minus_cos;  // 1 - cos of the angle from the axis
    const Vec3 scaled =
        Basis(normalized(view.towards)).to_world(direction_at(std::sqrt(drop * (2 - drop)), 1 - drop, v));
    LightSample s;
    s.body = e.body;
    s.direction = T.q * normalized(scaled * view.semi_axes_m);
    return s;
}

double Lights::pdf(const BodyPoses& at, const Receiver& to, Group group, const Vec3& direction,
                   const Hit& met) const noexcept {
    const int index = emitter_of_body_[static_cast<std::size_t>(met.body)];
    if (index < 0 || group == Group::lights) return 0;
    const Emitter& e = emitters_[static_cast<std::size_t>(index)];
    const double chosen = chance(at, to, group, e);
    if (chosen == 0) return 0;
    const Body& body = scene_->bodies[static_cast<std::size_t>(met.body)];
    if (is_mesh(body)) {
        const double radiance =
            mean_band(vec_cast<double>(scene_->materials[static_cast<std::size_t>(met.material)].emission));
        const double per_area = radiance / faces_[mesh_of(body)].cumulative.back();
        return chosen * per_solid_angle(per_area, met.range_m, dot(direction, met.geometric_normal));
    }
    const Rigid3 T = frame_of(at, e.mount);
    const Quat q_body_world = conjugate(T.q);
    return chosen * ScaledView(body, q_body_world * way(to, T, {})).pdf(q_body_world * direction);
}

Rgb Lights::met_before(double range_m, const BodyPoses& at, const Receiver& to, Group group, const Vec3& direction,
                       double direction_pdf) const noexcept {
    Rgb radiance{};
    for (const Emitter& e : emitters(Group::lights)) {
        const Light& l = scene_->lights[static_cast<std::size_t>(e.light)];
        if (!has_extent(l)) continue;
        const Rigid3 T = frame_of(at, e.mount);
        const auto [x, y, z] = columns(T.q * l.T_mount_light.q);
        const double against = dot(direction, z);
        if (against >= 0) continue;
        const Vec3 centre = way(to, T, T.q * e.centre);
        const double t = dot(centre, z) / against;
        if (!(t > 0 && t * (1 - kTouchingFarOff) - e.touching_m < range_m)) continue;
        const Vec3 p = t * direction - centre;
        const double px = dot(p, x), py = dot(p, y);
        const bool on_it = l.kind == Light::Kind::disc
                               ? px * px + py * py < l.radius_m * l.radius_m
                               : 2 * std::abs(px) < l.width_m && 2 * std::abs(py) < l.height_m;
        if (!on_it) continue;
        const double other =
            direction_pdf == kInfinity ? 0 : chance(at, to, group, e) * per_solid_angle(1 / area_m2(l), t, against);
        radiance += static_cast<float>(power_heuristic(direction_pdf, other)) * l.emission;
    }
    return radiance;
}

}  // namespace narpa
