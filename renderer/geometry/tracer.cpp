#include "renderer/geometry/tracer.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "renderer/geometry/tracer_impl.h"

namespace narpa {
namespace {

/// Of a position, relative: bound of its rounding error on the way between two others.
constexpr double kMovingMargin = 1e-15;

Status check_textures(const Scene& s, const Material& m) {
    for (const int texture :
         {m.texture, m.emission_texture, m.specular_texture, m.cloud_texture, m.normal_texture, m.height_texture})
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
    auto made = make_shapes(s, device.get(), threads);
    if (!made) return made.error();
    shapes = *std::move(made);
    all_bodies.resize(shapes.size());
    std::iota(all_bodies.begin(), all_bodies.end(), 0u);
    largest_bodies = all_bodies;
    if (shapes.size() > BodyTree::kFewBodies) {
        const auto minus_radius_m = [&](std::uint32_t body) { return -shapes[body]->properties().radius_m; };
        std::ranges::stable_sort(largest_bodies, {}, minus_radius_m);
        largest_bodies.resize(BodyTree::kFewBodies);
        std::ranges::sort(largest_bodies);
    }
    for (const Material& m : s.materials)
        if (const Status good = check_textures(s, m); !good) return good.error();
    return Ok{};
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
    RayBatch rays;
    rays.n = 1;
    rays.put(0, ray);
    HitBatch hits;
    Hit nearest;
    const auto try_bodies = [&](std::span<const std::uint32_t> bodies) {
        intersect(at, rays, bodies, hits);
        if (hits.met != 0 && hits.range_m[0] < t_max) nearest = hits[0], t_max = nearest.range_m;
    };
    if (skip_body >= 0 && impl_->in_tree(at)) {
        const Hit hit = impl_->intersect_others(at, ray, static_cast<std::uint32_t>(skip_body));
        return hit.body >= 0 && hit.range_m < t_max ? hit : Hit{};
    }
    const std::size_t skip = skip_body < 0 ? all_bodies().size() : static_cast<std::size_t>(skip_body);
    try_bodies(all_bodies().first(skip));
    if (skip < all_bodies().size()) try_bodies(all_bodies().subspan(skip + 1));
    return nearest;
}

bool Tracer::occluded(const BodyPoses& at, const Hit& from, const Vec3& direction, double t_max) const noexcept {
    SurfacePoints points;
    points.put(0, from);
    Vec3Lanes directions;
    directions.fill(direction);
    Lanes<double> ends;
    ends.fill(t_max);
    return occluded(at, points, directions, ends, 1u) != 0;
}

void Tracer::arrange(BodyPoses& at) const noexcept {
    const std::span<BodyTree::Sphere> spheres = at.tree().spheres();
    for (std::size_t body = 0; body < spheres.size(); ++body) {
        const auto& [radius_m, bound_m] = std::pair(bounding_radius_m(body), shape(body).properties().bound_m);
        const Vec3 start = at.position_at(body, 0), end = at.position_at(body, 1);
        const double rounding_m = at.moves(body) ? kMovingMargin * (norm(start) + norm(end)) : 0;
        spheres[body] = {start + 0.5 * (end - start),
                         std::max(radius_m, bound_m) + 0.5 * norm(end - start) + rounding_m};
    }
    at.tree().build(impl_.get());
}

const BodyTree* Tracer::tree(const BodyPoses& at) const noexcept {
    return impl_->in_tree(at) ? &at.tree() : nullptr;
}

TextureFrame Tracer::texture_frame(const BodyPoses& at, const Hit& hit) const noexcept {
    const auto body = static_cast<std::size_t>(hit.body);
    const auto [du, dv] = shape(body).texture_frame(hit);
    const Quat q = at.T_world_body_at(body, hit.time).q;
    return {q * du, q * dv};
}

Rgb Tracer::vertex_colour(const BodyPoses& at, const Hit& hit) const noexcept {
    const auto body = static_cast<std::size_t>(hit.body);
    const Rigid3 T = at.T_world_body_at(body, hit.time);
    return shape(body).vertex_colour(hit.face, conjugate(T.q) * (hit.position - T.t));
}

const Shape& Tracer::shape(std::size_t body) const noexcept {
    return *impl_->shapes[body];
}

std::span<const std::uint32_t> Tracer::all_bodies() const noexcept {
    return impl_->all_bodies;
}

std::span<const std::uint32_t> Tracer::largest_bodies() const noexcept {
    return impl_->largest_bodies;
}

std::size_t Tracer::triangle_count() const noexcept {
    std::size_t n = 0;
    for (const auto& s : impl_->shapes) n += s->properties().triangles;
    return n;
}

const Scene& Tracer::scene() const noexcept {
    return *impl_->scene;
}

}  // namespace narpa
