#include "renderer/light/small_body_sampling.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace narpa {
namespace {

/// Squared sine of a cone's half angle, which is the fraction of a Lambert surface's rays that hit the body
/// overhead: BSDF sampling suffices for wider ones.
constexpr double kWide = 0.25;
/// Bodies that fill less of the sky than this get fewer rays.
constexpr double kNegligible = 1e-6;
/// A non-convex shape is assumed to fill kOwnShape of its own sky; on it, small bodies weigh at least kMinOfMesh:
/// enough for its dark side, with little loss on the lit one.
constexpr double kOwnShape = 0.25, kMinOfMesh = 0.1;

/// Cone of a body's bounding sphere as seen from the receiver.
struct Cone {
    Vec3 to_centre{};
    double distance2 = 0;
    double sine2 = 0;       ///< squared sine of the half angle, 1 from within the sphere
    double importance = 0;  ///< approximate fraction of a Lambert surface's rays that hit it

    [[nodiscard]] bool is_small() const { return importance > 0 && sine2 < kWide; }
    [[nodiscard]] double one_minus_cosine() const { return sine2 / (1 + std::sqrt(1 - sine2)); }
    [[nodiscard]] double pdf() const { return 1 / (2 * std::numbers::pi * one_minus_cosine()); }
    [[nodiscard]] bool holds(const Vec3& direction) const {
        const Vec3 across = cross(direction, to_centre);  // its length is the sine's, without cancellation
        return dot(direction, to_centre) > 0 && dot(across, across) < sine2 * distance2;
    }
};

Cone cone_of(const Tracer& tracer, const BodyPoses& at, const Receiver& to, std::size_t body) {
    Cone c;
    if (static_cast<int>(body) == to.body) return c;
    const double radius_m = tracer.bounding_radius_m(body);
    c.to_centre = (at.position_at(body, to.time) - to.anchor) - to.offset;
    c.distance2 = dot(c.to_centre, c.to_centre);
    const double highest = dot(c.to_centre, to.up) + radius_m;
    if (highest <= 0) return c;
    c.sine2 = c.distance2 > radius_m * radius_m ? radius_m * radius_m / c.distance2 : 1;
    c.importance = c.sine2 == 1 ? 1 : c.sine2 * std::min(1.0, highest / std::sqrt(c.distance2));
    return c;
}

}  // namespace

SmallBodySampling::SmallBodySampling(const Tracer& tracer, const BodyPoses& at, const Receiver& to) noexcept {
    const bool meets_itself = to.body >= 0 && !tracer.shape(static_cast<std::size_t>(to.body)).properties().convex;
    double wide = meets_itself ? kOwnShape : 0;
    for (const std::uint32_t body : tracer.largest_bodies()) {
        const Cone c = cone_of(tracer, at, to, body);
        (c.is_small() ? sum_ : wide) += c.importance;
    }
    if (!(sum_ > 0)) return;
    const double part = std::max(sum_ / (sum_ + wide), meets_itself ? kMinOfMesh : 0);
    share_ = 0.5 * part * std::min(1.0, sum_ / kNegligible);
}

bool SmallBodySampling::may_help(const Tracer& tracer, const BodyPoses& at) noexcept {
    for (const std::uint32_t seen : tracer.largest_bodies())
        for (const std::uint32_t from : tracer.all_bodies()) {
            if (from == seen) continue;
            const double radius_m = tracer.bounding_radius_m(seen),
                         farthest_m = norm(at.T_world_body[seen].t - at.T_world_body[from].t) +
                                      tracer.bounding_radius_m(from);
            if (radius_m * radius_m < kWide * farthest_m * farthest_m) return true;
        }
    return false;
}

Vec3 SmallBodySampling::direction(const Tracer& tracer, const BodyPoses& at, const Receiver& to, double choice,
                                  double u, double v) const noexcept {
    double left = choice * sum_;
    Cone chosen;
    for (const std::uint32_t body : tracer.largest_bodies()) {
        const Cone c = cone_of(tracer, at, to, body);
        if (!c.is_small()) continue;
        chosen = c;
        if (left < c.importance) break;
        left -= c.importance;
    }
    const double drop = u * chosen.one_minus_cosine();  // 1 - cosine of the angle from the axis
    return Basis(normalized(chosen.to_centre)).to_world(direction_at(std::sqrt(drop * (2 - drop)), 1 - drop, v));
}

double SmallBodySampling::pdf(const Tracer& tracer, const BodyPoses& at, const Receiver& to,
                              const Vec3& direction) const noexcept {
    double density = 0;
    for (const std::uint32_t body : tracer.largest_bodies()) {
        const Cone c = cone_of(tracer, at, to, body);
        if (c.is_small() && c.holds(direction)) density += c.importance / sum_ * c.pdf();
    }
    return density;
}

}  // namespace narpa
