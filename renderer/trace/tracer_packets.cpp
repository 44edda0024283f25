// Rays that travel sixteen at a time: those of a camera's neighbouring pixels, and those that leave surfaces.
#include <algorithm>
#include <array>

#include "renderer/trace/tracer_impl.h"

namespace narpa {
namespace {

constexpr std::size_t kBatch = 32;  ///< bodies that are sorted at a time
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Rays through neighbouring pixels. Lanes beyond the last repeat the first.
class CameraRays {
public:
    static constexpr embree::Run run = embree::Run::together;

    CameraRays(const Placement& at, std::span<const Ray> rays) : at_(at) {
        for (std::size_t i = 0; i < kPacket; ++i) {
            const Ray& ray = rays[i < rays.size() ? i : 0];
            origin_.put(i, ray.origin);
            direction_.put(i, ray.direction);
        }
    }
    [[nodiscard]] const VecPerRay& directions() const { return direction_; }
    /// From the origin of this body, in the world's axes. Differences of positions come before anything else: a
    /// common offset of the whole scene cancels.
    [[nodiscard]] VecPerRay origins_from(std::size_t body) const { return origin_ - at_.T_world_body[body].t; }
    /// Those that start on this body, and what differs for them.
    [[nodiscard]] std::uint32_t leave(std::size_t) const { return 0; }
    [[nodiscard]] Vec3 start(std::size_t) const { return {}; }
    [[nodiscard]] bool outside(std::size_t) const { return true; }

private:
    const Placement& at_;
    VecPerRay origin_, direction_;
};

}  // namespace

/// Rays that leave surfaces. Each starts in the frame of its own body, which knows no distances but its own. Lanes
/// that are not wanted hold some finite ray.
class Tracer::Impl::LeavingRays {
public:
    static constexpr embree::Run run = embree::Run::apart;

