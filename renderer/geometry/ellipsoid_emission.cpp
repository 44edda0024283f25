#include <cmath>
#include <numbers>

#include "renderer/geometry/ellipsoid.h"
#include "renderer/material/directions.h"

namespace narpa {
namespace {

class EllipsoidEmission final : public EmissiveSurface {
public:
    EllipsoidEmission(const Vec3& semi_axes_m, double radius_m, double radiance) : semi_axes_m_(semi_axes_m) {
        const Vec3& a = semi_axes_m;
        properties_ = {{}, radius_m, radiance * std::numbers::pi * std::cbrt(std::pow(a.x * a.y * a.z, 2))};
    }

    /// Convex: it does not light itself from outside, and from inside every direction meets it anyway.
    [[nodiscard]] bool is_worth_sampling(const EmitterView& view) const noexcept override {
        return !view.own && Cone(*this, view.to_body(view.way_to({}))).distance2 > 1;
    }
    [[nodiscard]] Sample sample(const EmitterView& view, double, double u, double v) const noexcept override {
        const Cone cone(*this, view.to_body(view.way_to({})));
        const double drop = u * cone.one_minus_cos;  // 1 - cos of the angle from the axis
        const Vec3 scaled =
            Basis(normalized(cone.towards)).to_world(direction_at(std::sqrt(drop * (2 - drop)), 1 - drop, v));
        return {view.q_world_body * normalized(scaled * semi_axes_m_)};
    }
    /// Of an even choice in the cone. A linear map A takes the scaled solid angle to |det A| / |A w|^3 times as
    /// much.
    [[nodiscard]] double pdf(const EmitterView& view, const Vec3& direction, const Hit&) const noexcept override {
        const Cone cone(*this, view.to_body(view.way_to({})));
        const double shrink = norm(view.to_body(direction) / semi_axes_m_);
        const double det = semi_axes_m_.x * semi_axes_m_.y * semi_axes_m_.z;
        return 1 / (2 * std::numbers::pi * cone.one_minus_cos * det * shrink * shrink * shrink);
    }

private:
    /// Seen from outside, in the body's frame with its axes scaled to 1: the cone of directions that meet it.
    struct Cone {
        Vec3 towards{};            ///< from the receiver to the centre, scaled
        double distance2 = 0;      ///< of the scaled centre; not above 1 from inside
        double one_minus_cos = 0;  ///< of the cone's half angle

        Cone(const EllipsoidEmission& e, const Vec3& to_centre_body)
            : towards(to_centre_body / e.semi_axes_m_), distance2(dot(towards, towards)) {
            const double sin2 = std::min(1.0, 1 / distance2);
            one_minus_cos = sin2 / (1 + std::sqrt(1 - sin2));
        }
    };

    Vec3 semi_axes_m_;
};

}  // namespace

std::unique_ptr<const EmissiveSurface> EllipsoidShape::emission(const Scene& scene) const {
    const double radiance =
        mean_band(vec_cast<double>(scene.materials[static_cast<std::size_t>(material_)].emission));
    if (!(radiance > 0)) return nullptr;
    return std::make_unique<EllipsoidEmission>(semi_axes_m_, radius_m_, radiance);
}

}  // namespace narpa
