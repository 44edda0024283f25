// A hit in full: its surface in the world, and where rays that leave it start.
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "renderer/trace/tracer_impl.h"

namespace narpa {

void Tracer::Impl::finish(const Placement& at, const Meeting& met, Hit& hit) const noexcept {
    const Rigid3& T_world_body = at.T_world_body[static_cast<std::size_t>(hit.body)];
    if (shape_of(hit).mesh != nullptr)
        finish_mesh(T_world_body, met, hit);
    else
        finish_exact(T_world_body, met, hit);
}

void Tracer::Impl::finish_mesh(const Rigid3& T_world_body, const Meeting& met, Hit& hit) const noexcept {
    const MeshScene& shape = *shape_of(hit).mesh;
    const Mesh& mesh = shape.mesh();
    const MeshHit& p = met.mesh;
    const auto& corner = mesh.faces[p.face];
    const std::array<Vec3, 3> v = shape.corners(p.face);
    const std::array<double, 3> weight{1 - p.b1 - p.b2, p.b1, p.b2};

    Vec3 outwards = cross(v[1] - v[0], v[2] - v[0]);  // by the face's winding
    const double area2 = norm(outwards);
    outwards = area2 > 0 ? outwards / area2 : -met.direction;
    const double side = p.inner || dot(outwards, met.direction) > 0 ? -1 : 1;
    Vec3 smooth = outwards, above = p.position, below = p.position;
    if (!mesh.normals.empty()) {
        // Rays leave from the surface that the normals describe, which is above the flat triangle where the mesh
        // bulges to their side: J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II (2021), chapter 4.
        smooth = {};
        Vec3 bulge{}, hollow{};
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3 n = vec_cast<double>(mesh.normals[corner[k]]);
            const double height = dot(p.position - v[k], n);
            smooth += weight[k] * n;
            (height < 0 ? bulge : hollow) += (-weight[k] * height) * n;
        }
        if (dot(smooth, outwards) < 0) smooth = -smooth;
        const double length = norm(smooth);
        smooth = length > 0 ? smooth / length : outwards;
        if (dot(bulge, outwards) > 0) above += bulge;
        if (dot(hollow, outwards) < 0) below += hollow;
    }
    if (side < 0) std::swap(above, below);
    hit.face = p.face;
    hit.position = T_world_body * p.position;
    hit.geometric_normal = T_world_body.q * (side * outwards);
    hit.shading_normal = T_world_body.q * (side * smooth);
    hit.departure_body = above;
    hit.beyond_body = below;
    hit.material = mesh.face_material[p.face];
    hit.outside = side > 0;
    hit.u = hit.v = 0;
    if (!mesh.uvs.empty() && textured[static_cast<std::size_t>(hit.material)] != 0) {
        double u = 0, w = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            u += weight[k] * static_cast<double>(mesh.uvs[corner[k]][0]);
            w += weight[k] * static_cast<double>(mesh.uvs[corner[k]][1]);
        }
        hit.u = static_cast<float>(u);
        hit.v = static_cast<float>(w);
    }
}

void Tracer::Impl::finish_exact(const Rigid3& T_world_body, const Meeting& met, Hit& hit) const noexcept {
    const Shape& shape = shape_of(hit);
    const Vec3 p = shape.exact.onto_surface(met.origin + hit.range_m * met.direction);
    const Vec3 outwards = shape.exact.normal(p);
    hit.departure_body = hit.beyond_body = p;
    hit.position = T_world_body * p;
    hit.geometric_normal = hit.shading_normal = T_world_body.q * (met.outside ? outwards : -outwards);
    hit.material = shape.material;
    hit.outside = met.outside;
    hit.face = 0;
    hit.u = hit.v = 0;
    if (textured[static_cast<std::size_t>(hit.material)] != 0) {
        const auto [u, v] = EllipsoidShape::uv(outwards);
        hit.u = static_cast<float>(u), hit.v = static_cast<float>(v);
    }
}

Vec3 Tracer::Impl::departure(const Hit& from) const noexcept {
    const MeshScene* mesh = shape_of(from).mesh;
    return mesh != nullptr ? mesh->departure(from.face, from.departure_body, from.outside) : from.departure_body;
}

Hit other_side(const Hit& hit) noexcept {
    Hit other = hit;
    other.geometric_normal = -hit.geometric_normal;
    other.shading_normal = -hit.shading_normal;
    other.outside = !hit.outside;
    std::swap(other.departure_body, other.beyond_body);
    return other;
}

TextureFrame Tracer::texture_frame(const Placement& at, const Hit& hit) const noexcept {
    const Impl::Shape& shape = impl_->shape_of(hit);
    const Quat& q = at.T_world_body[static_cast<std::size_t>(hit.body)].q;
    if (shape.mesh == nullptr) {
        const auto [du, dv] = shape.exact.per_uv(shape.exact.normal(hit.departure_body));
        return {q * du, q * dv};
    }
    const Mesh& mesh = shape.mesh->mesh();
    if (mesh.uvs.empty()) return {};
    const auto& f = mesh.faces[hit.face];
    const auto [v0, v1, v2] = shape.mesh->corners(hit.face);
    const auto uv = [&](std::size_t k, std::size_t axis) {
        return static_cast<double>(mesh.uvs[f[k]][axis]) - static_cast<double>(mesh.uvs[f[0]][axis]);
    };
    const double u1 = uv(1, 0), w1 = uv(1, 1), u2 = uv(2, 0), w2 = uv(2, 1), inverse_det = 1 / (u1 * w2 - u2 * w1);
    const Vec3 e1 = v1 - v0, e2 = v2 - v0;
    const Vec3 dp_du = inverse_det * (w2 * e1 - w1 * e2), dp_dv = inverse_det * (u1 * e2 - u2 * e1);
    if (!is_finite(dp_du) || !is_finite(dp_dv)) return {};  // the texture has no area here
    return {q * dp_du, q * dp_dv};
}

}  // namespace narpa
