// Traces batches of sixteen rays through a mesh.
#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

#include "base/each_isa.h"
#include "renderer/geometry/mesh_shape.h"
#include "renderer/geometry/sphere_roots.h"

namespace narpa {
namespace {

constexpr double kLongest_m = std::numeric_limits<float>::max();

// Even in robust mode Embree misses some hits at a vertex (its issues 181, 188 and 387): in a closed mesh the ray
// next hits a back face, or from inside nothing. This is common where a camera's pixels line up with a model's
// grid. Such a ray is traced again, turned by a few rounding errors; one that leaves the inner side close to an
// edge and runs along it needs a larger turn.
constexpr std::array kTurns{4e-7, -4e-7, 4e-3, -4e-3};  // radians

Vec3 turned(const Vec3& d, double angle) {
    return d + angle * Vec3{d.y - d.z, d.z - d.x, d.x - d.y + 0.5};
}

/// The corners of faces, as stored in Embree's hierarchy.
struct alignas(64) Corners {
    std::array<Lanes<float>, 9> at;

    [[nodiscard]] Vec3 operator()(std::size_t k, std::size_t i) const {
        return {static_cast<double>(at[3 * k][i]), static_cast<double>(at[3 * k + 1][i]),
                static_cast<double>(at[3 * k + 2][i])};
    }
};

using Four [[gnu::vector_size(16)]] = float;

/// Gathers corners by plain loads. Not inlined, lest the compiler use gather instructions, which are slower. Four
/// vertices at a time, each read with the four bytes behind it, are transposed into x, y and z.
[[gnu::noinline]] void gather(const Mesh& mesh, const Vec3f* vertices, const std::uint32_t* face,
                              std::uint32_t wanted, Corners& out) noexcept {
    Lanes<const std::uint32_t*> faces;
    for (std::size_t i = 0; i < kLanes; ++i) faces[i] = mesh.faces[is_set(wanted, i) ? face[i] : 0].data();
    for (std::size_t k = 0; k < 3; ++k)
        for (std::size_t i = 0; i < kLanes; i += 4) {
            const auto load = [&](std::size_t lane) {
                Four v;
                std::memcpy(&v, &vertices[faces[i + lane][k]], sizeof v);
                return v;
            };
            const auto store = [&](std::size_t axis, Four v) {
                std::memcpy(&out.at[3 * k + axis][i], &v, sizeof v);
            };
            const Four a = load(0), b = load(1), c = load(2), d = load(3);
            const Four ab = __builtin_shufflevector(a, b, 0, 4, 1, 5),
                       cd = __builtin_shufflevector(c, d, 0, 4, 1, 5);
            const Four ab_z = __builtin_shufflevector(a, b, 2, 6, 3, 7),
                       cd_z = __builtin_shufflevector(c, d, 2, 6, 3, 7);
            store(0, __builtin_shufflevector(ab, cd, 0, 1, 4, 5));
            store(1, __builtin_shufflevector(ab, cd, 2, 3, 6, 7));
            store(2, __builtin_shufflevector(ab_z, cd_z, 0, 1, 4, 5));
        }
}

embree::Run run_of(const ShapeRays& rays) {
    return rays.coherent ? embree::Run::together : embree::Run::apart;
}

}  // namespace

inline void MeshShape::EmbreeBatch::clear_hits() noexcept {
    std::fill_n(rays.hit.geomID, kLanes, RTC_INVALID_GEOMETRY_ID);
    std::fill_n(rays.hit.instID[0], kLanes, RTC_INVALID_GEOMETRY_ID);
}

inline void MeshShape::EmbreeBatch::read_hits() noexcept {
    Lanes<int> hits, backs;
    const auto& h = rays.hit;
    const auto& r = rays.ray;
    for (std::size_t i = 0; i < kLanes; ++i) {
        hits[i] = -static_cast<int>(h.geomID[i] != RTC_INVALID_GEOMETRY_ID);
        const float facing = h.Ng_x[i] * r.dir_x[i] + h.Ng_y[i] * r.dir_y[i] + h.Ng_z[i] * r.dir_z[i];
        backs[i] = -static_cast<int>(facing > 0);
    }
    hit = bits_of(hits) & traced;
    back = bits_of(backs) & hit;
}

inline MeshShape::EmbreeHit MeshShape::EmbreeBatch::operator[](std::size_t i) const noexcept {
    return {rays.hit.primID[i], rays.ray.tfar[i], rays.hit.u[i], rays.hit.v[i], is_set(hit, i), is_set(back, i)};
}

inline void MeshShape::EmbreeBatch::put(std::size_t i, const EmbreeHit& h) noexcept {
    rays.hit.primID[i] = h.face;
    rays.ray.tfar[i] = h.t;
    rays.hit.u[i] = h.u, rays.hit.v[i] = h.v;
    hit = (hit & ~(1u << i)) | static_cast<std::uint32_t>(h.hit) << i;
    back = (back & ~(1u << i)) | static_cast<std::uint32_t>(h.back) << i;
}

/// Advances the rays to where Embree starts: the entry into the bounding sphere or, where it is clearly smaller,
/// into the sphere about the mesh's own centre.
inline void MeshShape::advance(const ShapeRays& rays, std::uint32_t wanted, EmbreeBatch& batch) const noexcept {
    Lanes<double> entry_m = rays.entry_m;
    if (off_centre_)
        for (std::size_t i = 0; i < kLanes; ++i)
            entry_m[i] = bounding_entry(rays.origin[i] - centre_, rays.direction[i], radius_m_);
    batch.valid = masks_of(wanted);
    for (std::size_t i = 0; i < kLanes; ++i) batch.valid[i] &= -static_cast<int>(entry_m[i] < rays.t_max[i]);
    batch.traced = bits_of(batch.valid);
    RTCRay16& to = batch.rays.ray;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool valid = batch.valid[i] != 0;
        const double skipped_m = choose(valid, std::max(0.0, entry_m[i]), 0);
        const Vec3 d = rays.direction[i], at = rays.origin[i] + skipped_m * d, from = at - vertex_origin_;
        batch.skipped_m[i] = skipped_m;
        batch.start.put(i, at);
        to.org_x[i] = static_cast<float>(from.x);
        to.org_y[i] = static_cast<float>(from.y);
        to.org_z[i] = static_cast<float>(from.z);
        to.dir_x[i] = static_cast<float>(d.x);
        to.dir_y[i] = static_cast<float>(d.y);
        to.dir_z[i] = static_cast<float>(d.z);
        // An inactive lane holds an empty ray (tfar < tnear): on processors without vectors of sixteen lanes Embree
        // 3.13 reads these too.
        to.tfar[i] = static_cast<float>(choose(valid, std::min(rays.t_max[i] - skipped_m, kLongest_m), -1));
        to.tnear[i] = 0;
        to.time[i] = 0;
        to.mask[i] = ~0u;
        to.id[i] = to.flags[i] = 0;
    }
}

