// Traces batches of rays through the bodies of a scene: tests the bodies that they may hit, nearest first, and
// evaluates the surfaces at the hits.
#include <algorithm>
#include <array>

#include "base/constants.h"
#include "base/each_isa.h"
#include "renderer/geometry/poses_at.h"
#include "renderer/geometry/sphere_roots.h"
#include "renderer/geometry/tracer_impl.h"
#include "renderer/geometry/world_rays.h"

namespace narpa {

namespace {

constexpr std::size_t kSortedBodies = 32;  ///< bodies that are sorted at a time

Lanes<double> for_all(double value) {
    Lanes<double> lanes;
    lanes.fill(value);
    return lanes;
}
const Lanes<double> kNoEnd = for_all(kInfinity);
const Vec3Lanes kZero{};

bool is_one_moment(const Lanes<double>& time) {
    int other = 0;
    for (std::size_t i = 0; i < kLanes; ++i) other |= static_cast<int>(time[i] != time[0]);
    return other == 0;
}

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

/// Sets the origins of the rays that leave the body to `own_start`.
inline void set_own_origins(const WorldRays& rays, std::uint32_t leave, ShapeRays& __restrict local) {
    if (leave == 0) return;
    const Lanes<int> own = masks_of(leave);
    for (std::size_t i = 0; i < kLanes; ++i)
        local.origin.put(i, choose(own[i] != 0, (*rays.own_start)[i], local.origin[i]));
}

/// Transforms the rays to the frame of a body.
NARPA_EACH_ISA void turn(const WorldRays& rays, std::uint32_t leave, const Rigid3& T_world_body,
                         ShapeRays& __restrict local) {
    const auto [x, y, z] = columns(T_world_body.q);  // the body's axes
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 o = rays.origin_from(T_world_body.t, i), d = rays.direction[i];
        local.origin.put(i, {dot(x, o), dot(y, o), dot(z, o)});
        local.direction.put(i, {dot(x, d), dot(y, d), dot(z, d)});
    }
    set_own_origins(rays, leave, local);
}

/// The same two functions for a body that moves within the exposure: each ray uses the pose at its own time.
NARPA_EACH_ISA void enter_moving(const WorldRays& rays, std::uint32_t leave, const Vec3Lanes& t, double bound_m,
                                 Lanes<double>& __restrict entry_m) {
    const Lanes<int> own = masks_of(leave);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const double entry = bounding_entry(rays.origin_from(t[i], i), rays.direction[i], bound_m);
        entry_m[i] = choose(own[i] != 0, 0, entry);
    }
}
NARPA_EACH_ISA void turn_moving(const WorldRays& rays, std::uint32_t leave, const PoseLanes& T_world_body,
                                ShapeRays& __restrict local) {
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Rigid3 T = T_world_body[i];
        const auto [x, y, z] = columns(T.q);
        const Vec3 o = rays.origin_from(T.t, i), d = rays.direction[i];
        local.origin.put(i, {dot(x, o), dot(y, o), dot(z, o)});
        local.direction.put(i, {dot(x, d), dot(y, d), dot(z, d)});
    }
    set_own_origins(rays, leave, local);
}

bool moves_among(const BodyPoses& at, std::size_t body, const WorldRays& rays) {
    return at.moves(body) && !rays.same_time;
}

/// Transforms the rays to the frame of a body at each ray's time. `T_world_body`: out, if it moves among the rays.
void to_body(const BodyPoses& at, std::size_t body, const WorldRays& rays, std::uint32_t leave, ShapeRays& local,
             PoseLanes& T_world_body) {
    if (moves_among(at, body, rays)) {
        poses_at(at, body, rays.time, T_world_body);
        turn_moving(rays, leave, T_world_body, local);
    } else {
        turn(rays, leave, at.T_world_body_at(body, rays.time[0]), local);
    }
    local.leaving = leave;
    local.inside = rays.inside & leave;
    local.coherent = rays.coherent;
}

