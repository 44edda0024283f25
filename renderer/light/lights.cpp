#include "renderer/light/lights.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/concentric_disc.h"
#include "base/constants.h"
#include "renderer/light/medium.h"

namespace narpa {
namespace {

/// Occluders this close to a light count as its mounting: relative to the size of both, for rounding in single
/// precision, and to the distance, for rounding in double.
constexpr double kTouching = 4e-6, kTouchingFarOff = 1e-15;

Rigid3 frame_of(const BodyPoses& at, int mount, double time) {
    return mount < 0 ? Rigid3{} : at.T_world_body_at(static_cast<std::size_t>(mount), time);
}

/// Vector from the receiver to a point at `from_origin` (world axes) from the origin of a frame.
Vec3 vector_to(const Receiver& to, const Rigid3& T_world_frame, const Vec3& from_origin) {
    return (T_world_frame.t - to.anchor) + (from_origin - to.offset);
}

double area_m2(const Light& l) {
    if (l.kind == Light::Kind::rectangle) return l.width_m * l.height_m;
    return std::numbers::pi * l.radius_m * l.radius_m;
}
bool has_extent(const Light& l) {
    return l.kind == Light::Kind::rectangle || l.kind == Light::Kind::disc;
}

/// Converts a density per surface area to a density per solid angle.
double per_solid_angle(double per_area, double range_m, double cosine) {
    return per_area * range_m * range_m / std::abs(cosine);
}

EmitterView view_of(const Receiver& to, const Rigid3& T_world_body, int body) {
    return {T_world_body.q, T_world_body.t - to.anchor, to.offset, to.up, body == to.body};
}

}  // namespace

Receiver receiver_at(const BodyPoses& at, const Hit& from, const Vec3& up) noexcept {
    const Rigid3 T = at.T_world_body_at(static_cast<std::size_t>(from.body), from.time);
    return {T.t, T.q * from.departure_body, up, from.body, from.time};
}

double power_heuristic(double own, double other) noexcept {
    if (other == 0 || own == kInfinity) return 1;
    const double ratio = other / own;
    return 1 / (1 + ratio * ratio);
}

Lights::Lights(const Tracer& tracer) : scene_(&tracer.scene()), emitter_of_body_(scene_->bodies.size(), -1) {
    const Scene& scene = *scene_;
    if (scene.sun) sun_.emplace(*scene.sun);
    for (std::size_t i = 0; i < scene.lights.size(); ++i) add_light(i);
    lights_ = emitters_.size();
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) add_body(i, tracer.shape(i));
}

void Lights::add_light(std::size_t index) {
    const Light& l = scene_->lights[index];
    Emitter e{static_cast<int>(index),
              -1,
              nullptr,
              l.mount,
              l.T_mount_light.t,
              0,
              mean_band(vec_cast<double>(l.emission))};
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

void Lights::add_body(std::size_t index, const Shape& shape) {
    const auto [known, is_new] = surfaces_.try_emplace(&shape);
    if (is_new) known->second = shape.emission(*scene_);
    const EmissiveSurface* const surface = known->second.get();
    if (surface == nullptr || !(surface->properties().power > 0)) return;
    const auto& [centre, radius_m, power] = surface->properties();
    const int body = static_cast<int>(index);
    emitter_of_body_[index] = static_cast<int>(emitters_.size());
    emitters_.push_back({-1, body, surface, body, centre, radius_m, power});
}

std::span<const Lights::Emitter> Lights::emitters(Group group) const noexcept {
    return std::span(emitters_).first(group == Group::lights ? lights_ : emitters_.size());
}

double Lights::importance(const BodyPoses& at, const Receiver& to, const Emitter& e) const noexcept {
    const Rigid3 T = frame_of(at, e.mount, to.time);
    const Vec3 centre = vector_to(to, T, T.q * e.centre);
    if (e.light >= 0) {
        const Light& l = scene_->lights[static_cast<std::size_t>(e.light)];
        const Vec3 shines_along = T.q * (l.T_mount_light.q * Vec3{0, 0, 1});
        if (l.kind == Light::Kind::directional) return e.power * std::max(0.0, -dot(to.up, shines_along));
        if (has_extent(l) && dot(centre, shines_along) >= 0) return 0;
    } else if (!e.surface->is_worth_sampling(view_of(to, T, e.body))) {
        return 0;
    }
    const double distance = std::max(norm(centre), e.radius_m), highest = dot(centre, to.up) + e.radius_m;
    if (highest <= 0 || distance == 0) return 0;
    return e.power / (distance * distance) * std::min(1.0, highest / distance);
}

double Lights::probability(const BodyPoses& at, const Receiver& to, Group group,
                           const Emitter& chosen) const noexcept {
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
    } else {
        const Rigid3 T = frame_of(at, chosen->mount, to.time);
        const auto [direction, face] =
            chosen->surface->sample(view_of(to, T, chosen->body), std::min(left / share, 1.0), u, v);
        s.body = chosen->body;
        s.direction = direction, s.face = face;
    }
    if (!is_finite(s.direction)) return std::nullopt;  // no light can arrive, or the receiver is at its position
    return s;
}

