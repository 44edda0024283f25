#include "renderer/trace/tracer.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

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

constexpr double kInfinity = std::numeric_limits<double>::infinity();

bool is_set(std::uint32_t bits, std::size_t i) {
    return (bits >> i & 1u) != 0;
}

/// The nearest crossing of a sphere about the origin that is not behind the ray.
std::optional<double> nearest_root(const Vec3& o, const Vec3& d, double radius_m) {
    const auto roots = sphere_roots(o, d, radius_m);
    if (!roots || roots->far < 0) return std::nullopt;
    return roots->near >= 0 ? roots->near : roots->far;
}

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
    /// Fills in what follows from where the ray, in the body's frame, met which body at which range.
    void finish(const Placement& at, const Vec3& o_body, const Vec3& d_body, const MeshHit& mesh_hit,
                Hit& hit) const noexcept;
    void finish_mesh(const Rigid3& T_world_body, const Vec3& d_body, const MeshHit& at, Hit& hit) const noexcept;
    void finish_sphere(const Rigid3& T_world_body, const Vec3& o_body, const Vec3& d_body, Hit& hit) const noexcept;
    /// Where a ray starts that leaves the hit, in the frame of its body.
    [[nodiscard]] Vec3 departure(const Placement& at, const Hit& from) const noexcept;
    [[nodiscard]] bool sphere_hides(const Placement& at, std::size_t sphere, const Hit& from,
                                    const Vec3& start_turned, const Vec3& direction, double t_max) const noexcept;
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
    hit.outside = side > 0;
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
    hit.outside = side > 0;
    if (textured[static_cast<std::size_t>(hit.material)]) {
        const auto uv = sphere_uv(outwards);
        hit.u = uv[0], hit.v = uv[1];
    }
}

void Tracer::Impl::finish(const Placement& at, const Vec3& o_body, const Vec3& d_body, const MeshHit& mesh_hit,
                          Hit& hit) const noexcept {
    const std::size_t body = static_cast<std::size_t>(hit.body);
    if (shapes[body].mesh != nullptr)
        finish_mesh(at.T_world_body[body], d_body, mesh_hit, hit);
    else
        finish_sphere(at.T_world_body[body], o_body, d_body, hit);
}

Vec3 Tracer::Impl::departure(const Placement& at, const Hit& from) const noexcept {
    const std::size_t own = static_cast<std::size_t>(from.body);
    const MeshScene* mesh = shapes[own].mesh;
    if (mesh == nullptr) return from.departure_body;
    const double lift_m = mesh->departure_offset_m(from.face, from.departure_body);
    return from.departure_body + lift_m * to_body(at.T_world_body[own].q, from.geometric_normal);
}

bool Tracer::Impl::sphere_hides(const Placement& at, std::size_t sphere, const Hit& from, const Vec3& start_turned,
                                const Vec3& direction, double t_max) const noexcept {
    const std::size_t own = static_cast<std::size_t>(from.body);
    const double radius_m = shapes[sphere].radius_m;
    if (sphere == own) {  // convex: from outside it hides what is below its horizon, from inside everything
        const double up = dot(from.geometric_normal, direction);
        const bool outside = dot(start_turned, from.geometric_normal) > 0;
        return outside ? up < 0 : 2 * radius_m * up < t_max;
    }
    const Vec3 o = start_turned + (at.T_world_body[own].t - at.T_world_body[sphere].t);
    const auto roots = sphere_roots(o, direction, radius_m);
    if (!roots) return false;
    const double t = roots->near > 0 ? roots->near : roots->far;
    return t > 0 && t < t_max;
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

Hit Tracer::intersect(const Placement& at, const Ray& ray, double t_max, int skip_body) const noexcept {
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
            if (span.exit < 0 || span.entry >= nearest || static_cast<int>(next) == skip_body) continue;
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
                const auto t = nearest_root(o, d, impl_->shapes[body].radius_m);
                if (!t || *t >= nearest) continue;
                hit.range_m = nearest = *t;
            }
            hit.body = static_cast<int>(body);
            o_hit = o, d_hit = d;
        }
    }
    if (hit.body >= 0) impl_->finish(at, o_hit, d_hit, mesh_hit, hit);
    return hit;
}

