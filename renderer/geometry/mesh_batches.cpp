// A mesh asked with sixteen rays at a time.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/each_isa.h"
#include "renderer/geometry/mesh_scene.h"
#include "renderer/geometry/sphere_roots.h"

namespace narpa {
namespace {

constexpr double kLongest_m = std::numeric_limits<float>::max();

/// The corners of faces, as the hierarchy holds them.
struct alignas(64) Corners {
    std::array<Lanes<float>, 9> at;

    [[nodiscard]] Vec3 operator()(std::size_t k, std::size_t i) const {
        return {static_cast<double>(at[3 * k][i]), static_cast<double>(at[3 * k + 1][i]),
                static_cast<double>(at[3 * k + 2][i])};
    }
};

/// By plain loads, and apart from the loops around it lest the compiler choose the processor's own gathers, which
/// are slower.
[[gnu::noinline]] void gather(const Mesh& mesh, const Vec3f* vertices, const std::uint32_t* face,
                              std::uint32_t wanted, Corners& out) noexcept {
    for (std::size_t i = 0; i < kLanes; ++i) {
        const auto& f = mesh.faces[is_set(wanted, i) ? face[i] : 0];
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3f& p = vertices[f[k]];
            out.at[3 * k][i] = p.x, out.at[3 * k + 1][i] = p.y, out.at[3 * k + 2][i] = p.z;
        }
    }
}

}  // namespace

inline void MeshScene::Query::clear_hits() noexcept {
    std::fill_n(rays.hit.geomID, kLanes, RTC_INVALID_GEOMETRY_ID);
    std::fill_n(rays.hit.instID[0], kLanes, RTC_INVALID_GEOMETRY_ID);
}

inline void MeshScene::Query::read_hits() noexcept {
    Lanes<int> hits, backs;
    const auto& h = rays.hit;
    const auto& r = rays.ray;
    for (std::size_t i = 0; i < kLanes; ++i) {
        hits[i] = -static_cast<int>(h.geomID[i] != RTC_INVALID_GEOMETRY_ID);
        const float facing = h.Ng_x[i] * r.dir_x[i] + h.Ng_y[i] * r.dir_y[i] + h.Ng_z[i] * r.dir_z[i];
        backs[i] = -static_cast<int>(facing > 0);
    }
    hit = bits_of(hits) & asked;
    back = bits_of(backs) & hit;
}

inline MeshScene::Answer MeshScene::Query::operator[](std::size_t i) const noexcept {
    return {rays.hit.primID[i], rays.ray.tfar[i], rays.hit.u[i], rays.hit.v[i], is_set(hit, i), is_set(back, i)};
}

inline void MeshScene::Query::put(std::size_t i, const Answer& answer) noexcept {
    rays.hit.primID[i] = answer.face;
    rays.ray.tfar[i] = answer.t;
    rays.hit.u[i] = answer.u, rays.hit.v[i] = answer.v;
    hit = (hit & ~(1u << i)) | static_cast<std::uint32_t>(answer.hit) << i;
    back = (back & ~(1u << i)) | static_cast<std::uint32_t>(answer.back) << i;
}

/// Where Embree takes over: at the entry, or at the entry of the tighter sphere about the mesh's own centre where
/// that is worth while.
inline void MeshScene::advance(const MeshRays& rays, std::uint32_t wanted, Query& q) const noexcept {
    Lanes<double> entry_m = rays.entry_m;
    if (off_centre_)
        for (std::size_t i = 0; i < kLanes; ++i)
            entry_m[i] = bounding_entry(rays.origin[i] - centre_, rays.direction[i], radius_m_);
    q.valid = masks_of(wanted);
    for (std::size_t i = 0; i < kLanes; ++i) q.valid[i] &= -static_cast<int>(entry_m[i] < rays.t_max[i]);
    q.asked = bits_of(q.valid);
    RTCRay16& to = q.rays.ray;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool ask = q.valid[i] != 0;
        const double skipped_m = choose(ask, std::max(0.0, entry_m[i]), 0);
        const Vec3 d = rays.direction[i], at = rays.origin[i] + skipped_m * d, from = at - vertex_origin_;
        q.skipped_m[i] = skipped_m;
        q.start.put(i, at);
        to.org_x[i] = static_cast<float>(from.x);
        to.org_y[i] = static_cast<float>(from.y);
        to.org_z[i] = static_cast<float>(from.z);
        to.dir_x[i] = static_cast<float>(d.x);
        to.dir_y[i] = static_cast<float>(d.y);
        to.dir_z[i] = static_cast<float>(d.z);
        // A lane that asks nothing holds a ray of no length: where the processor has no sixteen lanes, Embree 3.13
        // looks into these too.
        to.tfar[i] = static_cast<float>(choose(ask, std::min(rays.t_max[i] - skipped_m, kLongest_m), -1));
        to.tnear[i] = 0;
        to.time[i] = 0;
        to.mask[i] = ~0u;
        to.id[i] = to.flags[i] = 0;
    }
}

