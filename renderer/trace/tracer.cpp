#include "renderer/trace/tracer.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "renderer/trace/mesh_scene.h"
#include "renderer/trace/sphere_roots.h"

namespace narpa {
namespace {

/// Bodies whose bounds a ray enters, nearest entry first. Fixed size: more bodies are taken a batch at a time.
constexpr std::size_t kBatch = 32;
struct Candidate {
    std::uint32_t body;
    double entry_m;
};

Vec3 to_body(const Quat& q_world_body, const Vec3& v) {
    return conjugate(q_world_body) * v;
}

/// Texture coordinates of a sphere: longitude from +x towards +y, v = 1 at +z.
std::array<float, 2> sphere_uv(const Vec3& n) {
    const double theta = std::atan2(std::hypot(n.x, n.y), n.z), phi = std::atan2(n.y, n.x);
    const double u = phi / (2 * std::numbers::pi);
    return {static_cast<float>(u < 0 ? u + 1 : u), static_cast<float>(1 - theta / std::numbers::pi)};
}

}  // namespace

struct Tracer::Impl {
    struct Shape {
        const MeshScene* mesh = nullptr;  ///< null: a sphere
        double radius_m = 0;              ///< about the body's origin: of the sphere, or of the mesh's bounds
        double bound_m = 0;               ///< a little more, so that rounding cannot cut off the limb
        int sphere_material = 0;
    };

    const Scene* scene = nullptr;
    embree::Owned<RTCDevice> device;  // outlives the scenes below
    std::vector<MeshScene> meshes;
    std::vector<Shape> shapes;   ///< one for each body
    std::vector<bool> textured;  ///< per material

