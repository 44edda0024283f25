#include "renderer/trace/mesh_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/trace/mesh_topology.h"
#include "renderer/trace/sphere_roots.h"

namespace narpa {
namespace {

constexpr double kHalfUlp = 0x1p-24;  ///< largest relative rounding error of single precision
constexpr float kOccluded = -std::numeric_limits<float>::infinity();  ///< Embree's mark, in a ray's tfar

double largest(const Vec3& a) {
    return std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)});
}

/// A point of a triangle with this normal, moved towards the middle of the circle that touches its edges until it
/// is `clearance_m` away from each, by at most `most_m`.
Vec3 away_from_edges(const std::array<Vec3, 3>& v, const Vec3& n, const Vec3& p, double clearance_m,
                     double most_m) {
    const std::array<Vec3, 3> edge{v[1] - v[0], v[2] - v[1], v[0] - v[2]};
    const std::array<double, 3> length{norm(edge[0]), norm(edge[1]), norm(edge[2])};
    std::array<double, 3> height;
    for (std::size_t k = 0; k < 3; ++k) height[k] = dot(cross(n, edge[k]), p - v[k]) / length[k];
    if (std::min({height[0], height[1], height[2]}) >= clearance_m) return p;

    const double perimeter = length[0] + length[1] + length[2];
    const Vec3 middle = (length[1] * v[0] + length[2] * v[1] + length[0] * v[2]) / perimeter;
    const double radius = dot(cross(n, edge[0]), middle - v[0]) / length[0];
    double part = 0;
    for (const double h : height)
        if (h < clearance_m) part = std::max(part, (clearance_m - h) / std::max(radius - h, clearance_m));
    const Vec3 way = middle - p;
    return p + std::min(part, most_m / norm(way)) * way;
}

Status check_mesh(const Mesh& mesh) {
    const auto bad = [&](const std::string& what) { return Error{"mesh \"" + mesh.name + "\": " + what}; };
    const std::size_t n = mesh.positions.size();
    if (!mesh.normals.empty() && mesh.normals.size() != n)
        return bad(std::to_string(mesh.normals.size()) + " normals for " + std::to_string(n) + " vertices");
    if (!mesh.uvs.empty() && mesh.uvs.size() != n)
        return bad(std::to_string(mesh.uvs.size()) + " texture coordinates for " + std::to_string(n) + " vertices");
    if (mesh.face_material.size() != mesh.faces.size())
        return bad(std::to_string(mesh.face_material.size()) + " materials for " +
                   std::to_string(mesh.faces.size()) + " faces");
    for (std::size_t i = 0; i < n; ++i)
        if (!is_finite(mesh.positions[i])) return bad("vertex " + std::to_string(i) + " is not finite");
    for (std::size_t i = 0; i < mesh.faces.size(); ++i)
        for (const std::uint32_t v : mesh.faces[i])
            if (v >= n)
                return bad("face " + std::to_string(i) + " names vertex " + std::to_string(v) + " of " +
                           std::to_string(n));
    return Ok{};
}

}  // namespace