/// Transforms directions to the frame of a body; inactive lanes get arbitrary finite ones.
NARPA_EACH_ISA void turn_directions(const Quat& q_world_body, const Vec3Lanes& directions, std::uint32_t wanted,
                                    Vec3Lanes& __restrict turned) {
    const auto [x, y, z] = columns(q_world_body);
    const Lanes<int> mine = masks_of(wanted);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 d = choose(mine[i] != 0, directions[i], {0, 0, 1});
        turned.put(i, {dot(x, d), dot(y, d), dot(z, d)});
    }
}

NARPA_EACH_ISA void turn_directions(const PoseLanes& T_world_body, const Vec3Lanes& directions,
                                    std::uint32_t wanted, Vec3Lanes& __restrict turned) {
    const Lanes<int> mine = masks_of(wanted);
    for (std::size_t i = 0; i < kLanes; ++i) {
        const auto [x, y, z] = columns(T_world_body[i].q);
        const Vec3 d = directions[i];
        turned.put(i, choose(mine[i] != 0, {dot(x, d), dot(y, d), dot(z, d)}, {0, 0, 1}));
    }
}

/// Poses of a body at the moments of these lanes.
void put_poses(const BodyPoses& at, std::size_t body, const Lanes<double>& time, std::uint32_t lanes,
               PoseLanes& T_world_body) {
    PoseLanes T;
    poses_at(at, body, time, T);
    for_each_lane(lanes, [&](std::size_t i) { T_world_body.put(i, T[i]); });
}

/// Starts, directions and times of rays in world axes; inactive lanes get arbitrary finite directions and times.
NARPA_EACH_ISA void start_rays(const PoseLanes& T_world_body, const SurfacePoints& from, const Vec3Lanes& start,
                               const Vec3Lanes& directions, std::uint32_t wanted, Vec3Lanes& __restrict offset,
                               Vec3Lanes& __restrict direction, Lanes<double>& __restrict time) {
    const Lanes<int> mine = masks_of(wanted);
    for (std::size_t i = 0; i < kLanes; ++i) {
        offset.put(i, T_world_body[i].q * start[i]);
        direction.put(i, choose(mine[i] != 0, directions[i], {0, 0, 1}));
        time[i] = choose(mine[i] != 0, from.time[i], kMidExposure);
    }
}

/// Transforms surfaces from the body's frame to the world. The pose is copied, as for the compiler the stores might
/// change it.
NARPA_EACH_ISA void to_world(const Rigid3& T_world_body, HitBatch& __restrict hits) {
    const Rigid3 T = T_world_body;
    for (std::size_t i = 0; i < kLanes; ++i) hits.position.put(i, T * hits.position[i]);
    for (std::size_t i = 0; i < kLanes; ++i) hits.geometric_normal.put(i, T.q * hits.geometric_normal[i]);
    for (std::size_t i = 0; i < kLanes; ++i) hits.shading_normal.put(i, T.q * hits.shading_normal[i]);
}
NARPA_EACH_ISA void to_world(const PoseLanes& T_world_body, HitBatch& __restrict hits) {
    for (std::size_t i = 0; i < kLanes; ++i) hits.position.put(i, T_world_body[i] * hits.position[i]);
    for (std::size_t i = 0; i < kLanes; ++i)
        hits.geometric_normal.put(i, T_world_body[i].q * hits.geometric_normal[i]);
    for (std::size_t i = 0; i < kLanes; ++i) hits.shading_normal.put(i, T_world_body[i].q * hits.shading_normal[i]);
}