    Status build(const Scene& s, int threads);
    void finish_mesh(const Rigid3& T_world_body, const Vec3& d_body, const MeshHit& at, Hit& hit) const noexcept;
    void finish_sphere(const Rigid3& T_world_body, const Vec3& o_body, const Vec3& d_body, Hit& hit) const noexcept;
};

Status Tracer::Impl::build(const Scene& s, int threads) {
    scene = &s;
    device.reset(rtcNewDevice(nullptr));
    if (!device)
        return Error{
            "Embree could not start (error " + std::to_string(static_cast<int>(rtcGetDeviceError(nullptr))) + ")",
            {},
            0,
            0,
            ErrorKind::failed};
    // Embree's own "threads" setting would bound TBB for the whole process; an arena bounds the builds alone.
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    meshes.reserve(s.meshes.size());
    for (const Mesh& m : s.meshes) {
        for (const std::uint16_t material : m.face_material)
            if (material >= s.materials.size())
                return Error{"mesh \"" + m.name + "\" names material " + std::to_string(material) + " of " +
                             std::to_string(s.materials.size())};
        auto mesh = arena.execute([&] { return MeshScene::build(device.get(), m); });
        if (!mesh) return mesh.error();
        meshes.push_back(std::move(*mesh));
    }
    for (const Body& b : s.bodies) {
        if (const int* index = std::get_if<int>(&b.shape)) {
            if (*index < 0 || static_cast<std::size_t>(*index) >= meshes.size())
                return Error{"body \"" + b.name + "\" names mesh " + std::to_string(*index) + " of " +
                             std::to_string(meshes.size())};
            const MeshScene& mesh = meshes[static_cast<std::size_t>(*index)];
            shapes.push_back({&mesh, mesh.reach_m(), mesh.reach_m(), 0});
            continue;
        }
        const Sphere& sphere = std::get<Sphere>(b.shape);
        if (!(sphere.radius_m > 0) || !std::isfinite(sphere.radius_m))
            return Error{"body \"" + b.name + "\": the radius of a sphere is a positive length in metres"};
        if (sphere.material < 0 || static_cast<std::size_t>(sphere.material) >= s.materials.size())
            return Error{"body \"" + b.name + "\" names material " + std::to_string(sphere.material) + " of " +
                         std::to_string(s.materials.size())};
        shapes.push_back({nullptr, sphere.radius_m, sphere.radius_m * (1 + 1e-5), sphere.material});
    }
    for (const Material& m : s.materials) {
        if (m.texture >= static_cast<int>(s.textures.size()))
            return Error{"material \"" + m.name + "\" names texture " + std::to_string(m.texture) + " of " +
                         std::to_string(s.textures.size())};
        textured.push_back(m.texture >= 0);
    }
    return Ok{};
}

void Tracer::Impl::finish_mesh(const Rigid3& T_world_body, const Vec3& d_body, const MeshHit& at,
                               Hit& hit) const noexcept {
    const MeshScene& shape = *shapes[static_cast<std::size_t>(hit.body)].mesh;
    const Mesh& mesh = shape.mesh();
    const auto& corner = mesh.faces[at.face];
    const std::array<Vec3, 3> v = shape.corners(at.face);
    const std::array<double, 3> weight{1 - at.b1 - at.b2, at.b1, at.b2};

    Vec3 facing = cross(v[1] - v[0], v[2] - v[0]);  // outwards, by the face's winding
    const double area2 = norm(facing);
    facing = area2 > 0 ? facing / area2 : -d_body;
    const double side = dot(facing, d_body) > 0 ? -1 : 1;
    Vec3 smooth = facing, departure = at.position;
    if (!mesh.normals.empty()) {
        // Rays leave from the surface that the normals describe, which is above the flat triangle where the mesh
        // bulges: J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II (2021), chapter 4.
        Vec3 sum{}, lift{};
        for (std::size_t k = 0; k < 3; ++k) {
            const Vec3 n = side * vec_cast<double>(mesh.normals[corner[k]]);
            sum += (side * weight[k]) * n;
            lift += (-weight[k] * std::min(0.0, dot(at.position - v[k], n))) * n;
        }
        if (dot(sum, facing) < 0) sum = -sum;
        if (const double length = norm(sum); length > 0) smooth = sum / length;
        if (dot(lift, facing) * side > 0) departure += lift;
    }
    hit.face = at.face;
    hit.position = T_world_body * at.position;
    hit.geometric_normal = T_world_body.q * (side * facing);
    hit.shading_normal = T_world_body.q * (side * smooth);
    hit.departure_body = departure;
    hit.material = mesh.face_material[at.face];
    if (!mesh.uvs.empty() && textured[static_cast<std::size_t>(hit.material)]) {
        double u = 0, w = 0;
        for (std::size_t k = 0; k < 3; ++k) {
            u += weight[k] * static_cast<double>(mesh.uvs[corner[k]][0]);
            w += weight[k] * static_cast<double>(mesh.uvs[corner[k]][1]);
        }
        hit.u = static_cast<float>(u);
        hit.v = static_cast<float>(w);
    }
}

void Tracer::Impl::finish_sphere(const Rigid3& T_world_body, const Vec3& o_body, const Vec3& d_body,
                                 Hit& hit) const noexcept {
    const Shape& shape = shapes[static_cast<std::size_t>(hit.body)];
    const Vec3 outwards = normalized(o_body + hit.range_m * d_body);
    const double side = dot(outwards, d_body) > 0 ? -1 : 1;
    hit.departure_body = shape.radius_m * outwards;
    hit.position = T_world_body * hit.departure_body;
    hit.geometric_normal = hit.shading_normal = T_world_body.q * (side * outwards);
    hit.material = shape.sphere_material;
    if (textured[static_cast<std::size_t>(hit.material)]) {
        const auto uv = sphere_uv(outwards);
        hit.u = uv[0], hit.v = uv[1];
    }
}

Result<Tracer> Tracer::create(const Scene& scene, int threads) {
    auto impl = std::make_unique<Impl>();
    if (const Status good = impl->build(scene, threads); !good) return good.error();
    return Tracer(std::move(impl));
}
Tracer::Tracer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;
Tracer::~Tracer() = default;

Hit Tracer::intersect(const Placement& at, const Ray& ray, double t_max) const noexcept {
    Hit hit;
    MeshHit mesh_hit;
    Vec3 o_hit, d_hit;  // the ray in the frame of the body it hit
    double nearest = t_max;
    std::array<Candidate, kBatch> batch;
    for (std::size_t next = 0; next < impl_->shapes.size();) {
        // Bounds about the bodies' origins first: no rotation is needed to miss them.
        std::size_t n = 0;
        for (; next < impl_->shapes.size() && n < kBatch; ++next) {
            // Differences of positions come before anything else: a common offset of the whole scene cancels.
            const Vec3 o = ray.origin - at.T_world_body[next].t;
            const SphereSpan span = bounding_span(o, ray.direction, impl_->shapes[next].bound_m);
            if (span.exit < 0 || span.entry >= nearest) continue;
            std::size_t k = n++;
            for (; k > 0 && batch[k - 1].entry_m > span.entry; --k) batch[k] = batch[k - 1];
            batch[k] = {static_cast<std::uint32_t>(next), span.entry};
        }
        for (std::size_t k = 0; k < n && batch[k].entry_m < nearest; ++k) {
            const std::uint32_t body = batch[k].body;
            const Rigid3& T = at.T_world_body[body];
            const Vec3 o = to_body(T.q, ray.origin - T.t), d = to_body(T.q, ray.direction);
            if (const MeshScene* mesh = impl_->shapes[body].mesh) {
                if (!mesh->intersect(o, d, batch[k].entry_m, nearest, mesh_hit)) continue;
                hit.range_m = nearest = mesh_hit.range_m;
            } else {
                const auto roots = sphere_roots(o, d, impl_->shapes[body].radius_m);
                const double t = !roots ? -1 : roots->near >= 0 ? roots->near : roots->far;
                if (t < 0 || t >= nearest) continue;
                hit.range_m = nearest = t;
            }
            hit.body = static_cast<int>(body);
            o_hit = o, d_hit = d;
        }
    }
    if (hit.body < 0) return hit;
    const std::size_t body = static_cast<std::size_t>(hit.body);
    if (impl_->shapes[body].mesh != nullptr)
        impl_->finish_mesh(at.T_world_body[body], d_hit, mesh_hit, hit);
    else
        impl_->finish_sphere(at.T_world_body[body], o_hit, d_hit, hit);
    return hit;
}

bool Tracer::occluded(const Placement& at, const Hit& from, const Vec3& direction, double t_max) const noexcept {
    const std::size_t own = static_cast<std::size_t>(from.body);
    const Rigid3& T_own = at.T_world_body[own];
    const MeshScene* own_mesh = impl_->shapes[own].mesh;
    Vec3 start = from.departure_body;
    if (own_mesh != nullptr) {
        start += own_mesh->departure_offset_m(from.face, start) * to_body(T_own.q, from.geometric_normal);
        // The start is on the body, so inside its bounds.
        if (own_mesh->occluded(start, to_body(T_own.q, direction), 0, t_max)) return true;
    } else {
        // A sphere is convex: from outside it hides what is below its horizon, from inside everything.
        const double up = dot(from.geometric_normal, direction);
        const bool outside = dot(T_own.q * from.departure_body, from.geometric_normal) > 0;
        if (outside ? up < 0 : 2 * impl_->shapes[own].radius_m * up < t_max) return true;
    }
    const Vec3 start_turned = T_own.q * start;
    for (std::size_t body = 0; body < impl_->shapes.size(); ++body) {
        if (body == own) continue;
        const Rigid3& T = at.T_world_body[body];
        const Vec3 o = start_turned + (T_own.t - T.t);
        const SphereSpan span = bounding_span(o, direction, impl_->shapes[body].bound_m);
        if (span.exit < 0 || span.entry >= t_max) continue;
        if (const MeshScene* mesh = impl_->shapes[body].mesh) {
            if (mesh->occluded(to_body(T.q, o), to_body(T.q, direction), span.entry, t_max)) return true;
        } else if (const auto roots = sphere_roots(o, direction, impl_->shapes[body].radius_m)) {
            const double t = roots->near > 0 ? roots->near : roots->far;
            if (t > 0 && t < t_max) return true;
        }
    }
    return false;
}

double Tracer::bounding_radius_m(std::size_t body) const noexcept {
    return impl_->shapes[body].radius_m;
}

std::size_t Tracer::triangle_count() const noexcept {
    std::size_t n = 0;
    for (const Impl::Shape& s : impl_->shapes)
        if (s.mesh != nullptr) n += s.mesh->mesh().faces.size();
    return n;
}

const Scene& Tracer::scene() const noexcept {
    return *impl_->scene;
}

}  // namespace narpa