    LeavingRays(const Impl& impl, const Placement& at, std::span<const Hit> from, std::span<const Vec3> directions,
                std::uint32_t wanted)
        : at_(at), wanted_(wanted) {
        for (std::size_t i = 0; i < kPacket; ++i) {
            direction_.put(i, is_set(wanted, i) ? directions[i] : Vec3{0, 0, 1});
            own_[i] = -1;
            if (!is_set(wanted, i)) continue;
            own_[i] = from[i].body;
            outside_ |= static_cast<std::uint32_t>(from[i].outside) << i;
            start_[i] = impl.departure(from[i]);
            start_turned_[i] = at.T_world_body[static_cast<std::size_t>(own_[i])].q * start_[i];
        }
    }
    [[nodiscard]] const VecPerRay& directions() const { return direction_; }
    [[nodiscard]] VecPerRay origins_from(std::size_t body) const {
        VecPerRay o{};
        for (std::size_t i = 0; i < kPacket; ++i)
            if (is_set(wanted_, i)) {
                const Vec3& own_at = at_.T_world_body[static_cast<std::size_t>(own_[i])].t;
                o.put(i, start_turned_[i] + (own_at - at_.T_world_body[body].t));
            }
        return o;
    }
    [[nodiscard]] std::uint32_t leave(std::size_t body) const {
        std::uint32_t bits = 0;
        for (std::size_t i = 0; i < kPacket; ++i)
            bits |= static_cast<std::uint32_t>(own_[i] == static_cast<int>(body)) << i;
        return bits;
    }
    [[nodiscard]] const Vec3& start(std::size_t i) const { return start_[i]; }
    [[nodiscard]] bool outside(std::size_t i) const { return is_set(outside_, i); }

private:
    const Placement& at_;
    std::uint32_t wanted_, outside_ = 0;
    VecPerRay direction_;
    Lanes<int> own_;                    ///< the body that it leaves; -1: not wanted
    Lanes<Vec3> start_, start_turned_;  ///< in the frame of that body, and turned into the world's axes
};

namespace {

/// Where each ray enters the bounds of a body; infinity where it misses them.
template <class Rays>
Lanes<double> entries_into(const Rays& rays, std::size_t body, const VecPerRay& origin, double bound_m) {
    Lanes<double> entry_m = bounding_entries(origin, rays.directions(), bound_m);
    if (const std::uint32_t leave = rays.leave(body); leave != 0)  // they start inside
        for (std::size_t i = 0; i < kPacket; ++i)
            if (is_set(leave, i)) entry_m[i] = 0;
    return entry_m;
}

/// The rays in the frame of a body that is `origin` away.
template <class Rays>
MeshRays rays_in_body(const Rays& rays, std::size_t body, const Quat& q_world_body, const VecPerRay& origin) {
    MeshRays local;
    local.origin = to_body(q_world_body, origin);
    local.direction = to_body(q_world_body, rays.directions());
    if (const std::uint32_t leave = rays.leave(body); leave != 0)
        for (std::size_t i = 0; i < kPacket; ++i) {
            if (!is_set(leave, i)) continue;
            local.origin.put(i, rays.start(i));
            if (!rays.outside(i)) local.inside |= 1u << i;
        }
    return local;
}

template <class Rays>
std::optional<Crossing> exact_crossing(const EllipsoidShape& shape, const Rays& rays, std::size_t body,
                                       const MeshRays& local, std::size_t i) {
    const Vec3 o = local.origin[i], d = local.direction[i];
    return is_set(rays.leave(body), i) ? shape.own_crossing(o, d, rays.outside(i)) : shape.first_crossing(o, d);
}

}  // namespace

template <class Rays>
void Tracer::Impl::nearest_hits(const Placement& at, const Rays& rays, std::uint32_t wanted,
                                std::span<Hit> hits) const noexcept {
    struct Entries {
        std::size_t body;
        double nearest_m;  ///< of the packet
        Lanes<double> entry_m;
    };
    struct Found {
        int body = -1;
        bool outside = true;
    };
    Lanes<Found> found;
    Lanes<double> nearest;
    nearest.fill(kInfinity);
    Lanes<MeshHit> mesh_hits;
    Lanes<Vec3> o_met, d_met;

    std::array<Entries, kBatch> batch;
    std::array<std::size_t, kBatch> order;
    for (std::size_t next = 0; next < shapes.size();) {
        // As for one ray: bounds about the bodies' origins first, nearest body first.
        std::size_t m = 0;
        for (; next < shapes.size() && m < kBatch; ++next) {
            Entries& e = batch[m];
            e = {next, kInfinity, entries_into(rays, next, rays.origins_from(next), shapes[next].bound_m)};
            for (std::size_t i = 0; i < kPacket; ++i)
                if (is_set(wanted, i) && e.entry_m[i] < nearest[i])
                    e.nearest_m = std::min(e.nearest_m, e.entry_m[i]);
            if (e.nearest_m == kInfinity) continue;
            std::size_t k = m;
            for (; k > 0 && batch[order[k - 1]].nearest_m > e.nearest_m; --k) order[k] = order[k - 1];
            order[k] = m++;
        }
        for (std::size_t k = 0; k < m; ++k) {
            const Entries& e = batch[order[k]];
            std::uint32_t asked = 0;
            for (std::size_t i = 0; i < kPacket; ++i)
                asked |= static_cast<std::uint32_t>(e.entry_m[i] < nearest[i]) << i;
            asked &= wanted;
            if (asked == 0) continue;
            const Shape& shape = shapes[e.body];
            MeshRays local = rays_in_body(rays, e.body, at.T_world_body[e.body].q, rays.origins_from(e.body));
            local.entry_m = e.entry_m;
            local.t_max = nearest;
            const std::uint32_t met =
                shape.mesh != nullptr ? shape.mesh->intersect(local, asked, Rays::run, mesh_hits) : 0;
            for (std::size_t i = 0; i < kPacket; ++i) {
                if (!is_set(shape.mesh != nullptr ? met : asked, i)) continue;
                Crossing crossing;
                if (shape.mesh != nullptr) {
                    crossing.range = mesh_hits[i].range_m;
                } else {
                    const auto exact = exact_crossing(shape.exact, rays, e.body, local, i);
                    if (!exact || exact->range >= nearest[i]) continue;
                    crossing = *exact;
                }
                nearest[i] = crossing.range;
                found[i] = {static_cast<int>(e.body), crossing.outside};
                o_met[i] = local.origin[i], d_met[i] = local.direction[i];
            }
        }
    }
    for (std::size_t i = 0; i < kPacket; ++i) {
        if (!is_set(wanted, i)) continue;
        hits[i].body = found[i].body;
        if (found[i].body < 0) continue;
        hits[i].range_m = nearest[i];
        finish(at, {o_met[i], d_met[i], mesh_hits[i], found[i].outside}, hits[i]);
    }
}

void Tracer::intersect(const Placement& at, std::span<const Ray> rays, std::span<Hit> hits) const noexcept {
    const std::size_t n = std::min({rays.size(), hits.size(), kPacket});
    if (n == 0) return;
    impl_->nearest_hits(at, CameraRays(at, rays.first(n)), lanes_below(n), hits);
}

void Tracer::intersect(const Placement& at, std::span<const Hit> from, std::span<const Vec3> directions,
                       std::uint32_t wanted, std::span<Hit> hits) const noexcept {
    const std::size_t n = std::min({from.size(), directions.size(), hits.size(), kPacket});
    wanted &= lanes_below(n);
    impl_->nearest_hits(at, Impl::LeavingRays(*impl_, at, from, directions, wanted), wanted, hits);
}

Hit HitPacket::operator[](std::size_t i) const {
    if (body[i] < 0) return {};
    return {body[i], face[i], range_m[i],  position[i],        geometric_normal[i], shading_normal[i],
            u[i],    v[i],    material[i], is_set(outside, i), departure_body[i],   beyond_body[i]};
}

void HitPacket::put(std::size_t i, const Hit& hit) {
    const std::uint32_t bit = 1u << i;
    met = hit.body < 0 ? met & ~bit : met | bit;
    outside = hit.outside ? outside | bit : outside & ~bit;
    body[i] = hit.body;
    face[i] = hit.face;
    range_m[i] = hit.range_m;
    position.put(i, hit.position);
    geometric_normal.put(i, hit.geometric_normal);
    shading_normal.put(i, hit.shading_normal);
    u[i] = hit.u, v[i] = hit.v;
    material[i] = hit.material;
    departure_body.put(i, hit.departure_body);
    beyond_body.put(i, hit.beyond_body);
}

void Tracer::intersect(const Placement& at, const RayPacket& rays, std::span<const std::uint32_t> bodies,
                       HitPacket& hits) const noexcept {
    hits.met = 0;
    hits.body.fill(-1);
    if (bodies.empty()) return;
    Lanes<Ray> each;
    Lanes<Hit> found;
    for (std::size_t i = 0; i < rays.n; ++i) each[i] = rays[i];
    intersect(at, std::span(each).first(rays.n), found);
    for (std::size_t i = 0; i < rays.n; ++i) hits.put(i, found[i]);
}

std::uint32_t Tracer::occluded(const Placement& at, const HitPacket& from, const VecPerRay& directions,
                               std::uint32_t wanted) const noexcept {
    Lanes<Hit> hits;
    Lanes<Vec3> each;
    for (std::size_t i = 0; i < kPacket; ++i)
        if (is_set(wanted, i)) hits[i] = from[i], each[i] = directions[i];
    return occluded(at, hits, each, wanted);
}

template <class End>
std::uint32_t Tracer::Impl::hidden(const Placement& at, std::span<const Hit> from, std::span<const Vec3> directions,
                                   std::uint32_t wanted, const End& t_max) const noexcept {
    const LeavingRays rays(*this, at, from, directions, wanted);
    std::uint32_t dark = 0;
    for (std::size_t body = 0; body < shapes.size() && dark != wanted; ++body) {
        const Shape& shape = shapes[body];
        const VecPerRay origin = rays.origins_from(body);
        const Lanes<double> entry_m = entries_into(rays, body, origin, shape.bound_m);
        std::uint32_t asked = 0;
        for (std::size_t i = 0; i < kPacket; ++i) asked |= static_cast<std::uint32_t>(entry_m[i] < t_max(i)) << i;
        asked &= wanted & ~dark;
        if (asked == 0) continue;
        MeshRays local = rays_in_body(rays, body, at.T_world_body[body].q, origin);
        if (shape.mesh != nullptr) {
            local.entry_m = entry_m;
            for (std::size_t i = 0; i < kPacket; ++i) local.t_max[i] = t_max(i);
            dark |= shape.mesh->occluded(local, asked);
            continue;
        }
        for (std::size_t i = 0; i < kPacket; ++i) {
            if (!is_set(asked, i)) continue;
            const auto crossing = exact_crossing(shape.exact, rays, body, local, i);
            if (crossing && crossing->range < t_max(i)) dark |= 1u << i;
        }
    }
    return dark;
}

std::uint32_t Tracer::occluded(const Placement& at, std::span<const Hit> from, std::span<const Vec3> directions,
                               std::uint32_t wanted) const noexcept {
    wanted &= lanes_below(std::min({from.size(), directions.size(), kPacket}));
    return impl_->hidden(at, from, directions, wanted, [](std::size_t) { return kInfinity; });
}

std::uint32_t Tracer::occluded(const Placement& at, std::span<const Hit> from, std::span<const Vec3> directions,
                               std::span<const double> t_max, std::uint32_t wanted) const noexcept {
    wanted &= lanes_below(std::min({from.size(), directions.size(), t_max.size(), kPacket}));
    return impl_->hidden(at, from, directions, wanted,
                         [&](std::size_t i) { return is_set(wanted, i) ? t_max[i] : 0; });
}

}  // namespace narpa
