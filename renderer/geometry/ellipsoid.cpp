#include "renderer/geometry/ellipsoid.h"

#include "base/each_isa.h"
#include "renderer/material/directions.h"

namespace narpa {
namespace {

class EllipsoidEmission final : public EmissiveSurface {
public:
    EllipsoidEmission(const Vec3& semi_axes_m, double radius_m, double radiance) : semi_axes_m_(semi_axes_m) {
        const Vec3& a = semi_axes_m;
        properties_ = {{}, radius_m, radiance * std::numbers::pi * std::cbrt(std::pow(a.x * a.y * a.z, 2))};
    }

    /// The shape is convex: it does not light its own outer side, and from inside every direction hits it anyway.
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
    /// Density of a uniform choice in the cone of the scaled frame. A linear map A multiplies the solid angle about
    /// w by |det A| / |A w|^3.
    [[nodiscard]] double pdf(const EmitterView& view, const Vec3& direction, const Hit&) const noexcept override {
        const Cone cone(*this, view.to_body(view.way_to({})));
        const double shrink = norm(view.to_body(direction) / semi_axes_m_);
        const double det = semi_axes_m_.x * semi_axes_m_.y * semi_axes_m_.z;
        return 1 / (2 * std::numbers::pi * cone.one_minus_cos * det * shrink * shrink * shrink);
    }

private:
    /// The cone of directions that hit the shape, seen from outside, in the body's frame scaled so that the shape
    /// is the unit sphere.
    struct Cone {
        Vec3 towards{};            ///< from the receiver to the centre, scaled
        double distance2 = 0;      ///< of the scaled centre; at most 1 from inside
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

EllipsoidShape::EllipsoidShape(const Vec3& semi_axes_m, int material, std::optional<MapLatitude> maps)
    : semi_axes_m_(semi_axes_m),
      radius_m_(std::max({semi_axes_m.x, semi_axes_m.y, semi_axes_m.z})),
      scale_to_sphere_{radius_m_ / semi_axes_m.x, radius_m_ / semi_axes_m.y, radius_m_ / semi_axes_m.z},
      material_(material),
      textured_(maps.has_value()),
      map_latitude_(maps.value_or(MapLatitude::planetographic)) {
    properties_ = {.radius_m = radius_m_,
                   .bound_m = radius_m_ * (1 + 1e-5),
                   .bounds = {{}, semi_axes_m},
                   .resolution_m = 4e-15 * radius_m_,
                   .convex = true,
                   .texture_layout = TextureLayout::globe};
}

NARPA_EACH_ISA std::uint32_t EllipsoidShape::nearest(const ShapeRays& rays, std::uint32_t wanted,
                                                     ShapeHits& __restrict hits) const noexcept {
    Lanes<double> range;
    Lanes<int> met = masks_of(wanted), inner;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Crossing c = first_crossing(rays.origin[i], rays.direction[i]);
        range[i] = c.range;
        inner[i] = c.outside ? 0 : -1;
    }
    if (rays.leaving != 0) {
        const Lanes<int> leaving = masks_of(rays.leaving), inside = masks_of(rays.inside);
        for (std::size_t i = 0; i < kLanes; ++i) {
            const bool leaves = leaving[i] != 0, within = inside[i] != 0;
            const Crossing c = own_crossing(rays.origin[i], rays.direction[i], !within);
            range[i] = choose(leaves, c.range, range[i]);
            inner[i] = leaves ? inside[i] : inner[i];
        }
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool here = (met[i] != 0) & (range[i] < rays.t_max[i]);
        const Vec3 position = rays.origin[i] + range[i] * rays.direction[i];
        met[i] = -static_cast<int>(here);
        hits.face[i] = here ? 0 : hits.face[i];
        hits.range_m[i] = choose(here, range[i], hits.range_m[i]);
        hits.position.put(i, choose(here, position, hits.position[i]));
    }
    const std::uint32_t taken = bits_of(met);
    hits.inner = (hits.inner & ~taken) | (bits_of(inner) & taken);
    return taken;
}

std::uint32_t EllipsoidShape::intersect(const ShapeRays& rays, std::uint32_t wanted,
                                        ShapeHits& hits) const noexcept {
    return nearest(rays, wanted, hits);
}

std::uint32_t EllipsoidShape::occluded(const ShapeRays& rays, std::uint32_t wanted) const noexcept {
    ShapeHits unused;
    return nearest(rays, wanted, unused);
}

NARPA_EACH_ISA void EllipsoidShape::fill_surface(const ShapeHits& found, HitBatch& __restrict hits) const noexcept {
    const Lanes<int> inner = masks_of(found.inner);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 p = onto_surface(found.position[i]), outwards = normal(p),
                   facing = choose(inner[i] != 0, -outwards, outwards);
        hits.position.put(i, p);
        hits.geometric_normal.put(i, facing);
        hits.shading_normal.put(i, facing);
        hits.departure_body.put(i, p);
        hits.beyond_body.put(i, p);
    }
}

void EllipsoidShape::surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept {
    fill_surface(found, hits);
    hits.outside = ~found.inner;
    hits.material.fill(material_);
    hits.u.fill(0), hits.v.fill(0);
    if (!textured_) return;
    for_each_lane(wanted, [&](std::size_t i) {
        const auto [u, v] = uv(map_direction(hits.departure_body[i]));
        hits.u[i] = static_cast<float>(u), hits.v[i] = static_cast<float>(v);
    });
}

/// At a pole dp_du is 0, and dp_dv is along the meridian of u = 0.
TextureFrame EllipsoidShape::texture_frame(const Hit& hit) const noexcept {
    const Vec3 n = map_direction(hit.departure_body);
    const double s = std::hypot(n.x, n.y), cos_longitude = s > 0 ? n.x / s : 1, sin_longitude = s > 0 ? n.y / s : 0;
    const Vec3 dn_du = 2 * std::numbers::pi * Vec3{-n.y, n.x, 0};
    const Vec3 dn_dv = -std::numbers::pi * Vec3{n.z * cos_longitude, n.z * sin_longitude, -s};
    // The point whose direction on the map is n: p = M n / h, h^2 = n.S n. With A = diag(semi-axes^2), M and S are
    // both A for planetographic directions, 1 and 1/A for planetocentric, and sqrt(A) and 1 for parametric ones.
    const Vec3 a2 = semi_axes_m_ * semi_axes_m_, one{1, 1, 1};
    const bool graphic = map_latitude_ == MapLatitude::planetographic,
               centric = map_latitude_ == MapLatitude::planetocentric;
    const Vec3 m = graphic ? a2 : centric ? one : semi_axes_m_, m_n = m * n;
    const Vec3 s_n = graphic ? m_n : centric ? n / a2 : n;
    const double h = std::sqrt(dot(n, s_n));
    const auto dp = [&](const Vec3& dn) { return (1 / h) * (m * dn - (dot(s_n, dn) / (h * h)) * m_n); };
    return {dp(dn_du), dp(dn_dv)};
}

std::unique_ptr<const EmissiveSurface> EllipsoidShape::emission(const Scene& scene) const {
    const double radiance =
        mean_band(vec_cast<double>(scene.materials[static_cast<std::size_t>(material_)].emission));
    if (!(radiance > 0)) return nullptr;
    return std::make_unique<EllipsoidEmission>(semi_axes_m_, radius_m_, radiance);
}

Vec3 ellipsoid_axes_m(std::span<const double> values) {
    return values.size() == 1 ? Vec3{values[0], values[0], values[0]} : Vec3{values[0], values[1], values[2]};
}

std::shared_ptr<const Shape> make_ellipsoid(std::span<const double> values, int material,
                                            std::optional<MapLatitude> maps) {
    if (!std::ranges::all_of(values, [](double x) { return x > 0 && std::isfinite(x); })) return nullptr;
    return std::make_shared<EllipsoidShape>(ellipsoid_axes_m(values), material, maps);
}

}  // namespace narpa
