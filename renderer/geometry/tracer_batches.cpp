// Rays that travel sixteen at a time: those of a camera's neighbouring pixels, and those that leave surfaces.
#include <algorithm>
#include <array>

#include "base/each_isa.h"
#include "renderer/geometry/tracer_impl.h"

namespace narpa {

/// Rays in the world's axes. Where they start is held in two parts, as their sum would be rounded. All are finite,
/// also those that are not asked.
struct WorldRays {
    embree::Run run;
    const Vec3Lanes& direction;
    const Vec3Lanes& base;                 ///< world: the ray's origin, or that of the body that it leaves
    const Vec3Lanes& offset;               ///< on from there
    const Lanes<int>* own = nullptr;       ///< the bodies that they leave; null: none
    const Vec3Lanes* own_start = nullptr;  ///< in the frame of that body
    std::uint32_t inside = 0;              ///< those that leave an inner side

    /// From a body at `t`. Differences of positions come before anything else: a common offset of the whole scene
    /// cancels.
    [[nodiscard]] Vec3 origin_from(const Vec3& t, std::size_t i) const { return offset[i] + (base[i] - t); }
    [[nodiscard]] std::uint32_t that_leave(std::uint32_t body) const {
        return own == nullptr ? 0 : lanes_with(*own, static_cast<int>(body));
    }
};

namespace {

constexpr std::size_t kSortedBodies = 32;  ///< bodies that are sorted at a time
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Lanes<double> for_all(double value) {
    Lanes<double> lanes;
    lanes.fill(value);
    return lanes;
}
const Lanes<double> kNoEnd = for_all(kInfinity);
const Vec3Lanes kNothing{};

/// Where each ray enters the bounds of a body at `t`; infinity where it misses them. The rays that `leave` the body
/// start inside.
NARPA_EACH_ISA void enter(const WorldRays& rays, std::uint32_t leave, const Vec3& t, double bound_m,
                          Lanes<double>& __restrict entry_m) {
    const Lanes<int> own = masks_of(leave);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const double entry = bounding_entry(rays.origin_from(t, i), rays.direction[i], bound_m);
        entry_m[i] = choose(own[i] != 0, 0, entry);
    }
}

/// The rays in the frame of a body.
NARPA_EACH_ISA void turn(const WorldRays& rays, std::uint32_t leave, const Rigid3& T_world_body,
                         MeshRays& __restrict local) {
    const auto [x, y, z] = columns(T_world_body.q);  // the body's axes
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 o = rays.origin_from(T_world_body.t, i), d = rays.direction[i];
        local.origin.put(i, {dot(x, o), dot(y, o), dot(z, o)});
        local.direction.put(i, {dot(x, d), dot(y, d), dot(z, d)});
    }
    local.inside = rays.inside & leave;
    if (leave == 0) return;
    const Lanes<int> own = masks_of(leave);
    for (std::size_t i = 0; i < kLanes; ++i)
        local.origin.put(i, choose(own[i] != 0, (*rays.own_start)[i], local.origin[i]));
}

/// Those of `asked` that meet the shape before their end. `leave`: those that leave it.
NARPA_EACH_ISA std::uint32_t meet(const EllipsoidShape& shape, const MeshRays& rays, std::uint32_t leave,
                                  std::uint32_t asked, MeshHits& __restrict hits) {
    Lanes<double> range;
    Lanes<int> met = masks_of(asked), inner;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Crossing c = shape.first_crossing(rays.origin[i], rays.direction[i]);
        range[i] = c.range;
        inner[i] = c.outside ? 0 : -1;
    }
    if (leave != 0) {
        const Lanes<int> own = masks_of(leave), inside = masks_of(rays.inside);
        for (std::size_t i = 0; i < kLanes; ++i) {
            const bool again = own[i] != 0, within = inside[i] != 0;
            const Crossing c = shape.own_crossing(rays.origin[i], rays.direction[i], !within);
            range[i] = choose(again, c.range, range[i]);
            inner[i] = again ? inside[i] : inner[i];
        }
    }
    for (std::size_t i = 0; i < kLanes; ++i) {
        const bool here = (met[i] != 0) & (range[i] < rays.t_max[i]);
        const Vec3 position = rays.origin[i] + range[i] * rays.direction[i];
        met[i] = -static_cast<int>(here);
        hits.range_m[i] = choose(here, range[i], hits.range_m[i]);
        hits.position.put(i, choose(here, position, hits.position[i]));
    }
    const std::uint32_t taken = bits_of(met);
    hits.inner = (hits.inner & ~taken) | (bits_of(inner) & taken);
    return taken;
}