Result<MeshScene> MeshScene::build(RTCDevice device, const Mesh& mesh) {
    if (const Status good = check_mesh(mesh); !good) return good.error();
    MeshScene s;
    s.mesh_ = &mesh;

    Vec3 low{}, high{};
    if (!mesh.positions.empty()) low = high = vec_cast<double>(mesh.positions.front());
    for (const Vec3f& p : mesh.positions)
        for (int k = 0; k < 3; ++k) {
            low[k] = std::min<double>(low[k], p[k]);
            high[k] = std::max<double>(high[k], p[k]);
        }
    s.centre_ = 0.5 * (low + high);
    for (const Vec3f& p : mesh.positions) {
        s.radius_m_ = std::max(s.radius_m_, norm(vec_cast<double>(p) - s.centre_));
        s.reach_m_ = std::max(s.reach_m_, norm(vec_cast<double>(p)));
    }
    // Room for the rounding of a ray that comes from far away.
    s.radius_m_ *= 1 + 1e-5;
    s.reach_m_ *= 1 + 1e-5;
    s.off_centre_ = s.reach_m_ > 1.25 * s.radius_m_;
    s.closed_ = is_closed(mesh);
    // A mesh modelled far from its own origin is held relative to its centre, where single precision is finer.
    // Near the origin the vertices stay bit for bit as they were read.
    if (norm(s.centre_) > 4 * s.radius_m_) s.vertex_origin_ = vec_cast<double>(vec_cast<float>(s.centre_));

    s.scene_.reset(rtcNewScene(device));
    const embree::Owned<RTCGeometry> geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
    auto* vertices = static_cast<Vec3f*>(rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0,
                                                                 RTC_FORMAT_FLOAT3, sizeof(Vec3f),
                                                                 std::max<std::size_t>(1, mesh.positions.size())));
    auto* indices = static_cast<std::array<std::uint32_t, 3>*>(
        rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                3 * sizeof(std::uint32_t), std::max<std::size_t>(1, mesh.faces.size())));
    if (vertices == nullptr || indices == nullptr)
        return Error{"mesh \"" + mesh.name + "\": Embree has no memory for " + std::to_string(mesh.faces.size()) +
                         " triangles",
                     {},
                     0,
                     0,
                     ErrorKind::failed};
    vertices[0] = {};
    indices[0] = {0, 0, 0};
    for (std::size_t i = 0; i < mesh.positions.size(); ++i)
        vertices[i] = vec_cast<float>(vec_cast<double>(mesh.positions[i]) - s.vertex_origin_);
    std::copy(mesh.faces.begin(), mesh.faces.end(), indices);
    s.vertices_ = vertices;

    rtcCommitGeometry(geometry.get());
    rtcAttachGeometry(s.scene_.get(), geometry.get());
    rtcSetSceneFlags(s.scene_.get(), RTC_SCENE_FLAG_ROBUST);
    rtcJoinCommitScene(s.scene_.get());  // on the calling thread's TBB arena
    if (const RTCError e = rtcGetDeviceError(device); e != RTC_ERROR_NONE)
        return Error{"mesh \"" + mesh.name + "\": Embree could not build its hierarchy (error " +
                         std::to_string(static_cast<int>(e)) + ")",
                     {},
                     0,
                     0,
                     ErrorKind::failed};
    return s;
}

std::optional<double> MeshScene::advance(const Vec3& origin, const Vec3& direction, double entry_m,
                                         double t_max) const noexcept {
    if (off_centre_) {
        const SphereSpan span = bounding_span(origin - centre_, direction, radius_m_);
        if (span.exit < 0 || span.entry >= t_max) return std::nullopt;
        entry_m = span.entry;
    }
    return std::max(0.0, entry_m);
}

RTCRay MeshScene::embree_ray(const Vec3& origin, const Vec3& direction, double length) const noexcept {
    const Vec3f o = vec_cast<float>(origin - vertex_origin_), d = vec_cast<float>(direction);
    RTCRay ray;
    ray.org_x = o.x, ray.org_y = o.y, ray.org_z = o.z;
    ray.dir_x = d.x, ray.dir_y = d.y, ray.dir_z = d.z;
    ray.tnear = 0;
    ray.tfar = static_cast<float>(std::min<double>(length, std::numeric_limits<float>::max()));
    ray.time = 0;
    ray.mask = ~0u;
    ray.id = 0;
    ray.flags = 0;
    return ray;
}

bool MeshScene::intersect(const Vec3& origin, const Vec3& direction, double entry_m, double t_max,
                          MeshHit& hit) const noexcept {
    const auto skipped = advance(origin, direction, entry_m, t_max);
    if (!skipped) return false;
    const Vec3 start = origin + *skipped * direction;
    return settle(ask(start, direction, t_max - *skipped), start, direction, *skipped, t_max, false, hit);
}

