// A hit in full: its surface in the world, and where rays that leave it start.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "base/each_isa.h"
#include "renderer/geometry/tracer_impl.h"

namespace narpa {
namespace {

using Face = std::array<std::uint32_t, 3>;

/// Of three vertices' texture coordinates.
float interpolate(const TrianglePoint& p, float a, float b, float c) {
    return static_cast<float>((1 - p.b1 - p.b2) * static_cast<double>(a) + p.b1 * static_cast<double>(b) +
                              p.b2 * static_cast<double>(c));
}

/// What the meshes have at the three vertices of each ray's face, and where the bodies stand.
struct alignas(64) MeshLanes {
    bool smooth = false, textured = false;  ///< else nothing stands in these:
    std::array<Lanes<float>, 9> normal;     ///< zero: none
    std::array<Lanes<float>, 6> uv;
    PoseLanes T_world_body;

    void put_normals(std::size_t i, const Mesh& mesh, const Face& corner) {
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3f n = mesh.normals.empty() ? Vec3f{} : mesh.normals[corner[k]];
            normal[3 * k][i] = n.x, normal[3 * k + 1][i] = n.y, normal[3 * k + 2][i] = n.z;
        }
    }
    void put_uvs(std::size_t i, const Mesh& mesh, const Face& corner, bool looked_at) {
        for (std::size_t k = 0; k < 3; ++k) {
            const auto [u, v] = looked_at ? mesh.uvs[corner[k]] : std::array<float, 2>{};
            uv[2 * k][i] = u, uv[2 * k + 1][i] = v;
        }
    }
    [[nodiscard]] std::array<Vec3, 3> normals(std::size_t i) const {
        const auto n = [&](std::size_t k) {
            return Vec3{static_cast<double>(normal[k][i]), static_cast<double>(normal[k + 1][i]),
                        static_cast<double>(normal[k + 2][i])};
        };
        return {n(0), n(3), n(6)};
    }
};

/// All but bodies and materials. Writes every lane.
NARPA_EACH_ISA void fill_in_meshes(const MeshHits& at, const MeshLanes& mesh, HitBatch& __restrict hits) {
    const Lanes<int> inner = masks_of(at.inner);
    Lanes<int> outside;
    const auto finish = [&](std::size_t i, const std::array<Vec3, 3>& normals) {
        const Rigid3 T = mesh.T_world_body[i];
        const Vec3 d = at.direction[i];
        const TriangleSurface s = surface_about(at.triangle[i], at.point(i), normals, -d);
        const bool back = (inner[i] != 0) | (dot(s.outwards, d) > 0);
        const double side = choose(back, -1, 1);
        outside[i] = -static_cast<int>(!back);
        hits.face[i] = at.face[i];
        hits.range_m[i] = at.range_m[i];
        hits.position.put(i, T * at.position[i]);
        hits.geometric_normal.put(i, T.q * (side * s.outwards));
        hits.shading_normal.put(i, T.q * (side * s.smooth));
        hits.departure_body.put(i, choose(back, s.below, s.above));
        hits.beyond_body.put(i, choose(back, s.above, s.below));
    };
    if (mesh.smooth)
        for (std::size_t i = 0; i < kLanes; ++i) finish(i, mesh.normals(i));
    else
        for (std::size_t i = 0; i < kLanes; ++i) finish(i, {});
    hits.outside = bits_of(outside);
    hits.u.fill(0), hits.v.fill(0);
    if (!mesh.textured) return;
    const auto& uv = mesh.uv;
    for (std::size_t i = 0; i < kLanes; ++i) {
        hits.u[i] = interpolate(at.point(i), uv[0][i], uv[2][i], uv[4][i]);
        hits.v[i] = interpolate(at.point(i), uv[1][i], uv[3][i], uv[5][i]);
    }
}

/// Those of `mine`, which meet this shape: all but body, material and texture coordinates.
NARPA_EACH_ISA void fill_in_shape(const EllipsoidShape& shape, const Rigid3& T_world_body, const MeshHits& at,
                                  std::uint32_t mine, HitBatch& __restrict hits) {
    const Lanes<int> masks = masks_of(mine), inner = masks_of(at.inner);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const auto put = [&](Vec3Lanes& to, const Vec3& v) { to.put(i, choose(masks[i] != 0, v, to[i])); };
        const Vec3 p = shape.onto_surface(at.position[i]), outwards = shape.normal(p);
        const Vec3 normal = T_world_body.q * choose(inner[i] != 0, -outwards, outwards);
        hits.face[i] = masks[i] != 0 ? 0 : hits.face[i];
        hits.range_m[i] = choose(masks[i] != 0, at.range_m[i], hits.range_m[i]);
        put(hits.position, T_world_body * p);
        put(hits.geometric_normal, normal);
        put(hits.shading_normal, normal);
        put(hits.departure_body, p);
        put(hits.beyond_body, p);
    }
    hits.outside = (hits.outside & ~mine) | (mine & ~at.inner);
}

}  // namespace

