// The surface of a mesh at hits: position, normals, texture coordinates, and the starts of rays that leave.
#include <algorithm>

#include "base/each_isa.h"
#include "renderer/geometry/mesh_shape.h"

namespace narpa {
namespace {

/// Barycentric interpolation of three vertices' texture coordinates.
float interpolate(const TrianglePoint& p, float a, float b, float c) {
    return static_cast<float>((1 - p.b1 - p.b2) * static_cast<double>(a) + p.b1 * static_cast<double>(b) +
                              p.b2 * static_cast<double>(c));
}

}  // namespace

/// Normals and texture coordinates at the three vertices of each ray's face.
struct alignas(64) MeshShape::VertexLanes {
    bool textured = false;  ///< else uv is not set
    std::array<Lanes<float>, 9> normal;
    std::array<Lanes<float>, 6> uv;

    [[nodiscard]] std::array<Vec3, 3> normals(std::size_t i) const {
        const auto n = [&](std::size_t k) {
            return Vec3{static_cast<double>(normal[k][i]), static_cast<double>(normal[k + 1][i]),
                        static_cast<double>(normal[k + 2][i])};
        };
        return {n(0), n(3), n(6)};
    }
};

NARPA_EACH_ISA void MeshShape::fill_surface(const ShapeHits& found, const VertexLanes& vertex,
                                            HitBatch& __restrict hits) const noexcept {
    const Lanes<int> inner = masks_of(found.inner);
    Lanes<int> outside;
    const auto fill = [&](std::size_t i, const TriangleSurface& s) {
        const Vec3 d = found.direction[i];
        const bool back = (inner[i] != 0) | (dot(s.outwards, d) > 0);
        const double side = choose(back, -1, 1);
        outside[i] = -static_cast<int>(!back);
        hits.position.put(i, found.position[i]);
        hits.geometric_normal.put(i, side * s.outwards);
        hits.shading_normal.put(i, side * s.smooth);
        hits.departure_body.put(i, choose(back, s.below, s.above));
        hits.beyond_body.put(i, choose(back, s.above, s.below));
    };
    if (mesh_.normals.empty())
        for (std::size_t i = 0; i < kLanes; ++i)
            fill(i, flat_surface(found.triangle[i], found.position[i], -found.direction[i]));
    else
        for (std::size_t i = 0; i < kLanes; ++i)
            fill(i, surface_about(found.triangle[i], found.point(i), vertex.normals(i), -found.direction[i]));
    hits.outside = bits_of(outside);
    hits.u.fill(0), hits.v.fill(0);
    if (!vertex.textured) return;
    const auto& uv = vertex.uv;
    for (std::size_t i = 0; i < kLanes; ++i) {
        hits.u[i] = interpolate(found.point(i), uv[0][i], uv[2][i], uv[4][i]);
        hits.v[i] = interpolate(found.point(i), uv[1][i], uv[3][i], uv[5][i]);
    }
}

void MeshShape::surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept {
    for_each_lane(wanted, [&](std::size_t i) { hits.material[i] = mesh_.face_material[found.face[i]]; });
    finish_surface(found, wanted, hits);
}

void MeshShape::surface_of(int material, const ShapeHits& found, std::uint32_t wanted,
                           HitBatch& hits) const noexcept {
    hits.material.fill(material);
    finish_surface(found, wanted, hits);
}

/// Everything but the materials, which are set.
void MeshShape::finish_surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept {
    VertexLanes vertex;
    const auto textured = [&](std::size_t i) { return textured_[static_cast<std::size_t>(hits.material[i])] != 0; };
    if (!textured_.empty()) for_each_lane(wanted, [&](std::size_t i) { vertex.textured |= textured(i); });
    if (!mesh_.normals.empty())
        for_each_lane(wanted, [&](std::size_t i) {
            const auto& corner = mesh_.faces[found.face[i]];
            for (std::size_t k = 0; k < 3; ++k) {
                const Vec3f& n = mesh_.normals[corner[k]];
                vertex.normal[3 * k][i] = n.x, vertex.normal[3 * k + 1][i] = n.y, vertex.normal[3 * k + 2][i] = n.z;
            }
        });
    if (vertex.textured)
        for_each_lane(wanted, [&](std::size_t i) {
            const auto& corner = mesh_.faces[found.face[i]];
            for (std::size_t k = 0; k < 3; ++k) {
                const auto [u, v] = textured(i) ? mesh_.uvs[corner[k]] : std::array<float, 2>{};
                vertex.uv[2 * k][i] = u, vertex.uv[2 * k + 1][i] = v;
            }
        });
    fill_surface(found, vertex, hits);
}

TextureFrame MeshShape::texture_frame(const Hit& hit) const noexcept {
    if (mesh_.uvs.empty()) return {};
    const auto& f = mesh_.faces[hit.face];
    const Triangle t = triangle(hit.face);
    const auto uv = [&](std::size_t k, std::size_t axis) {
        return static_cast<double>(mesh_.uvs[f[k]][axis]) - static_cast<double>(mesh_.uvs[f[0]][axis]);
    };
    const double u1 = uv(1, 0), w1 = uv(1, 1), u2 = uv(2, 0), w2 = uv(2, 1), inverse_det = 1 / (u1 * w2 - u2 * w1);
    const Vec3 e1 = t.b - t.a, e2 = t.c - t.a;
    const TextureFrame frame{inverse_det * (w2 * e1 - w1 * e2), inverse_det * (u1 * e2 - u2 * e1)};
    return is_finite(frame.dp_du) && is_finite(frame.dp_dv) ? frame : TextureFrame{};  // no area in the texture
}

Rgb MeshShape::vertex_colour(std::uint32_t face, const Vec3& position_body) const noexcept {
    if (mesh_.colours.empty()) return {1, 1, 1};
    const Triangle t = triangle(face);
    const Vec3 e1 = t.b - t.a, e2 = t.c - t.a, p = position_body - t.a;
    const double e11 = dot(e1, e1), e12 = dot(e1, e2), e22 = dot(e2, e2), p1 = dot(p, e1), p2 = dot(p, e2),
                 inverse_det = 1 / (e11 * e22 - e12 * e12);
    const double b1 = std::clamp(inverse_det * (e22 * p1 - e12 * p2), 0.0, 1.0),
                 b2 = std::clamp(inverse_det * (e11 * p2 - e12 * p1), 0.0, 1 - b1);
    const auto& corner = mesh_.faces[face];
    const Rgb colour = static_cast<float>(1 - b1 - b2) * mesh_.colours[corner[0]] +
                       static_cast<float>(b1) * mesh_.colours[corner[1]] +
                       static_cast<float>(b2) * mesh_.colours[corner[2]];
    return is_finite(colour) ? colour : mesh_.colours[corner[0]];
}

}  // namespace narpa