MeshScene::Starts MeshScene::advance(const MeshRays& rays, std::uint32_t wanted, RTCRay16& query) const noexcept {
    const VecPerRay &o = rays.origin, &d = rays.direction;
    Lanes<double> entry_m = off_centre_ ? bounding_entries(o - centre_, d, radius_m_) : rays.entry_m;
    Starts s;
    Lanes<double> length;
    for (std::size_t i = 0; i < kPacket; ++i) {
        const bool ask = is_set(wanted, i) && entry_m[i] < rays.t_max[i];
        s.valid[i] = -static_cast<int>(ask);
        s.skipped_m[i] = ask ? std::max(0.0, entry_m[i]) : 0;
        // A lane that asks nothing holds a ray of no length: where the processor has no sixteen lanes, Embree 3.13
        // looks into these too.
        length[i] = ask ? std::min<double>(rays.t_max[i] - s.skipped_m[i], std::numeric_limits<float>::max()) : -1;
        s.asked |= static_cast<std::uint32_t>(ask) << i;
    }
    for (std::size_t i = 0; i < kPacket; ++i) s.at.x[i] = o.x[i] + s.skipped_m[i] * d.x[i];
    for (std::size_t i = 0; i < kPacket; ++i) s.at.y[i] = o.y[i] + s.skipped_m[i] * d.y[i];
    for (std::size_t i = 0; i < kPacket; ++i) s.at.z[i] = o.z[i] + s.skipped_m[i] * d.z[i];
    const auto put = [](const Lanes<double>& from, double minus, float* to) {
        for (std::size_t i = 0; i < kPacket; ++i) to[i] = static_cast<float>(from[i] - minus);
    };
    put(s.at.x, vertex_origin_.x, query.org_x);
    put(s.at.y, vertex_origin_.y, query.org_y);
    put(s.at.z, vertex_origin_.z, query.org_z);
    put(d.x, 0, query.dir_x);
    put(d.y, 0, query.dir_y);
    put(d.z, 0, query.dir_z);
    put(length, 0, query.tfar);
    std::fill_n(query.tnear, kPacket, 0.0f);
    std::fill_n(query.time, kPacket, 0.0f);
    std::fill_n(query.mask, kPacket, ~0u);
    std::fill_n(query.id, kPacket, 0u);
    std::fill_n(query.flags, kPacket, 0u);
    return s;
}

std::uint32_t MeshScene::intersect(const MeshRays& rays, std::uint32_t wanted, embree::Run run,
                                   std::span<MeshHit, kPacket> hits) const noexcept {
    alignas(64) RTCRayHit16 query;
    const Starts start = advance(rays, wanted, query.ray);
    if (start.asked == 0) return 0;
    std::fill_n(query.hit.geomID, kPacket, RTC_INVALID_GEOMETRY_ID);
    std::fill_n(query.hit.instID[0], kPacket, RTC_INVALID_GEOMETRY_ID);
    embree::intersect(scene_.get(), start.valid.data(), query, run);

    std::uint32_t hit = 0;
    for (std::size_t i = 0; i < kPacket; ++i) {
        if (!is_set(start.asked, i)) continue;
        const bool inside = closed_ && is_set(rays.inside, i);  // an open mesh has no inside
        Answer answer;
        if (query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
            const float facing = query.hit.Ng_x[i] * query.ray.dir_x[i] + query.hit.Ng_y[i] * query.ray.dir_y[i] +
                                 query.hit.Ng_z[i] * query.ray.dir_z[i];
            answer = {query.hit.primID[i], query.ray.tfar[i], query.hit.u[i], query.hit.v[i], true, facing > 0};
        } else if (closed_ && !inside) {
            continue;  // nothing to settle
        }
        if (settle(answer, start.at[i], rays.direction[i], start.skipped_m[i], rays.t_max[i], inside, hits[i]))
            hit |= 1u << i;
    }
    return hit;
}

bool MeshScene::settle(Answer answer, const Vec3& start, const Vec3& direction, double skipped_m, double t_max,
                       bool inside, MeshHit& hit) const noexcept {
    // Even in robust mode Embree loses some rays that meet a vertex (its issues 181, 188 and 387): they pass
    // through, and where the mesh is closed what they meet next shows them its wrong side, or from inside nothing.
    // They are common where a camera's pixels line up with a model's grid. Another try, turned by a few roundings,
    // finds what they lost; one that leaves the inner side close to an edge and runs along it needs to be turned by
    // more.
    const auto ahead = [&](std::uint32_t face) {  // of the ray itself, not only of the turned one
        const auto [v0, v1, v2] = corners(face);
        const Vec3 n = cross(v1 - v0, v2 - v0);
        return dot(n, v0 - start) * dot(n, direction) >= 0;
    };
    const auto plausible = [&] { return answer.hit ? answer.back == inside : closed_ && !inside; };
    for (const double angle : {4e-7, -4e-7, 4e-3, -4e-3}) {
        if (plausible()) break;
        const Vec3 turn{direction.y - direction.z, direction.z - direction.x, direction.x - direction.y + 0.5};
        const Answer again = ask(start, direction + angle * turn, t_max - skipped_m);
        const bool better = again.hit && (!answer.hit || (again.back == inside && again.t < answer.t));
        if (better && (inside || ahead(again.face))) answer = again;
        if (!inside) break;  // one will do: a ray from elsewhere may well see inner sides, as in a room
    }
    if (!answer.hit) return false;

    // Embree found the triangle; where the ray meets it is solved again in double (Moller and Trumbore 1997), kept
    // inside the triangle so that a hit on an edge stays on the surface.
    const auto [v0, v1, v2] = corners(answer.face);
    const Vec3 e1 = v1 - v0, e2 = v2 - v0;
    const Vec3 p = cross(direction, e2), s = start - v0, q = cross(s, e1);
    const double inverse_det = 1 / dot(e1, p);
    double b1 = dot(s, p) * inverse_det, b2 = dot(direction, q) * inverse_det;
    if (!std::isfinite(b1) || !std::isfinite(b2)) b1 = answer.u, b2 = answer.v;
    b1 = std::clamp(b1, 0.0, 1.0);
    b2 = std::clamp(b2, 0.0, 1.0);
    if (const double sum = b1 + b2; sum > 1) b1 /= sum, b2 /= sum;

    const Vec3 position = v0 + b1 * e1 + b2 * e2;
    const double range = skipped_m + std::max(0.0, dot(position - start, direction));
    if (!(range < t_max)) return false;
    hit = {answer.face, range, position, b1, b2, inside && answer.back};
    return true;
}