/// Starts in the world's axes; and directions, but for rays that are not wanted some that are surely finite.
NARPA_EACH_ISA void set_out(const PoseLanes& T_world_body, const Vec3Lanes& start, const Vec3Lanes& directions,
                            std::uint32_t wanted, Vec3Lanes& __restrict offset, Vec3Lanes& __restrict direction) {
    const Lanes<int> mine = masks_of(wanted);
    for (std::size_t i = 0; i < kLanes; ++i) {
        offset.put(i, T_world_body[i].q * start[i]);
        direction.put(i, choose(mine[i] != 0, directions[i], {0, 0, 1}));
    }
}

std::uint32_t lanes_before(const Lanes<double>& entry_m, const Lanes<double>& end_m) {
    Lanes<int> before;
    for (std::size_t i = 0; i < kLanes; ++i) before[i] = -static_cast<int>(entry_m[i] < end_m[i]);
    return bits_of(before);
}

}  // namespace

/// Rays that leave surfaces. Each starts in the frame of its own body, which knows no distances but its own.
class Tracer::Impl::Leaving {
public:
    Leaving(const Impl& impl, const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
            std::uint32_t wanted) noexcept
        : inside_(wanted & ~from.outside) {
        own_.fill(-1);
        for (const auto& [body, mine] : BodyGroups(from.body, wanted)) {
            for_each_lane(mine, [&](std::size_t i) { own_[i] = from.body[i]; });
            if (const MeshScene* mesh = impl.shapes[body].mesh)
                mesh->depart(from.face, from.departure_body, from.outside, mine, start_);
            else
                for_each_lane(mine, [&](std::size_t i) { start_.put(i, from.departure_body[i]); });
            const Rigid3& T = at.T_world_body[body];
            if (mine == wanted)
                own_at_.fill(T);
            else
                for_each_lane(mine, [&](std::size_t i) { own_at_.put(i, T); });
        }
        set_out(own_at_, start_, directions, wanted, offset_, direction_);
    }
    [[nodiscard]] WorldRays rays(embree::Run run = embree::Run::apart) const noexcept {
        return {run, direction_, own_at_.t, offset_, &own_, &start_, inside_};
    }

private:
    std::uint32_t inside_;
    Lanes<int> own_;
    Vec3Lanes start_{};
    PoseLanes own_at_{};
    Vec3Lanes offset_, direction_;
};

void Tracer::Impl::look_at(const BodyPoses& at, const WorldRays& rays, std::uint32_t body, std::uint32_t asked,
                           MeshRays& local, Found& found) const noexcept {
    const std::uint32_t leave = rays.that_leave(body);
    const Shape& shape = shapes[body];
    turn(rays, leave, at.T_world_body[body], local);
    local.t_max = found.at.range_m;
    const std::uint32_t met = shape.mesh != nullptr ? shape.mesh->intersect(local, asked, rays.run, found.at)
                                                    : meet(shape.exact, local, leave, asked, found.at);
    if (met == 0) return;
    const Lanes<int> here = masks_of(met);
    for (std::size_t i = 0; i < kLanes; ++i) found.body[i] = here[i] != 0 ? static_cast<int>(body) : found.body[i];
    found.met |= met;
}

