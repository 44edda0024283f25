#include "renderer/geometry/mesh_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/geometry/mesh_topology.h"
#include "renderer/geometry/sphere_roots.h"

namespace narpa {
namespace {

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
    const double length = t_max - *skipped;
    Answer answer = ask(start, direction, length);
    if (!plausible(answer, false))
        consider(answer, ask(start, turned(direction, kTurns[0]), length), start, direction, false);
    if (!answer.hit) return false;
    const TrianglePoint point = meeting_point(triangle(answer.face), start, direction,
                                              static_cast<double>(answer.u), static_cast<double>(answer.v));
    const double range = *skipped + std::max(0.0, dot(point.position - start, direction));
    if (!(range < t_max)) return false;
    hit = {answer.face, range, point};
    return true;
}

void MeshScene::consider(Answer& answer, const Answer& again, const Vec3& start, const Vec3& direction,
                         bool inside) const noexcept {
    const bool better = again.hit && (!answer.hit || (again.back == inside && again.t < answer.t));
    if (!better) return;
    const Triangle t = triangle(again.face);
    const Vec3 n = t.normal();
    // Ahead of the ray itself, not only of the turned one.
    if (inside || dot(n, t.a - start) * dot(n, direction) >= 0) answer = again;
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
    return ray.tfar == embree::kOccluded;
}

Vec3 MeshScene::departure(std::uint32_t face, const Vec3& position, bool outside) const noexcept {
    const Triangle t = triangle(face);
    const Departure d = departure_from(t, position, position - vertex_origin_);
    const Vec3 start = d.near_edge ? away_from_edges(t, position, d) : position;
    return start + (outside ? d.lift_m : -d.lift_m) * d.normal;
}

}  // namespace narpa