MeshScene::Answer MeshScene::ask(const Vec3& start, const Vec3& direction, double length) const noexcept {
    RTCRayHit query;
    query.ray = embree_ray(start, direction, length);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    embree::intersect(scene_.get(), query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return {};
    const float facing =
        query.hit.Ng_x * query.ray.dir_x + query.hit.Ng_y * query.ray.dir_y + query.hit.Ng_z * query.ray.dir_z;
    return {query.hit.primID, query.ray.tfar, query.hit.u, query.hit.v, true, facing > 0};
}

bool MeshScene::occluded(const Vec3& origin, const Vec3& direction, double entry_m, double t_max) const noexcept {
    const auto skipped = advance(origin, direction, entry_m, t_max);
    if (!skipped) return false;
    RTCRay ray = embree_ray(origin + *skipped * direction, direction, t_max - *skipped);
    embree::occluded(scene_.get(), ray);
    return ray.tfar == kOccluded;
}

std::uint32_t MeshScene::occluded(const MeshRays& rays, std::uint32_t wanted) const noexcept {
    alignas(64) RTCRay16 query;
    const Starts start = advance(rays, wanted, query);
    if (start.asked == 0) return 0;
    embree::occluded(scene_.get(), start.valid.data(), query);
    std::uint32_t dark = 0;
    for (std::size_t i = 0; i < kPacket; ++i)
        if (is_set(start.asked, i) && query.tfar[i] == kOccluded) dark |= 1u << i;
    return dark;
}

Vec3 MeshScene::departure(std::uint32_t face, const Vec3& position, bool outside) const noexcept {
    const std::array<Vec3, 3> v = corners(face);
    const std::array<Vec3, 3> to{v[0] - position, v[1] - position, v[2] - position};
    // Twice the areas of the three triangles that the position makes with the edges; their sum is the face's.
    const std::array<Vec3, 3> part{cross(to[0], to[1]), cross(to[1], to[2]), cross(to[2], to[0])};
    const Vec3 outwards = part[0] + part[1] + part[2];
    const double area2 = norm(outwards);
    if (!(area2 > 0)) return position;
    const Vec3 n = outwards / area2;

    // The start is rounded to single precision (an error of the position's size); Embree's test then rounds the
    // corners relative to it and their cross products (errors of the triangle's size). First-order bounds after
    // Pharr, Jakob, Humphreys, Physically Based Rendering, section 3.9.
    const double extent = std::max({largest(to[0]), largest(to[1]), largest(to[2])});
    const double lift_m = kHalfUlp * (4 * largest(position - vertex_origin_) + 16 * extent);
    const double clearance_m = 8 * lift_m, longest_m = 2 * std::sqrt(3.0) * extent;

    const double nearest = std::min({dot(n, part[0]), dot(n, part[1]), dot(n, part[2])});  // times an edge's length
    const Vec3 start = nearest > clearance_m * longest_m
                           ? position
                           : away_from_edges(v, n, position, clearance_m, 8 * clearance_m);
    return start + (outside ? lift_m : -lift_m) * n;
}

std::array<Vec3, 3> MeshScene::corners(std::uint32_t face) const noexcept {
    const auto& f = mesh_->faces[face];
    return {vec_cast<double>(vertices_[f[0]]) + vertex_origin_, vec_cast<double>(vertices_[f[1]]) + vertex_origin_,
            vec_cast<double>(vertices_[f[2]]) + vertex_origin_};
}

}  // namespace narpa