void Tracer::Impl::nearest_hits(const BodyPoses& at, const WorldRays& rays, std::uint32_t wanted,
                                std::span<const std::uint32_t> bodies, Found& found) const noexcept {
    found.met = found.at.inner = 0;
    found.body.fill(-1);
    found.at.range_m = kNoEnd;
    MeshRays local;
    const auto enter_body = [&](std::uint32_t body, Lanes<double>& entry_m) {
        enter(rays, rays.that_leave(body), at.T_world_body[body].t, shapes[body].bound_m, entry_m);
        return lanes_before(entry_m, found.at.range_m) & wanted;
    };
    if (bodies.size() == 1) {
        const std::uint32_t asked = enter_body(bodies[0], local.entry_m);
        if (asked != 0) look_at(at, rays, bodies[0], asked, local, found);
        return;
    }
    struct Candidate {
        std::uint32_t body;
        double nearest_m;  ///< of the packet
        Lanes<double> entry_m;
    };
    std::array<Candidate, kSortedBodies> batch;
    std::array<std::size_t, kSortedBodies> order;
    while (!bodies.empty()) {
        // Bounds about the bodies' origins first, nearest body first.
        std::size_t m = 0;
        for (; !bodies.empty() && m < kSortedBodies; bodies = bodies.subspan(1)) {
            Candidate& c = batch[m];
            c.body = bodies.front();
            c.nearest_m = kInfinity;
            const std::uint32_t asked = enter_body(c.body, c.entry_m);
            if (asked == 0) continue;
            for_each_lane(asked, [&](std::size_t i) { c.nearest_m = std::min(c.nearest_m, c.entry_m[i]); });
            std::size_t k = m;
            for (; k > 0 && batch[order[k - 1]].nearest_m > c.nearest_m; --k) order[k] = order[k - 1];
            order[k] = m++;
        }
        for (std::size_t k = 0; k < m; ++k) {
            const Candidate& c = batch[order[k]];
            const std::uint32_t asked = lanes_before(c.entry_m, found.at.range_m) & wanted;
            if (asked == 0) continue;
            local.entry_m = c.entry_m;
            look_at(at, rays, c.body, asked, local, found);
        }
    }
}

std::uint32_t Tracer::Impl::hidden(const BodyPoses& at, const WorldRays& rays, const Lanes<double>& t_max,
                                   std::uint32_t wanted) const noexcept {
    MeshRays local;
    local.t_max = t_max;
    std::uint32_t dark = 0;
    for (const std::uint32_t body : all_bodies) {
        if (dark == wanted) break;
        const Shape& shape = shapes[body];
        const std::uint32_t leave = rays.that_leave(body);
        enter(rays, leave, at.T_world_body[body].t, shape.bound_m, local.entry_m);
        const std::uint32_t asked = lanes_before(local.entry_m, t_max) & wanted & ~dark;
        if (asked == 0) continue;
        turn(rays, leave, at.T_world_body[body], local);
        if (shape.mesh != nullptr) {
            dark |= shape.mesh->occluded(local, asked, rays.run);
        } else {
            MeshHits nobody_looks;
            dark |= meet(shape.exact, local, leave, asked, nobody_looks);
        }
    }
    return dark;
}

void Tracer::intersect(const BodyPoses& at, const RayBatch& rays, std::span<const std::uint32_t> bodies,
                       HitBatch& hits) const noexcept {
    if (bodies.empty() || rays.n == 0) {
        hits.met = hits.outside = 0;
        hits.body.fill(-1);
        return;
    }
    Impl::Found found;
    if (rays.n == kLanes) {
        impl_->nearest_hits(at, {embree::Run::together, rays.direction, rays.origin, kNothing}, lanes_below(kLanes),
                            bodies, found);
    } else {
        RayBatch filled = rays;
        for (std::size_t i = rays.n; i < kLanes; ++i) filled.put(i, rays[0]);
        impl_->nearest_hits(at, {embree::Run::together, filled.direction, filled.origin, kNothing},
                            lanes_below(rays.n), bodies, found);
    }
    impl_->finish(at, found, hits);
}

void Tracer::intersect(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                       std::uint32_t wanted, HitBatch& hits) const noexcept {
    Impl::Found found;
    if (wanted == 0) {
        hits.met = hits.outside = 0;
        hits.body.fill(-1);
        return;
    }
    const Impl::Leaving leaving(*impl_, at, from, directions, wanted);
    impl_->nearest_hits(at, leaving.rays(), wanted, impl_->all_bodies, found);
    impl_->finish(at, found, hits);
}

