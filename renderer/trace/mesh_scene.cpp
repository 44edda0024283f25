#include "renderer/trace/mesh_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/trace/mesh_topology.h"
#include "renderer/trace/sphere_roots.h"

namespace narpa {
namespace {

constexpr double kHalfUlp = 0x1p-24;  ///< largest relative rounding error of single precision

double largest(const Vec3& a) {
    return std::max({std::abs(a.x), std::abs(a.y), std::abs(a.z)});
}

/// Puts one ray into a lane of sixteen.
void put_lane(const RTCRay& ray, std::size_t i, auto& lanes) {
    lanes.org_x[i] = ray.org_x, lanes.org_y[i] = ray.org_y, lanes.org_z[i] = ray.org_z;
    lanes.dir_x[i] = ray.dir_x, lanes.dir_y[i] = ray.dir_y, lanes.dir_z[i] = ray.dir_z;
    lanes.tnear[i] = ray.tnear, lanes.tfar[i] = ray.tfar;
    lanes.time[i] = ray.time, lanes.mask[i] = ray.mask, lanes.id[i] = ray.id, lanes.flags[i] = ray.flags;
}

/// A ray of no length: what a lane that asks nothing holds. Where the processor has no sixteen lanes, Embree 3.13
/// looks into these too.
constexpr RTCRay kNoRay = [] {
    RTCRay ray{};
    ray.dir_z = 1;
    ray.tfar = -1;
    return ray;
}();

bool is_set(std::uint32_t bits, std::size_t i) {
    return (bits >> i & 1u) != 0;
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
    return settle(ask(start, direction, t_max - *skipped), start, direction, *skipped, t_max, hit);
}

std::uint32_t MeshScene::intersect(const MeshRays& rays, std::uint32_t wanted,
                                   std::span<MeshHit, kPacket> hits) const noexcept {
    alignas(64) RTCRayHit16 query;
    alignas(64) std::array<int, kPacket> valid{};
    std::array<Vec3, kPacket> start;
    std::array<double, kPacket> skipped;
    std::uint32_t asked = 0;
    for (std::size_t i = 0; i < kPacket; ++i) {
        put_lane(kNoRay, i, query.ray);
        query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
        if (!is_set(wanted, i)) continue;
        const auto to_entry = advance(rays.origin[i], rays.direction[i], rays.entry_m[i], rays.t_max[i]);
        if (!to_entry) continue;
        skipped[i] = *to_entry;
        start[i] = rays.origin[i] + skipped[i] * rays.direction[i];
        put_lane(embree_ray(start[i], rays.direction[i], rays.t_max[i] - skipped[i]), i, query.ray);
        valid[i] = -1;
        asked |= 1u << i;
    }
    if (asked == 0) return 0;
    embree::intersect_coherent(scene_.get(), valid.data(), query);

    std::uint32_t hit = 0;
    for (std::size_t i = 0; i < kPacket; ++i) {
        if (!is_set(asked, i)) continue;
        Answer answer;
        if (query.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) {
            const float facing = query.hit.Ng_x[i] * query.ray.dir_x[i] + query.hit.Ng_y[i] * query.ray.dir_y[i] +
                                 query.hit.Ng_z[i] * query.ray.dir_z[i];
            answer = {query.hit.primID[i], query.ray.tfar[i], query.hit.u[i], query.hit.v[i], true, facing > 0};
        }
        if (settle(answer, start[i], rays.direction[i], skipped[i], rays.t_max[i], hits[i])) hit |= 1u << i;
    }
    return hit;
}

bool MeshScene::settle(Answer answer, const Vec3& start, const Vec3& direction, double skipped_m, double t_max,
                       MeshHit& hit) const noexcept {
    // Even in robust mode Embree loses some rays that meet a vertex (its issues 181, 188 and 387): they pass
    // through, to the inner side of the far wall where the mesh is closed, out of it where it is not. They are
    // common where a camera's pixels line up with a model's grid. One more try, turned by a few roundings, finds
    // what they lost.
    const bool suspicious = answer.hit ? answer.back : !closed_;
    if (suspicious) {
        const Vec3 turn{direction.y - direction.z, direction.z - direction.x, direction.x - direction.y + 0.5};
        const Answer again = ask(start, direction + 4e-7 * turn, t_max - skipped_m);
        if (again.hit && (!answer.hit || (!again.back && again.t < answer.t))) answer = again;
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
    hit = {answer.face, range, position, b1, b2};
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
    return ray.tfar < 0;
}

std::uint32_t MeshScene::occluded(const MeshRays& rays, std::uint32_t wanted) const noexcept {
    alignas(64) RTCRay16 query;
    alignas(64) std::array<int, kPacket> valid{};
    std::uint32_t asked = 0;
    for (std::size_t i = 0; i < kPacket; ++i) {
        put_lane(kNoRay, i, query);
        if (!is_set(wanted, i)) continue;
        const auto skipped = advance(rays.origin[i], rays.direction[i], rays.entry_m[i], rays.t_max[i]);
        if (!skipped) continue;
        put_lane(
            embree_ray(rays.origin[i] + *skipped * rays.direction[i], rays.direction[i], rays.t_max[i] - *skipped),
            i, query);
        valid[i] = -1;
        asked |= 1u << i;
    }
    if (asked == 0) return 0;
    embree::occluded(scene_.get(), valid.data(), query);
    std::uint32_t dark = 0;
    for (std::size_t i = 0; i < kPacket; ++i)
        if (is_set(asked, i) && query.tfar[i] < 0) dark |= 1u << i;
    return dark;
}

double MeshScene::departure_offset_m(std::uint32_t face, const Vec3& position) const noexcept {
    // The start is rounded to single precision (an error of the position's size); Embree's test then rounds the
    // corners relative to it and their cross products (errors of the triangle's size). First-order bounds after
    // Pharr, Jakob, Humphreys, Physically Based Rendering, section 3.9.
    double extent = 0;
    for (const Vec3& c : corners(face)) extent = std::max(extent, largest(c - position));
    return kHalfUlp * (4 * largest(position - vertex_origin_) + 16 * extent);
}

std::array<Vec3, 3> MeshScene::corners(std::uint32_t face) const noexcept {
    const auto& f = mesh_->faces[face];
    return {vec_cast<double>(vertices_[f[0]]) + vertex_origin_, vec_cast<double>(vertices_[f[1]]) + vertex_origin_,
            vec_cast<double>(vertices_[f[2]]) + vertex_origin_};
}

}  // namespace narpa
