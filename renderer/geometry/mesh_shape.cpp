#include "renderer/geometry/mesh_shape.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "base/constants.h"
#include "renderer/scene/for_parts.h"

namespace narpa {
namespace {

Status check_mesh(const Scene& scene, const Mesh& mesh) {
    const auto bad = [&](const std::string& what) { return Error{"mesh \"" + mesh.name + "\": " + what}; };
    const std::size_t n = mesh.positions.size();
    if (!mesh.normals.empty() && mesh.normals.size() != n)
        return bad(std::to_string(mesh.normals.size()) + " normals for " + std::to_string(n) + " vertices");
    if (!mesh.uvs.empty() && mesh.uvs.size() != n)
        return bad(std::to_string(mesh.uvs.size()) + " texture coordinates for " + std::to_string(n) + " vertices");
    if (!mesh.colours.empty() && mesh.colours.size() != n)
        return bad(std::to_string(mesh.colours.size()) + " colours for " + std::to_string(n) + " vertices");
    if (mesh.face_material.size() != mesh.faces.size())
        return bad(std::to_string(mesh.face_material.size()) + " materials for " +
                   std::to_string(mesh.faces.size()) + " faces");
    for (const std::uint16_t material : mesh.face_material)
        if (material >= scene.materials.size())
            return Error{"mesh \"" + mesh.name + "\" names material " + std::to_string(material) + " of " +
                         std::to_string(scene.materials.size())};
    for (std::size_t i = 0; i < n; ++i)
        if (!is_finite(mesh.positions[i])) return bad("vertex " + std::to_string(i) + " is not finite");
    for (std::size_t i = 0; i < mesh.faces.size(); ++i)
        for (const std::uint32_t v : mesh.faces[i])
            if (v >= n)
                return bad("face " + std::to_string(i) + " names vertex " + std::to_string(v) + " of " +
                           std::to_string(n));
    return Ok{};
}

struct Extent {
    Vec3 low{kInfinity, kInfinity, kInfinity}, high = -low;

