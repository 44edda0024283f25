#include "renderer/geometry/tracer.h"

#include <tbb/task_arena.h>

#include <array>
#include <cmath>

#include "renderer/geometry/tracer_impl.h"

namespace narpa {
namespace {

/// Bodies whose bounds a ray enters, nearest entry first. Fixed size: more bodies are taken a batch at a time.
constexpr std::size_t kSortedBodies = 32;
struct Candidate {
    std::uint32_t body;
    double entry_m;
};

Status check_textures(const Scene& s, const Material& m) {
    for (const int texture : {m.texture, m.emission_texture, m.normal_texture, m.height_texture})
        if (texture >= static_cast<int>(s.textures.size()))
            return Error{"material \"" + m.name + "\" names texture " + std::to_string(texture) + " of " +
                         std::to_string(s.textures.size())};
    return Ok{};
}

}  // namespace

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
        auto shape = shape_for(b);
        if (!shape) return shape.error();
        shapes.push_back(*shape);
        bounds.push_back(bounds_of(s, b));
        all_bodies.push_back(static_cast<std::uint32_t>(all_bodies.size()));
    }
    for (const Material& m : s.materials) {
        if (const Status good = check_textures(s, m); !good) return good.error();
        textured.push_back(m.texture >= 0 || m.emission_texture >= 0 || m.normal_texture >= 0 ||
                           m.height_texture >= 0);
    }
    return Ok{};
}

Result<Tracer::Impl::Shape> Tracer::Impl::shape_for(const Body& b) const {
    const auto bad = [&](const std::string& what) { return Error{"body \"" + b.name + "\"" + what}; };
    if (const int* index = std::get_if<int>(&b.shape)) {
        if (*index < 0 || static_cast<std::size_t>(*index) >= meshes.size())
            return bad(" names mesh " + std::to_string(*index) + " of " + std::to_string(meshes.size()));
        const MeshScene& mesh = meshes[static_cast<std::size_t>(*index)];
        return Shape{.mesh = &mesh, .radius_m = mesh.reach_m(), .bound_m = mesh.reach_m()};
    }
    Ellipsoid e;
    if (const Sphere* sphere = std::get_if<Sphere>(&b.shape)) {
        if (!(sphere->radius_m > 0) || !std::isfinite(sphere->radius_m))
            return bad(": the radius of a sphere is a positive length in metres");
        e = {{sphere->radius_m, sphere->radius_m, sphere->radius_m}, sphere->material};
    } else {
        e = std::get<Ellipsoid>(b.shape);
        for (int k = 0; k < 3; ++k)
            if (!(e.semi_axes_m[k] > 0) || !std::isfinite(e.semi_axes_m[k]))
                return bad(": the semi-axes of an ellipsoid are three positive lengths in metres");
    }
    if (e.material < 0 || static_cast<std::size_t>(e.material) >= scene->materials.size())
        return bad(" names material " + std::to_string(e.material) + " of " +
                   std::to_string(scene->materials.size()));
    const EllipsoidShape exact(e.semi_axes_m);
    return Shape{.exact = exact,
                 .turned = !std::holds_alternative<Sphere>(b.shape),
                 .radius_m = exact.radius_m(),
                 .bound_m = exact.radius_m() * (1 + 1e-5),
                 .material = e.material};
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

Hit Tracer::intersect(const BodyPoses& at, const Ray& ray, double t_max, int skip_body) const noexcept {
    Hit hit;
    Impl::Meeting met;
    double nearest = t_max;
    std::array<Candidate, kSortedBodies> batch;
    for (std::size_t next = 0; next < impl_->shapes.size();) {
        // Bounds about the bodies' origins first: no rotation is needed to miss them.
        std::size_t n = 0;
        for (; next < impl_->shapes.size() && n < kSortedBodies; ++next) {
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
            const Impl::Shape& shape = impl_->shapes[body];
            const Vec3 o = to_body(T.q, ray.origin - T.t), d = to_body(T.q, ray.direction);
            if (shape.mesh != nullptr) {
                if (!shape.mesh->intersect(o, d, batch[k].entry_m, nearest, met.mesh)) continue;
                nearest = met.mesh.range_m;
            } else {
                const Crossing crossing = shape.exact.first_crossing(o, d);
                if (!(crossing.range < nearest)) continue;
                nearest = crossing.range;
                met.outside = crossing.outside;
            }
            hit.body = static_cast<int>(body);
            met.origin = o, met.direction = d;
        }
    }
    if (hit.body < 0) return hit;
    hit.range_m = nearest;
    impl_->finish(at, met, hit);
    return hit;
}

bool Tracer::occluded(const BodyPoses& at, const Hit& from, const Vec3& direction, double t_max) const noexcept {
    const std::size_t own = static_cast<std::size_t>(from.body);
    const Rigid3& T_own = at.T_world_body[own];
    const Vec3 start = impl_->departure(from), start_turned = T_own.q * start;
    // The body that the ray leaves is the likeliest to hide the light. The start is on it, so inside its bounds.
    if (const MeshScene* mesh = impl_->shapes[own].mesh)
        if (mesh->occluded(start, to_body(T_own.q, direction), 0, t_max)) return true;
    for (std::size_t body = 0; body < impl_->shapes.size(); ++body) {
        const MeshScene* mesh = impl_->shapes[body].mesh;
        if (mesh == nullptr) {
            if (impl_->exact_hides(at, body, from, start, start_turned, direction, t_max)) return true;
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

bool Tracer::Impl::exact_hides(const BodyPoses& at, std::size_t body, const Hit& from, const Vec3& start,
                               const Vec3& start_turned, const Vec3& direction, double t_max) const noexcept {
    const std::size_t own = static_cast<std::size_t>(from.body);
    const Shape& shape = shapes[body];
    const Rigid3& T = at.T_world_body[body];
    const Crossing crossing =
        body == own    ? shape.exact.own_crossing(start, to_body(T.q, direction), from.outside)
        : shape.turned ? shape.exact.first_crossing(to_body(T.q, start_turned + (at.T_world_body[own].t - T.t)),
                                                    to_body(T.q, direction))
                       : shape.exact.first_crossing(start_turned + (at.T_world_body[own].t - T.t), direction);
    return crossing.range < t_max;
}

const BodyBounds& Tracer::bounds(std::size_t body) const noexcept {
    return impl_->bounds[body];
}

double Tracer::bounding_radius_m(std::size_t body) const noexcept {
    return impl_->shapes[body].radius_m;
}

std::span<const std::uint32_t> Tracer::all_bodies() const noexcept {
    return impl_->all_bodies;
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