NARPA_EACH_ISA std::uint32_t MeshShape::trace(const ShapeRays& rays, std::uint32_t wanted,
                                              ShapeHits& __restrict hits) const noexcept {
    EmbreeBatch batch;
    advance(rays, wanted, batch);
    if (batch.traced == 0) return 0;
    batch.clear_hits();
    embree::intersect(scene_.get(), batch.valid.data(), batch.rays, run_of(rays));
    batch.read_hits();
    const std::uint32_t inside = closed_ ? rays.inside : 0;  // an open mesh has no inside
    const std::uint32_t plain_miss = closed_ ? ~inside : 0;
    const std::uint32_t suspicious =
        ((batch.hit & (batch.back ^ inside)) | (~batch.hit & ~plain_miss)) & batch.traced;
    if (suspicious != 0) retry(rays, suspicious, inside, batch);
    if (batch.hit == 0) return 0;

    // Embree found the triangles; the hits are solved again in double.
    Corners corners;
    gather(mesh_, vertices_, batch.rays.hit.primID, batch.hit, corners);
    Lanes<int> met = masks_of(batch.hit);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Triangle triangle{corners(0, i) + vertex_origin_, corners(1, i) + vertex_origin_,
                                corners(2, i) + vertex_origin_};
        const Vec3 start = batch.start[i], d = rays.direction[i];
        const TrianglePoint p = hit_point(triangle, start, d, static_cast<double>(batch.rays.hit.u[i]),
                                          static_cast<double>(batch.rays.hit.v[i]));
        const double range = batch.skipped_m[i] + std::max(0.0, dot(p.position - start, d));
        const bool take = (met[i] != 0) & (range < rays.t_max[i]);
        met[i] = -static_cast<int>(take);
        hits.face[i] = take ? batch.rays.hit.primID[i] : hits.face[i];
        hits.range_m[i] = choose(take, range, hits.range_m[i]);
        hits.direction.put(i, choose(take, d, hits.direction[i]));
        hits.position.put(i, choose(take, p.position, hits.position[i]));
        hits.b1[i] = choose(take, p.b1, hits.b1[i]);
        hits.b2[i] = choose(take, p.b2, hits.b2[i]);
        hits.triangle.a.put(i, choose(take, triangle.a, hits.triangle.a[i]));
        hits.triangle.b.put(i, choose(take, triangle.b, hits.triangle.b[i]));
        hits.triangle.c.put(i, choose(take, triangle.c, hits.triangle.c[i]));
    }
    const std::uint32_t taken = bits_of(met);
    hits.inner = (hits.inner & ~taken) | (batch.back & inside & taken);
    return taken;
}