    void add(const Vec3& p) {
        for (int k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
    }
    void add(const Extent& other) { add(other.low), add(other.high); }
};

/// Calls add(part, i) for each i below n and returns the parts' sum by merge(sum, part), which does not depend on
/// order.
template <class Part>
Part over_all(std::size_t n, const auto& add, const auto& merge) {
    Part sum{};
    std::mutex merging;
    for_parts(n, [&](std::size_t begin, std::size_t end) {
        Part part{};
        for (std::size_t i = begin; i < end; ++i) add(part, i);
        const std::scoped_lock lock(merging);
        merge(sum, part);
    });
    return sum;
}
Extent extent_of(std::size_t n, const auto& add) {
    return over_all<Extent>(n, add, [](Extent& sum, const Extent& part) { sum.add(part); });
}
/// The largest of values that are not negative.
double largest_of(std::size_t n, const auto& value) {
    return over_all<double>(
        n, [&](double& most, std::size_t i) { most = std::max(most, value(i)); },
        [](double& sum, double part) { sum = std::max(sum, part); });
}

/// The smallest ellipsoid that holds all vertices, of those with the centre and the proportions of the bounding
/// box. For a box its outline is up to 2.4 times as large as the box's own. A flat mesh keeps a thousandth of its
/// largest extent in thickness.
BodyBounds ellipsoid_about(const Mesh& mesh) {
    if (mesh.faces.empty()) return {{}, {}};
    const auto vertex = [&](std::uint32_t v) { return mesh.origin_m + vec_cast<double>(mesh.positions[v]); };
    const auto [low, high] = extent_of(mesh.faces.size(), [&](Extent& part, std::size_t i) {
        for (const std::uint32_t v : mesh.faces[i]) part.add(vertex(v));
    });
    BodyBounds b{0.5 * (low + high), 0.5 * (high - low)};
    const double largest = std::max({b.semi_axes_m.x, b.semi_axes_m.y, b.semi_axes_m.z});
    for (int k = 0; k < 3; ++k) b.semi_axes_m[k] = std::max(b.semi_axes_m[k], 1e-3 * largest);
    const double farthest2 =
        largest_of(mesh.faces.size(), [&](std::size_t i) {  // at most 3, at a corner of the box
            double most = 0;
            for (const std::uint32_t v : mesh.faces[i]) {
                const Vec3 unit = (vertex(v) - b.centre_m) / b.semi_axes_m;
                most = std::max(most, dot(unit, unit));
            }
            return most;
        });
    b.semi_axes_m *= std::sqrt(farthest2) * (1 + 1e-9);
    return b;
}

}  // namespace

Result<std::shared_ptr<const MeshShape>> MeshShape::build(RTCDevice device, const Scene& scene, const Mesh& mesh) {
    if (const Status good = check_mesh(scene, mesh); !good) return good.error();
    std::shared_ptr<MeshShape> shape(new MeshShape(scene, mesh));
    if (const Status good = shape->build_hierarchy(device); !good) return good.error();
    return std::shared_ptr<const MeshShape>(std::move(shape));
}

MeshShape::MeshShape(const Scene& scene, const Mesh& mesh)
    : mesh_(mesh), closed_(!mesh.height_field && is_closed(mesh)) {
    const std::size_t n = mesh.positions.size();
    Extent extent{{}, {}};
    if (n > 0)
        extent = extent_of(n, [&](Extent& part, std::size_t i) { part.add(vec_cast<double>(mesh.positions[i])); });
    centre_ = mesh.origin_m + 0.5 * (extent.low + extent.high);
    const auto vertex = [&](std::size_t i) { return mesh.origin_m + vec_cast<double>(mesh.positions[i]); };
    radius_m_ = largest_of(n, [&](std::size_t i) { return norm(vertex(i) - centre_); });
    double reach_m = largest_of(n, [&](std::size_t i) { return norm(vertex(i)); });  // about the body's origin
    // A margin for the rounding of a ray that comes from far away.
    radius_m_ *= 1 + 1e-5;
    reach_m *= 1 + 1e-5;
    off_centre_ = reach_m > 1.25 * radius_m_;
    // A mesh modelled far from its own origin is held relative to its centre, where single precision is finer.
    // Near the origin the vertices stay bit for bit as they were read.
    if (norm(centre_) > 4 * radius_m_) vertex_origin_ = vec_cast<double>(vec_cast<float>(centre_));
    if (mesh.height_field) vertex_origin_ = mesh.origin_m;
    properties_ = {.radius_m = reach_m,
                   .bound_m = reach_m,
                   .bounds = ellipsoid_about(mesh),
                   .resolution_m = 4e-6 * reach_m,
                   .triangles = mesh.faces.size()};
    if (!mesh.uvs.empty())
        for (const Material& m : scene.materials) textured_.push_back(is_textured(m));
}

Status MeshShape::build_hierarchy(RTCDevice device) {
    const auto failed = [&](const std::string& what) {
        return Error{"mesh \"" + mesh_.name + "\": Embree " + what, {}, 0, 0, ErrorKind::failed};
    };
    scene_.reset(rtcNewScene(device));
    const embree::Owned<RTCGeometry> geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
    using Corners = std::array<std::uint32_t, 3>;
    static constexpr Corners kNoFace{};  // Embree needs an array, even where there are no faces
    const std::span<const Corners> indices = mesh_.faces.empty() ? std::span(&kNoFace, 1) : std::span(mesh_.faces);
    auto* vertices = static_cast<Vec3f*>(rtcSetNewGeometryBuffer(
        geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3f), mesh_.positions.size() + 1));
    rtcSetSharedGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, indices.data(), 0,
                               sizeof(Corners), indices.size());
    if (vertices == nullptr)
        return failed("has no memory for " + std::to_string(mesh_.faces.size()) + " triangles");
    vertices[mesh_.positions.size()] = {};  // padding: each vertex is read with four bytes behind it
    for_parts(mesh_.positions.size(), [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
            vertices[i] = vec_cast<float>(vec_cast<double>(mesh_.positions[i]) + (mesh_.origin_m - vertex_origin_));
    });
    vertices_ = vertices;

    rtcCommitGeometry(geometry.get());
    rtcAttachGeometry(scene_.get(), geometry.get());
    rtcSetSceneFlags(scene_.get(), RTC_SCENE_FLAG_ROBUST);
    rtcJoinCommitScene(scene_.get());  // on the calling thread's TBB arena
    if (const RTCError e = rtcGetDeviceError(device); e != RTC_ERROR_NONE)
        return failed("could not build its hierarchy (error " + std::to_string(static_cast<int>(e)) + ")");
    return Ok{};
}

std::span<const BoxNode> MeshShape::boxes() const {
    std::call_once(boxes_made_, [&] { boxes_ = make_boxes(); });
    return boxes_;
}

std::vector<BoxNode> MeshShape::make_boxes() const {
    if (mesh_.faces.empty()) return {BoxNode{}};
    std::vector<BoxNode> boxes = box_tree(mesh_);
    if (mesh_.origin_m == Vec3{}) return boxes;
    constexpr double kRounding = 0x1p-23;  // relative rounding error in single precision, either way
    for (BoxNode& b : boxes)
        for (std::size_t k = 0; k < 3; ++k) {
            const double origin = mesh_.origin_m[static_cast<int>(k)];
            const double low = static_cast<double>(b.low[k]) + origin,
                         high = static_cast<double>(b.high[k]) + origin;
            b.low[k] = static_cast<float>(low - kRounding * std::abs(low));
            b.high[k] = static_cast<float>(high + kRounding * std::abs(high));
        }
    return boxes;
}

}  // namespace narpa