std::uint32_t Tracer::occluded(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                               std::uint32_t wanted) const noexcept {
    if (wanted == 0) return 0;
    const Impl::Leaving leaving(*impl_, at, from, directions, wanted);
    return impl_->hidden(at, leaving.rays(embree::Run::together), kNoEnd, wanted);
}

std::uint32_t Tracer::occluded(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                               const Lanes<double>& t_max, std::uint32_t wanted) const noexcept {
    if (wanted == 0) return 0;
    const Impl::Leaving leaving(*impl_, at, from, directions, wanted);
    return impl_->hidden(at, leaving.rays(), t_max, wanted);
}

namespace {

/// The same of hits that do not lie side by side, and their directions.
struct SideBySide {
    SideBySide(std::span<const Hit> from, std::span<const Vec3> directions, std::uint32_t wanted) noexcept {
        for_each_lane(wanted, [&](std::size_t i) {
            points.put(i, from[i]);
            direction.put(i, directions[i]);
        });
    }
    SurfacePoints points;
    Vec3Lanes direction;
};

}  // namespace

void Tracer::intersect(const BodyPoses& at, std::span<const Hit> from, std::span<const Vec3> directions,
                       std::uint32_t wanted, std::span<Hit> hits) const noexcept {
    wanted &= lanes_below(std::min({from.size(), directions.size(), hits.size(), kLanes}));
    if (wanted == 0) return;
    const SideBySide starts(from, directions, wanted);
    HitBatch batch;
    intersect(at, starts.points, starts.direction, wanted, batch);
    for_each_lane(wanted & batch.met, [&](std::size_t i) { hits[i] = batch[i]; });
    for_each_lane(wanted & ~batch.met, [&](std::size_t i) { hits[i].body = -1; });
}

std::uint32_t Tracer::occluded(const BodyPoses& at, std::span<const Hit> from, std::span<const Vec3> directions,
                               std::uint32_t wanted) const noexcept {
    wanted &= lanes_below(std::min({from.size(), directions.size(), kLanes}));
    const SideBySide starts(from, directions, wanted);
    const Impl::Leaving leaving(*impl_, at, starts.points, starts.direction, wanted);
    return impl_->hidden(at, leaving.rays(), kNoEnd, wanted);
}

std::uint32_t Tracer::occluded(const BodyPoses& at, std::span<const Hit> from, std::span<const Vec3> directions,
                               std::span<const double> t_max, std::uint32_t wanted) const noexcept {
    wanted &= lanes_below(std::min({from.size(), directions.size(), t_max.size(), kLanes}));
    const SideBySide starts(from, directions, wanted);
    Lanes<double> ends{};
    for_each_lane(wanted, [&](std::size_t i) { ends[i] = t_max[i]; });
    return occluded(at, starts.points, starts.direction, ends, wanted);
}

void SurfacePoints::put(std::size_t i, const Hit& hit) {
    const std::uint32_t bit = 1u << i;
    outside = hit.outside ? outside | bit : outside & ~bit;
    body[i] = hit.body;
    face[i] = hit.face;
    departure_body.put(i, hit.departure_body);
}

void SurfacePoints::put(std::size_t i, const SurfacePoints& from, std::size_t j) {
    outside = (outside & ~(1u << i)) | (from.outside >> j & 1u) << i;
    body[i] = from.body[j];
    face[i] = from.face[j];
    departure_body.put(i, from.departure_body[j]);
}

Hit HitBatch::operator[](std::size_t i) const {
    if (body[i] < 0) return {};
    return {body[i], face[i], range_m[i],  position[i],        geometric_normal[i], shading_normal[i],
            u[i],    v[i],    material[i], is_set(outside, i), departure_body[i],   beyond_body[i]};
}

void HitBatch::put(std::size_t i, const Hit& hit) {
    SurfacePoints::put(i, hit);
    met = (met & ~(1u << i)) | static_cast<std::uint32_t>(hit.body >= 0) << i;
    range_m[i] = hit.range_m;
    position.put(i, hit.position);
    geometric_normal.put(i, hit.geometric_normal);
    shading_normal.put(i, hit.shading_normal);
    u[i] = hit.u, v[i] = hit.v;
    material[i] = hit.material;
    beyond_body.put(i, hit.beyond_body);
}

}  // namespace narpa