NARPA_EACH_ISA std::uint32_t MeshScene::intersect(const MeshRays& rays, std::uint32_t wanted, embree::Run run,
                                                  MeshHits& __restrict hits) const noexcept {
    Query query;
    advance(rays, wanted, query);
    if (query.asked == 0) return 0;
    query.clear_hits();
    embree::intersect(scene_.get(), query.valid.data(), query.rays, run);
    query.read_hits();
    const std::uint32_t inside = closed_ ? rays.inside : 0;  // an open mesh has no inside
    const std::uint32_t plain_miss = closed_ ? ~inside : 0;
    const std::uint32_t suspicious =
        ((query.hit & (query.back ^ inside)) | (~query.hit & ~plain_miss)) & query.asked;
    if (suspicious != 0) ask_again(rays, suspicious, inside, query);
    if (query.hit == 0) return 0;

    // Embree found the triangles; where the rays meet them is solved again in double.
    Corners corners;
    gather(*mesh_, vertices_, query.rays.hit.primID, query.hit, corners);
    Lanes<int> met = masks_of(query.hit);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Triangle triangle{corners(0, i) + vertex_origin_, corners(1, i) + vertex_origin_,
                                corners(2, i) + vertex_origin_};
        const Vec3 start = query.start[i], d = rays.direction[i];
        const TrianglePoint p = meeting_point(triangle, start, d, static_cast<double>(query.rays.hit.u[i]),
                                              static_cast<double>(query.rays.hit.v[i]));
        const double range = query.skipped_m[i] + std::max(0.0, dot(p.position - start, d));
        const bool take = (met[i] != 0) & (range < rays.t_max[i]);
        met[i] = -static_cast<int>(take);
        hits.face[i] = take ? query.rays.hit.primID[i] : hits.face[i];
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
    hits.inner = (hits.inner & ~taken) | (query.back & inside & taken);
    return taken;
}

void MeshScene::ask_again(const MeshRays& rays, std::uint32_t suspicious, std::uint32_t inside,
                          Query& query) const noexcept {
    Query again;
    for (const double angle : kTurns) {
        again.rays.ray = query.rays.ray;
        again.valid = masks_of(suspicious);
        again.asked = suspicious;
        for (std::size_t i = 0; i < kLanes; ++i) {
            const Vec3f d = vec_cast<float>(turned(rays.direction[i], angle));
            RTCRay16& ray = again.rays.ray;
            ray.dir_x[i] = d.x, ray.dir_y[i] = d.y, ray.dir_z[i] = d.z;
            ray.tfar[i] = is_set(suspicious, i)
                              ? static_cast<float>(std::min(rays.t_max[i] - query.skipped_m[i], kLongest_m))
                              : -1;
        }
        again.clear_hits();
        embree::intersect(scene_.get(), again.valid.data(), again.rays, embree::Run::apart);
        again.read_hits();
        for (std::size_t i = 0; i < kLanes; ++i) {
            if (!is_set(suspicious, i)) continue;
            const bool within = is_set(inside, i);
            Answer answer = query[i];
            consider(answer, again[i], query.start[i], rays.direction[i], within);
            query.put(i, answer);
            // One will do from elsewhere, from where a ray may well see inner sides, as in a room.
            if (!within || plausible(answer, within)) suspicious &= ~(1u << i);
        }
        if (suspicious == 0) return;
    }
}

NARPA_EACH_ISA std::uint32_t MeshScene::occluded(const MeshRays& rays, std::uint32_t wanted,
                                                 embree::Run run) const noexcept {
    Query query;
    advance(rays, wanted, query);
    if (query.asked == 0) return 0;
    embree::occluded(scene_.get(), query.valid.data(), query.rays.ray, run);
    Lanes<int> dark;
    for (std::size_t i = 0; i < kLanes; ++i)
        dark[i] = -static_cast<int>(query.rays.ray.tfar[i] == embree::kOccluded);
    return bits_of(dark) & query.asked;
}

NARPA_EACH_ISA void MeshScene::depart(const Lanes<std::uint32_t>& face, const Vec3Lanes& position,
                                      std::uint32_t outside, std::uint32_t wanted,
                                      Vec3Lanes& __restrict starts) const noexcept {
    Corners corners;
    gather(*mesh_, vertices_, face.data(), wanted, corners);
    const Lanes<int> mine = masks_of(wanted), outer = masks_of(outside);
    Lanes<int> near_edge;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 p = position[i];
        const Departure d = departure_from(
            {corners(0, i) + vertex_origin_, corners(1, i) + vertex_origin_, corners(2, i) + vertex_origin_}, p,
            p - vertex_origin_);
        starts.put(i, choose(mine[i] != 0, p + choose(outer[i] != 0, d.lift_m, -d.lift_m) * d.normal, starts[i]));
        near_edge[i] = mine[i] & -static_cast<int>(d.near_edge);
    }
    if (const std::uint32_t few = bits_of(near_edge); few != 0)
        for (std::size_t i = 0; i < kLanes; ++i)
            if (is_set(few, i)) starts.put(i, departure(face[i], position[i], is_set(outside, i)));
}

}  // namespace narpa