/// Copies what Shape::surface writes.
void copy_surfaces(const HitBatch& from, std::uint32_t lanes, HitBatch& to) {
    to.outside = (to.outside & ~lanes) | (from.outside & lanes);
    for_each_lane(lanes, [&](std::size_t i) {
        to.position.put(i, from.position[i]);
        to.geometric_normal.put(i, from.geometric_normal[i]);
        to.shading_normal.put(i, from.shading_normal[i]);
        to.departure_body.put(i, from.departure_body[i]);
        to.beyond_body.put(i, from.beyond_body[i]);
        to.u[i] = from.u[i], to.v[i] = from.v[i];
        to.material[i] = from.material[i];
    });
}

}  // namespace

/// Rays that leave surfaces. Each start is computed in the frame of its own body, where coordinates, and so
/// rounding errors, are small.
class Tracer::Impl::SecondaryRays {
public:
    SecondaryRays(const Impl& impl, const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                  std::uint32_t wanted) noexcept
        : impl_(impl), at_(at), from_(from), directions_(directions), wanted_(wanted), groups_(from.body, wanted) {
        for (const auto& [body, mine] : groups_) impl.shapes[body]->depart(from, mine, start_);
    }

    /// The body that all rays leave; the number of bodies: they leave several.
    [[nodiscard]] std::size_t body_of_all() const noexcept {
        const auto& [body, mine] = *groups_.begin();
        return mine == wanted_ ? body : impl_.shapes.size();
    }
    /// The lanes that hit this body, which all rays leave, before `t_max`: world axes are not needed.
    [[nodiscard]] std::uint32_t occluded_by(std::size_t body, const Lanes<double>& t_max,
                                            bool coherent) const noexcept {
        ShapeRays local;
        if (at_.moves(body)) {
            PoseLanes T_world_body;
            poses_at(at_, body, from_.time, T_world_body);
            turn_directions(T_world_body, directions_, wanted_, local.direction);
        } else {
            turn_directions(at_.T_world_body[body].q, directions_, wanted_, local.direction);
        }
        local.origin = start_;
        local.entry_m.fill(0);
        local.t_max = t_max;
        local.leaving = wanted_;
        local.inside = wanted_ & ~from_.outside;
        local.coherent = coherent;
        return impl_.shapes[body]->occluded(local, lanes_before(local.entry_m, t_max) & wanted_);
    }

    [[nodiscard]] WorldRays in_world(bool coherent) noexcept {
        own_.fill(-1);
        for_each_lane(wanted_, [&](std::size_t i) { own_[i] = from_.body[i]; });
        if (const std::size_t own = body_of_all(); own < impl_.shapes.size() && !at_.moves(own)) {
            own_at_.fill(at_.T_world_body[own]);
        } else {
            own_at_ = {};
            for (const auto& [body, mine] : groups_) put_poses(at_, body, from_.time, mine, own_at_);
        }
        start_rays(own_at_, from_, start_, directions_, wanted_, offset_, direction_, time_);
        return {coherent, direction_, own_at_.t,
                offset_,  time_,      is_one_moment(time_),
                &own_,    &start_,    wanted_ & ~from_.outside};
    }

private:
    const Impl& impl_;
    const BodyPoses& at_;
    const SurfacePoints& from_;
    const Vec3Lanes& directions_;
    std::uint32_t wanted_;
    BodyGroups groups_;
    Vec3Lanes start_{};
    Lanes<int> own_;
    PoseLanes own_at_;
    Vec3Lanes offset_, direction_;
    Lanes<double> time_;
};

NARPA_EACH_ISA void Tracer::Impl::trace_body(const BodyPoses& at, const WorldRays& rays, std::uint32_t body,
                                             std::uint32_t wanted, ShapeRays& local,
                                             NearestHits& nearest) const noexcept {
    to_body(at, body, rays, rays.that_leave(body), local, nearest.T_world_body);
    nearest.posed = body;
    local.t_max = nearest.at.range_m;
    const std::uint32_t met = shapes[body]->intersect(local, wanted, nearest.at);
    if (met == 0) return;
    const Lanes<int> here = masks_of(met);
    for (std::size_t i = 0; i < kLanes; ++i)
        nearest.body[i] = here[i] != 0 ? static_cast<int>(body) : nearest.body[i];
    nearest.met |= met;
}