LightSample Lights::sample_light(const BodyPoses& at, const Receiver& to, const Emitter& e, double u,
                                 double v) const noexcept {
    const Light& l = scene_->lights[static_cast<std::size_t>(e.light)];
    const Rigid3 T = frame_of(at, e.mount, to.time);
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
    const Vec3 there = vector_to(to, T, T.q * e.centre + q_world_light * point);
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

double Lights::pdf(const BodyPoses& at, const Receiver& to, Group group, const Vec3& direction,
                   const Hit& met) const noexcept {
    const int index = emitter_of_body_[static_cast<std::size_t>(met.body)];
    if (index < 0 || group == Group::lights) return 0;
    const Emitter& e = emitters_[static_cast<std::size_t>(index)];
    const double chosen = probability(at, to, group, e);
    if (chosen == 0) return 0;
    const Rigid3 T = frame_of(at, e.mount, to.time);
    return chosen * e.surface->pdf(view_of(to, T, e.body), direction, met);
}

Rgb Lights::radiance_before(double range_m, const BodyPoses& at, const Receiver& to, Group group,
                            const Vec3& direction, double direction_pdf, const Medium* medium) const noexcept {
    Rgb radiance{};
    for (const Emitter& e : emitters(Group::lights)) {
        const Light& l = scene_->lights[static_cast<std::size_t>(e.light)];
        if (!has_extent(l)) continue;
        const Rigid3 T = frame_of(at, e.mount, to.time);
        const auto [x, y, z] = columns(T.q * l.T_mount_light.q);
        const double against = dot(direction, z);
        if (against >= 0) continue;
        const Vec3 centre = vector_to(to, T, T.q * e.centre);
        const double t = dot(centre, z) / against;
        if (!(t > 0 && t * (1 - kTouchingFarOff) - e.touching_m < range_m)) continue;
        const Vec3 p = t * direction - centre;
        const double px = dot(p, x), py = dot(p, y);
        const bool on_it = l.kind == Light::Kind::disc
                               ? px * px + py * py < l.radius_m * l.radius_m
                               : 2 * std::abs(px) < l.width_m && 2 * std::abs(py) < l.height_m;
        if (!on_it) continue;
        const double other = direction_pdf == kInfinity
                                 ? 0
                                 : probability(at, to, group, e) * per_solid_angle(1 / area_m2(l), t, against);
        Rgb arriving = static_cast<float>(power_heuristic(direction_pdf, other)) * l.emission;
        if (medium != nullptr)
            arriving = arriving * medium->transmittance(at, {to.anchor + to.offset, direction, to.time}, t);
        radiance += arriving;
    }
    return radiance;
}

}  // namespace narpa