void Tracer::Impl::finish(const BodyPoses& at, const Found& found, HitBatch& hits) const noexcept {
    hits.met = found.met;
    hits.outside = 0;
    hits.body = found.body;
    if (found.met == 0) return;
    const BodyGroups groups(found.body, found.met);
    std::uint32_t on_meshes = 0;
    for (const auto& [body, mine] : groups)
        if (shapes[body].mesh != nullptr) on_meshes |= mine;
    if (on_meshes != 0) finish_on_meshes(at, found, groups, hits);
    for (const auto& [body, mine] : groups) {
        const Shape& shape = shapes[body];
        if (shape.mesh != nullptr) continue;
        fill_in_shape(shape.exact, at.T_world_body[body], found.at, mine, hits);
        const bool looked_at = textured[static_cast<std::size_t>(shape.material)] != 0;
        for_each_lane(mine, [&](std::size_t i) {
            hits.material[i] = shape.material;
            const auto [u, v] = looked_at ? EllipsoidShape::uv(shape.exact.normal(hits.departure_body[i]))
                                          : std::array<double, 2>{};
            hits.u[i] = static_cast<float>(u), hits.v[i] = static_cast<float>(v);
        });
    }
}

void Tracer::Impl::finish_on_meshes(const BodyPoses& at, const Found& found, const BodyGroups& groups,
                                    HitBatch& hits) const noexcept {
    MeshLanes lanes;
    const auto is_textured = [&](const Mesh& mesh, std::size_t i) {
        return !mesh.uvs.empty() && textured[static_cast<std::size_t>(hits.material[i])] != 0;
    };
    for (const auto& [body, mine] : groups) {
        if (shapes[body].mesh == nullptr) continue;
        const Mesh& mesh = shapes[body].mesh->mesh();
        lanes.smooth |= !mesh.normals.empty();
        for_each_lane(mine, [&](std::size_t i) {
            hits.material[i] = mesh.face_material[found.at.face[i]];
            lanes.textured |= is_textured(mesh, i);
        });
        const Rigid3& T = at.T_world_body[body];
        if (mine == found.met)
            lanes.T_world_body.fill(T);
        else
            for_each_lane(mine, [&](std::size_t i) { lanes.T_world_body.put(i, T); });
    }
    if (lanes.smooth || lanes.textured)
        for (const auto& [body, mine] : groups) {
            if (shapes[body].mesh == nullptr) continue;
            const Mesh& mesh = shapes[body].mesh->mesh();
            for_each_lane(mine, [&](std::size_t i) {
                const Face& corner = mesh.faces[found.at.face[i]];
                if (lanes.smooth) lanes.put_normals(i, mesh, corner);
                if (lanes.textured) lanes.put_uvs(i, mesh, corner, is_textured(mesh, i));
            });
        }
    fill_in_meshes(found.at, lanes, hits);
}

void Tracer::Impl::finish(const BodyPoses& at, const Meeting& met, Hit& hit) const noexcept {
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
    const Face& corner = mesh.faces[p.face];
    std::array<Vec3, 3> normals{};
    if (!mesh.normals.empty())
        for (std::size_t k = 0; k < 3; ++k) normals[k] = vec_cast<double>(mesh.normals[corner[k]]);
    const TriangleSurface s = surface_about(shape.triangle(p.face), p.point, normals, -met.direction);
    const double side = dot(s.outwards, met.direction) > 0 ? -1 : 1;
    hit.face = p.face;
    hit.position = T_world_body * p.point.position;
    hit.geometric_normal = T_world_body.q * (side * s.outwards);
    hit.shading_normal = T_world_body.q * (side * s.smooth);
    hit.departure_body = side < 0 ? s.below : s.above;
    hit.beyond_body = side < 0 ? s.above : s.below;
    hit.material = mesh.face_material[p.face];
    hit.outside = side > 0;
    hit.u = hit.v = 0;
    if (mesh.uvs.empty() || textured[static_cast<std::size_t>(hit.material)] == 0) return;
    const auto &a = mesh.uvs[corner[0]], &b = mesh.uvs[corner[1]], &c = mesh.uvs[corner[2]];
    hit.u = interpolate(p.point, a[0], b[0], c[0]);
    hit.v = interpolate(p.point, a[1], b[1], c[1]);
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

TextureFrame Tracer::texture_frame(const BodyPoses& at, const Hit& hit) const noexcept {
    const Impl::Shape& shape = impl_->shape_of(hit);
    const Quat& q = at.T_world_body[static_cast<std::size_t>(hit.body)].q;
    if (shape.mesh == nullptr) {
        const auto [du, dv] = shape.exact.per_uv(shape.exact.normal(hit.departure_body));
        return {q * du, q * dv};
    }
    const Mesh& mesh = shape.mesh->mesh();
    if (mesh.uvs.empty()) return {};
    const auto& f = mesh.faces[hit.face];
    const Triangle t = shape.mesh->triangle(hit.face);
    const auto uv = [&](std::size_t k, std::size_t axis) {
        return static_cast<double>(mesh.uvs[f[k]][axis]) - static_cast<double>(mesh.uvs[f[0]][axis]);
    };
    const double u1 = uv(1, 0), w1 = uv(1, 1), u2 = uv(2, 0), w2 = uv(2, 1), inverse_det = 1 / (u1 * w2 - u2 * w1);
    const Vec3 e1 = t.b - t.a, e2 = t.c - t.a;
    const Vec3 dp_du = inverse_det * (w2 * e1 - w1 * e2), dp_dv = inverse_det * (u1 * e2 - u2 * e1);
    if (!is_finite(dp_du) || !is_finite(dp_dv)) return {};  // the texture has no area here
    return {q * dp_du, q * dp_dv};
}

}  // namespace narpa