NARPA_EACH_ISA std::uint32_t Tracer::Impl::occluded_by(const BodyPoses& at, const WorldRays& rays,
                                                       std::uint32_t body, std::uint32_t entering,
                                                       ShapeRays& local) const noexcept {
    PoseLanes T_world_body;
    to_body(at, body, rays, rays.that_leave(body), local, T_world_body);
    return shapes[body]->occluded(local, entering);
}

void Tracer::Impl::enter_body(const BodyPoses& at, const WorldRays& rays, std::uint32_t body,
                              Lanes<double>& entry_m) const noexcept {
    const std::uint32_t leave = rays.that_leave(body);
    const double bound_m = shapes[body]->properties().bound_m;
    if (moves_among(at, body, rays)) {
        Vec3Lanes t;
        positions_at(at, body, rays.time, t);
        enter_moving(rays, leave, t, bound_m, entry_m);
    } else {
        enter(rays, leave, at.position_at(body, rays.time[0]), bound_m, entry_m);
    }
}

NARPA_EACH_ISA void Tracer::Impl::find_nearest(const BodyPoses& at, const WorldRays& rays, std::uint32_t wanted,
                                               std::span<const std::uint32_t> bodies,
                                               NearestHits& nearest) const noexcept {
    nearest.clear();
    ShapeRays local;
    if (in_tree(at) && bodies.size() == all_bodies.size())
        return find_nearest_in_tree(at, rays, wanted, kNoBody, nearest);
    if (bodies.size() == 1) {
        enter_body(at, rays, bodies[0], local.entry_m);
        const std::uint32_t entering = lanes_before(local.entry_m, nearest.at.range_m) & wanted;
        if (entering != 0) trace_body(at, rays, bodies[0], entering, local, nearest);
        return;
    }
    struct Candidate {
        std::uint32_t body;
        double nearest_m;  ///< of the batch
        Lanes<double> entry_m;
    };
    std::array<Candidate, kSortedBodies> candidates;
    std::array<std::size_t, kSortedBodies> order;
    while (!bodies.empty()) {
        // Sort the bodies whose bounding spheres are hit by distance, then trace the nearest first.
        std::size_t m = 0;
        for (; !bodies.empty() && m < kSortedBodies; bodies = bodies.subspan(1)) {
            Candidate& c = candidates[m];
            c.body = bodies.front();
            c.nearest_m = kInfinity;
            enter_body(at, rays, c.body, c.entry_m);
            const std::uint32_t entering = lanes_before(c.entry_m, nearest.at.range_m) & wanted;
            if (entering == 0) continue;
            for_each_lane(entering, [&](std::size_t i) { c.nearest_m = std::min(c.nearest_m, c.entry_m[i]); });
            std::size_t k = m;
            for (; k > 0 && candidates[order[k - 1]].nearest_m > c.nearest_m; --k) order[k] = order[k - 1];
            order[k] = m++;
        }
        for (std::size_t k = 0; k < m; ++k) {
            const Candidate& c = candidates[order[k]];
            const std::uint32_t entering = lanes_before(c.entry_m, nearest.at.range_m) & wanted;
            if (entering == 0) continue;
            local.entry_m = c.entry_m;
            trace_body(at, rays, c.body, entering, local, nearest);
        }
    }
}

