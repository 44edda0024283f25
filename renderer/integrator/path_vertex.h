/// renderer/integrator/path_vertex.h - a vertex of a path, and the state of the path between its vertices.
#pragma once

#include <algorithm>
#include <limits>
#include <numbers>

#include "renderer/integrator/shading.h"
#include "renderer/light/lights.h"
#include "renderer/light/small_body_sampling.h"
#include "renderer/material/directions.h"

namespace narpa {

/// A path vertex: the surface at the hit and its BSDF.
///
/// Light is incident from one side of a plane: that of the face or, where rays leave from the smooth surface that
/// vertex normals describe (Hit::departure_body), that of the smooth surface.
///
/// A normal of any other direction - from a normal map, or from vertex normals in a concave region - gives part of
/// the BSDF to directions behind the plane, from where no light can come: dark seams and lost energy. Here that
/// part is reflected to the mirror image of each direction in the plane. Mirroring preserves solid angles, so the
/// total reflectance is exactly the material's about its normal, and a white surface in uniform light stays white
/// whatever its normals are. (Related: the vertical mirror facet that reflects what a tilted facet would lose in V.
/// Schuessler, E. Heitz, J. Hanika, C. Dachsbacher, "Microfacet-based normal mapping for robust Monte Carlo path
/// tracing", ACM TOG 36(6), 2017.)
class PathVertex {
public:
    PathVertex() = default;
    /// Seen along a unit direction with a footprint of this width (see surface_at). Without `fold`, only the
    /// surface's normal counts, as in direct lighting.
    PathVertex(const Tracer& tracer, const BodyPoses& at, const Hit& hit, const Vec3& ray_direction, double width_m,
               bool fold) noexcept
        : surface_(surface_at(tracer, at, hit, ray_direction, width_m)),
          plane_(surface_.normal),
          view_(-ray_direction) {
        if (!fold) return;
        plane_ = hit.geometric_normal;
        if (hit.shading_normal != hit.geometric_normal) {
            const Vec3 flat = at.T_world_body_at(static_cast<std::size_t>(hit.body), hit.time) * hit.departure_body;
            if (flat != hit.position) plane_ = hit.shading_normal;
        }
        // Vertex normals that face away from the viewer cannot be used.
        if (dot(surface_.normal, view_) <= 0) surface_.normal = hit.geometric_normal;
        bent_ = surface_.normal != plane_;
        plain_ = !bent_ && surface_.material->kind == &kinds::lambert && dot(plane_, view_) > 0;
    }

    [[nodiscard]] const Surface& surface() const noexcept { return surface_; }
    /// Normal of the plane, unit, on the viewer's side except at silhouettes of smooth meshes.
    [[nodiscard]] const Vec3& plane() const noexcept { return plane_; }

    /// Unit, towards the viewer.
    [[nodiscard]] const Vec3& view() const noexcept { return view_; }
    /// True if the surface's normal is not the plane's.
    [[nodiscard]] bool bent() const noexcept { return bent_; }
    /// True for Lambert's law about the plane's normal, the most common case.
    [[nodiscard]] bool plain() const noexcept { return plain_; }

    /// True if the BSDF is a delta distribution (bsdf.h).
    [[nodiscard]] bool specular() const noexcept { return is_specular(*surface_.material); }
    /// True for Lambert's law alone, about any normal.
    [[nodiscard]] bool has_no_lobe() const noexcept {
        return is_lambert_or_phong(*surface_.material) && surface_.specular == Rgb{};
    }

    struct Response {
        Rgb f_cos{};     ///< BSDF times the cosine of the incidence, 1/sr
        double pdf = 0;  ///< density per solid angle with which `scatter` chooses the direction
    };
    /// For light from the unit direction l.
    [[nodiscard]] Response respond(const Vec3& l) const noexcept {
        const double cosine = dot(l, plane_);
        if (cosine <= 0) return {};
        if (plain_) return {surface_.diffuse * kInvPi * static_cast<float>(cosine), cosine * std::numbers::inv_pi};
        const Response straight = unfolded(l);
        if (!bent_) return straight;
        const Response image = unfolded(folded(l));
        return {straight.f_cos + image.f_cos, straight.pdf + image.pdf};
    }

    /// BSDF sampling of the next direction. The density is infinite if no other technique can find it.
    [[nodiscard]] BsdfSample scatter(const std::array<double, 3>& u) const noexcept {
        if (plain_) {
            BsdfSample s;
            s.l = narpa::folded(cosine_direction(plane_, u[1], u[2]), plane_);
            s.pdf = dot(s.l, plane_) * std::numbers::inv_pi;
            s.weight = surface_.diffuse;
            return s;
        }
        BsdfSample s = sample_bsdf(surface_, surface_.normal, view_, u);
        const Vec3 image = folded(s.l);
        if (s.specular)
            s.pdf = std::numeric_limits<double>::infinity();
        else if (bent_)
            s.pdf += bsdf_pdf(surface_, surface_.normal, image, view_);
        const double height = dot(s.l, plane_);
        if (s.transmitted ? height > 0 : height < 0) s.l = image;
        return s;
    }

private:
    static constexpr float kInvPi = static_cast<float>(std::numbers::inv_pi);

    [[nodiscard]] Vec3 folded(const Vec3& l) const noexcept { return l - 2 * dot(l, plane_) * plane_; }
    [[nodiscard]] Response unfolded(const Vec3& l) const noexcept {
        const double cosine = dot(surface_.normal, l);
        if (cosine <= 0) return {};
        return {bsdf(surface_, surface_.normal, l, view_) * static_cast<float>(cosine),
                bsdf_pdf(surface_, surface_.normal, l, view_)};
    }

    Surface surface_{};
    Vec3 plane_{}, view_{};
    bool bent_ = false, plain_ = false;
};

/// A path between its vertices.
struct Path {
    std::uint32_t ray = 0;  ///< index of the camera ray
    Rgb throughput{1, 1, 1};
    Rgb* to = nullptr;         ///< where its light is added: radiance of the camera's ray, or a second vertex
    float radiance_scale = 1;  ///< factor of the throughput that Russian roulette ignores: radiance scaling that
                               ///< leaving a dense medium undoes, and the change of weight at a second vertex
    double direction_pdf = std::numeric_limits<double>::infinity();  ///< of the ray, per solid angle
    double length_m = 0;                                             ///< from the camera to the vertex
    Receiver start{};                  ///< origin of the ray, or of shadow rays; set only if needed
    SmallBodySampling small_bodies{};  ///< its share in sampling the next ray
    bool sun_sampled = false;          ///< next-event estimation accounts for all sunlight along the ray
    // Path reuse:
    bool lit = false;     ///< the direct light of its first surface is known, and the path survived roulette there
    bool sunlit = false;  ///< that light is not zero
    int first_vertex = -1;   ///< index in FirstVertices; -1: none
    int second_vertex = -1;  ///< index of the second vertex; -1: none
};

inline float max_component(const Rgb& c) noexcept {
    return std::max({c.x, c.y, c.z});
}

}  // namespace narpa