void MeshShape::retry(const ShapeRays& rays, std::uint32_t suspicious, std::uint32_t inside,
                      EmbreeBatch& batch) const noexcept {
    EmbreeBatch again;
    for (const double angle : kTurns) {
        again.rays.ray = batch.rays.ray;
        again.valid = masks_of(suspicious);
        again.traced = suspicious;
        for (std::size_t i = 0; i < kLanes; ++i) {
            const Vec3f d = vec_cast<float>(turned(rays.direction[i], angle));
            RTCRay16& ray = again.rays.ray;
            ray.dir_x[i] = d.x, ray.dir_y[i] = d.y, ray.dir_z[i] = d.z;
            ray.tfar[i] = is_set(suspicious, i)
                              ? static_cast<float>(std::min(rays.t_max[i] - batch.skipped_m[i], kLongest_m))
                              : -1;
        }
        again.clear_hits();
        embree::intersect(scene_.get(), again.valid.data(), again.rays, embree::Run::apart);
        again.read_hits();
        for (std::size_t i = 0; i < kLanes; ++i) {
            if (!is_set(suspicious, i)) continue;
            const bool within = is_set(inside, i);
            if (is_better(again[i], batch[i], batch.start[i], rays.direction[i], within)) batch.put(i, again[i]);
            // From outside one retry is enough: such a ray may rightly hit inner sides, as in a room.
            if (!within || (is_set(batch.hit, i) && is_set(batch.back, i))) suspicious &= ~(1u << i);
        }
        if (suspicious == 0) return;
    }
}

bool MeshShape::is_better(const EmbreeHit& turned, const EmbreeHit& than, const Vec3& start, const Vec3& direction,
                          bool inside) const noexcept {
    if (!turned.hit || (than.hit && !(turned.back == inside && turned.t < than.t))) return false;
    const Triangle t = triangle(turned.face);
    const Vec3 n = t.normal();
    return inside || dot(n, t.a - start) * dot(n, direction) >= 0;  // ahead of the original ray, too
}

NARPA_EACH_ISA std::uint32_t MeshShape::trace_shadows(const ShapeRays& rays, std::uint32_t wanted) const noexcept {
    EmbreeBatch batch;
    advance(rays, wanted, batch);
    if (batch.traced == 0) return 0;
    embree::occluded(scene_.get(), batch.valid.data(), batch.rays.ray, run_of(rays));
    Lanes<int> dark;
    for (std::size_t i = 0; i < kLanes; ++i)
        dark[i] = -static_cast<int>(batch.rays.ray.tfar[i] == embree::kOccluded);
    return bits_of(dark) & batch.traced;
}

NARPA_EACH_ISA void MeshShape::lift(const SurfacePoints& points, std::uint32_t wanted,
                                    Vec3Lanes& __restrict starts) const noexcept {
    Corners corners;
    gather(mesh_, vertices_, points.face.data(), wanted, corners);
    const Lanes<int> mine = masks_of(wanted), outer = masks_of(points.outside);
    Lanes<int> near_edge;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 p = points.departure_body[i];
        const Departure d = departure_from(
            {corners(0, i) + vertex_origin_, corners(1, i) + vertex_origin_, corners(2, i) + vertex_origin_}, p,
            p - vertex_origin_);
        starts.put(i, choose(mine[i] != 0, p + choose(outer[i] != 0, d.lift_m, -d.lift_m) * d.normal, starts[i]));
        near_edge[i] = mine[i] & -static_cast<int>(d.near_edge);
    }
    if (const std::uint32_t few = bits_of(near_edge); few != 0)
        for (std::size_t i = 0; i < kLanes; ++i)
            if (is_set(few, i)) {
                const Triangle t = triangle(points.face[i]);
                const Vec3 p = points.departure_body[i];
                const Departure d = departure_from(t, p, p - vertex_origin_);
                // A point above the face, on the smooth surface, is clear of the edges and may lie beside the face.
                if (std::abs(dot(d.normal, p - t.a)) > d.clearance_m) continue;
                starts.put(
                    i, away_from_edges(t, p, d) + (is_set(points.outside, i) ? d.lift_m : -d.lift_m) * d.normal);
            }
}

}  // namespace narpa