void Tracer::intersect(const Placement& at, std::span<const Ray> rays, std::span<Hit> hits) const noexcept {
    struct Entries {
        std::uint32_t body = 0;
        double nearest_m = 0;  ///< of the packet
        std::array<double, kPacket> entry_m;
    };
    const std::size_t n = std::min({rays.size(), hits.size(), kPacket});
    std::array<double, kPacket> nearest;
    nearest.fill(kInfinity);
    std::array<MeshHit, kPacket> mesh_hits;
    std::array<Vec3, kPacket> o_hit, d_hit;
    for (std::size_t i = 0; i < n; ++i) hits[i] = Hit{};

    std::array<Entries, kBatch> batch;
    std::array<std::size_t, kBatch> order;
    for (std::size_t next = 0; next < impl_->shapes.size();) {
        // As for one ray: bounds about the bodies' origins first, nearest body first.
        std::size_t m = 0;
        for (; next < impl_->shapes.size() && m < kBatch; ++next) {
            Entries& e = batch[m];
            e = {static_cast<std::uint32_t>(next), kInfinity, {}};
            for (std::size_t i = 0; i < n; ++i) {
                const Vec3 o = rays[i].origin - at.T_world_body[next].t;
                const SphereSpan span = bounding_span(o, rays[i].direction, impl_->shapes[next].bound_m);
                e.entry_m[i] = span.exit < 0 || span.entry >= nearest[i] ? kInfinity : span.entry;
                e.nearest_m = std::min(e.nearest_m, e.entry_m[i]);
            }
            if (e.nearest_m == kInfinity) continue;
            std::size_t k = m;
            for (; k > 0 && batch[order[k - 1]].nearest_m > e.nearest_m; --k) order[k] = order[k - 1];
            order[k] = m++;
        }
        for (std::size_t k = 0; k < m; ++k) {
            const Entries& e = batch[order[k]];
            const Rigid3& T = at.T_world_body[e.body];
            MeshRays local;
            std::uint32_t wanted = 0;
            for (std::size_t i = 0; i < n; ++i) {
                if (e.entry_m[i] >= nearest[i]) continue;
                local.origin[i] = to_body(T.q, rays[i].origin - T.t);
                local.direction[i] = to_body(T.q, rays[i].direction);
                local.entry_m[i] = e.entry_m[i];
                local.t_max[i] = nearest[i];
                wanted |= 1u << i;
            }
            if (wanted == 0) continue;
            std::uint32_t met = 0;
            if (const MeshScene* mesh = impl_->shapes[e.body].mesh) {
                met = mesh->intersect(local, wanted, mesh_hits);
                for (std::size_t i = 0; i < n; ++i)
                    if (is_set(met, i)) nearest[i] = mesh_hits[i].range_m;
            } else {
                for (std::size_t i = 0; i < n; ++i) {
                    if (!is_set(wanted, i)) continue;
                    const auto t =
                        nearest_root(local.origin[i], local.direction[i], impl_->shapes[e.body].radius_m);
                    if (!t || *t >= nearest[i]) continue;
                    nearest[i] = *t;
                    met |= 1u << i;
                }
            }
            for (std::size_t i = 0; i < n; ++i) {
                if (!is_set(met, i)) continue;
                hits[i].body = static_cast<int>(e.body);
                o_hit[i] = local.origin[i], d_hit[i] = local.direction[i];
            }
        }
    }
    for (std::size_t i = 0; i < n; ++i) {
        if (hits[i].body < 0) continue;
        hits[i].range_m = nearest[i];
        impl_->finish(at, o_hit[i], d_hit[i], mesh_hits[i], hits[i]);
    }
}

bool Tracer::occluded(const Placement& at, const Hit& from, const Vec3& direction, double t_max) const noexcept {
    const std::size_t own = static_cast<std::size_t>(from.body);
    const Rigid3& T_own = at.T_world_body[own];
    const Vec3 start = impl_->departure(at, from), start_turned = T_own.q * start;
    // The body that the ray leaves is the likeliest to hide the light. The start is on it, so inside its bounds.
    if (const MeshScene* mesh = impl_->shapes[own].mesh)
        if (mesh->occluded(start, to_body(T_own.q, direction), 0, t_max)) return true;
    for (std::size_t body = 0; body < impl_->shapes.size(); ++body) {
        const MeshScene* mesh = impl_->shapes[body].mesh;
        if (mesh == nullptr) {
            if (impl_->sphere_hides(at, body, from, start_turned, direction, t_max)) return true;
            continue;
        }
        if (body == own) continue;
        const Rigid3& T = at.T_world_body[body];
        const Vec3 o = start_turned + (T_own.t - T.t);
        const SphereSpan span = bounding_span(o, direction, impl_->shapes[body].bound_m);
        if (span.exit < 0 || span.entry >= t_max) continue;
        if (mesh->occluded(to_body(T.q, o), to_body(T.q, direction), span.entry, t_max)) return true;
    }
    return false;
}

std::uint32_t Tracer::occluded(const Placement& at, std::span<const Hit> from, std::span<const Vec3> directions,
                               std::uint32_t wanted) const noexcept {
    const std::size_t n = std::min({from.size(), directions.size(), kPacket});
    std::array<Vec3, kPacket> start,
        start_turned;  // in the frame of the body it leaves, and turned into the world's
    for (std::size_t i = 0; i < n; ++i) {
        if (!is_set(wanted, i)) continue;
        start[i] = impl_->departure(at, from[i]);
        start_turned[i] = at.T_world_body[static_cast<std::size_t>(from[i].body)].q * start[i];
    }
    std::uint32_t dark = 0;
    for (std::size_t body = 0; body < impl_->shapes.size(); ++body) {
        const Rigid3& T = at.T_world_body[body];
        const MeshScene* mesh = impl_->shapes[body].mesh;
        MeshRays local;
        std::uint32_t asked = 0;
        for (std::size_t i = 0; i < n; ++i) {
            if (!is_set(wanted & ~dark, i)) continue;
            const std::size_t own = static_cast<std::size_t>(from[i].body);
            if (mesh == nullptr) {
                if (impl_->sphere_hides(at, body, from[i], start_turned[i], directions[i], kInfinity))
                    dark |= 1u << i;
                continue;
            }
            if (own == body) {  // the start is on the body, so inside its bounds
                local.origin[i] = start[i];
                local.entry_m[i] = 0;
            } else {
                const Vec3 o = start_turned[i] + (at.T_world_body[own].t - T.t);
                const SphereSpan span = bounding_span(o, directions[i], impl_->shapes[body].bound_m);
                if (span.exit < 0) continue;
                local.origin[i] = to_body(T.q, o);
                local.entry_m[i] = span.entry;
            }
            local.direction[i] = to_body(T.q, directions[i]);
            local.t_max[i] = kInfinity;
            asked |= 1u << i;
        }
        if (asked != 0) dark |= mesh->occluded(local, asked);
    }
    return dark;
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