NARPA_EACH_ISA std::uint32_t Tracer::Impl::find_occluded(const BodyPoses& at, const SurfacePoints& from,
                                                         const Vec3Lanes& directions, const Lanes<double>& t_max,
                                                         std::uint32_t wanted, bool coherent) const noexcept {
    SecondaryRays leaving(*this, at, from, directions, wanted);
    const std::size_t own = leaving.body_of_all();
    const bool is_one = own < shapes.size();
    std::uint32_t dark = is_one ? leaving.occluded_by(own, t_max, coherent) : 0;
    if (dark == wanted || (is_one && all_bodies.size() == 1)) return dark;
    const WorldRays rays = leaving.in_world(coherent);
    if (in_tree(at)) return dark | find_occluded_in_tree(at, rays, t_max, own, wanted & ~dark);
    ShapeRays local;
    local.t_max = t_max;
    for (const std::uint32_t body : all_bodies) {
        if (body == own) continue;
        if (dark == wanted) break;
        enter_body(at, rays, body, local.entry_m);
        const std::uint32_t entering = lanes_before(local.entry_m, t_max) & wanted & ~dark;
        if (entering != 0) dark |= occluded_by(at, rays, body, entering, local);
    }
    return dark;
}

NARPA_EACH_ISA void Tracer::Impl::finish(const BodyPoses& at, const WorldRays& rays, const NearestHits& nearest,
                                         HitBatch& hits) const noexcept {
    hits.met = nearest.met;
    hits.outside = 0;
    hits.body = nearest.body;
    hits.time = rays.time;
    if (nearest.met == 0) return;
    hits.face = nearest.at.face;
    hits.range_m = nearest.at.range_m;
    const BodyGroups groups(nearest.body, nearest.met);
    const auto& [first, firsts] = *groups.begin();
    shapes[first]->surface(nearest.at, firsts, hits);
    hits.outside &= nearest.met;
    if (firsts == nearest.met && !moves_among(at, first, rays))
        return to_world(at.T_world_body_at(first, rays.time[0]), hits);
    if (firsts == nearest.met && nearest.posed == first) return to_world(nearest.T_world_body, hits);

    PoseLanes T_world_body;
    HitBatch others;
    for (const auto& [body, lanes] : groups) {
        put_poses(at, body, rays.time, lanes, T_world_body);
        if (body == first) continue;
        shapes[body]->surface(nearest.at, lanes, others);
        copy_surfaces(others, lanes, hits);
    }
    to_world(T_world_body, hits);
}

void Tracer::intersect(const BodyPoses& at, const RayBatch& rays, std::span<const std::uint32_t> bodies,
                       HitBatch& hits) const noexcept {
    if (bodies.empty() || rays.n == 0) return hits.clear();
    NearestHits nearest;
    const auto trace = [&](const RayBatch& all) {
        const WorldRays world{true, all.direction, all.origin, kZero, all.time, is_one_moment(all.time)};
        impl_->find_nearest(at, world, lanes_below(rays.n), bodies, nearest);
        impl_->finish(at, world, nearest, hits);
    };
    if (rays.n == kLanes) return trace(rays);
    RayBatch filled = rays;
    for (std::size_t i = rays.n; i < kLanes; ++i) filled.put(i, rays[0]);
    trace(filled);
}

void Tracer::intersect(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                       std::uint32_t wanted, HitBatch& hits) const noexcept {
    if (wanted == 0) return hits.clear();
    Impl::SecondaryRays leaving(*impl_, at, from, directions, wanted);
    const WorldRays rays = leaving.in_world(false);
    NearestHits nearest;
    impl_->find_nearest(at, rays, wanted, impl_->all_bodies, nearest);
    impl_->finish(at, rays, nearest, hits);
}

std::uint32_t Tracer::occluded(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                               std::uint32_t wanted) const noexcept {
    return wanted == 0 ? 0 : impl_->find_occluded(at, from, directions, kNoEnd, wanted, true);
}

std::uint32_t Tracer::occluded(const BodyPoses& at, const SurfacePoints& from, const Vec3Lanes& directions,
                               const Lanes<double>& t_max, std::uint32_t wanted) const noexcept {
    return wanted == 0 ? 0 : impl_->find_occluded(at, from, directions, t_max, wanted, false);
}

}  // namespace narpa
