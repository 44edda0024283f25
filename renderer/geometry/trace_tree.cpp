// Traces batches of rays through the tree over the bodies of a scene.
#include <algorithm>
#include <array>
#include <utility>

#include "base/constants.h"
#include "base/each_isa.h"
#include "renderer/geometry/tracer_impl.h"
#include "renderer/geometry/world_rays.h"

namespace narpa {
namespace {

/// Of the distance to a node: bound of the rounding of where rays pass it, so that no ray misses the node of a body
/// whose own bounds it enters.
constexpr double kPassingMargin = 1e-14;

/// Where the rays enter the sphere of a node; infinity: nowhere.
NARPA_EACH_ISA void enter_node(const WorldRays& rays, const BodyTree::Sphere& bounds,
                               Lanes<double>& __restrict entry_m) {
    const Vec3 centre = bounds.centre;
    const double radius_m = bounds.radius_m;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 o = rays.origin_from(centre, i), d = rays.direction[i];
        const double b = -dot(o, d), reach_m = radius_m + kPassingMargin * std::abs(b);
        const Vec3 closest = o + b * d;
        const double half_chord = std::sqrt(reach_m * reach_m - dot(closest, closest));  // NaN if the line misses
        entry_m[i] = b + half_chord >= 0 ? b - half_chord : kInfinity;
    }
}

/// A node that waits, with where each ray enters it.
struct Waiting {
    std::uint32_t node;
    double nearest_m;  ///< of the batch
    Lanes<double> entry_m;
};

double least(const Lanes<double>& entry_m, std::uint32_t lanes) {
    double nearest_m = kInfinity;
    for_each_lane(lanes, [&](std::size_t i) { nearest_m = std::min(nearest_m, entry_m[i]); });
    return nearest_m;
}

}  // namespace

NARPA_EACH_ISA void Tracer::Impl::find_nearest_in_tree(const BodyPoses& at, const WorldRays& rays,
                                                       std::uint32_t wanted, std::uint32_t skip,
                                                       NearestHits& nearest) const noexcept {
    ShapeRays local;
    // Rays that leave a body may start outside its bounds, on a smooth surface.
    if (rays.own != nullptr)
        for (const auto& [body, mine] : BodyGroups(*rays.own, wanted)) {
            local.entry_m.fill(0);
            trace_body(at, rays, static_cast<std::uint32_t>(body), mine, local, nearest);
        }
    const std::span<const BodyTree::Node> nodes = at.tree().nodes();
    std::array<Waiting, BodyTree::kMaxLevels> waiting;
    std::size_t n = 0;
    const auto add = [&](std::uint32_t index) {
        Waiting& w = waiting[n];
        const BodyTree::Node& node = nodes[index];
        w.node = index;
        if (node.children != 0)
            enter_node(rays, node.bounds, w.entry_m);
        else if (node.body != skip)
            enter_body(at, rays, node.body, w.entry_m);
        else
            return false;
        const std::uint32_t entering = lanes_before(w.entry_m, nearest.at.range_m) & wanted;
        if (entering == 0) return false;
        w.nearest_m = least(w.entry_m, entering);
        ++n;
        return true;
    };
    add(0);
    while (n > 0) {
        const Waiting& w = waiting[--n];
        const std::uint32_t entering = lanes_before(w.entry_m, nearest.at.range_m) & wanted;
        if (entering == 0) continue;
        const BodyTree::Node& node = nodes[w.node];
        if (node.children == 0) {
            local.entry_m = w.entry_m;
            if (const std::uint32_t others = entering & ~rays.that_leave(node.body); others != 0)
                trace_body(at, rays, node.body, others, local, nearest);
        } else {
            const bool first = add(node.children), second = add(node.children + 1);
            if (first && second && waiting[n - 2].nearest_m < waiting[n - 1].nearest_m)
                std::swap(waiting[n - 2], waiting[n - 1]);  // the nearer one comes first
        }
    }
}

NARPA_EACH_ISA std::uint32_t Tracer::Impl::find_occluded_in_tree(const BodyPoses& at, const WorldRays& rays,
                                                                 const Lanes<double>& t_max, std::size_t done,
                                                                 std::uint32_t wanted) const noexcept {
    std::uint32_t dark = 0;
    ShapeRays local;
    local.t_max = t_max;
    for (const auto& [body, mine] : BodyGroups(*rays.own, wanted)) {
        if (body == done) continue;
        local.entry_m.fill(0);
        dark |= occluded_by(at, rays, static_cast<std::uint32_t>(body), mine, local);
    }
    at.tree().visit(
        wanted & ~dark,
        [&](const BodyTree::Node& node, std::uint32_t lanes) {
            if (lanes == 0) return lanes;
            if (node.children != 0)
                enter_node(rays, node.bounds, local.entry_m);
            else
                enter_body(at, rays, node.body, local.entry_m);
            return lanes_before(local.entry_m, t_max) & lanes;
        },
        [&](std::uint32_t body, std::uint32_t entering) {
            entering &= ~rays.that_leave(body);
            const std::uint32_t met = entering == 0 ? 0 : occluded_by(at, rays, body, entering, local);
            dark |= met;
            return met;
        });
    return dark;
}

Hit Tracer::Impl::intersect_others(const BodyPoses& at, const Ray& ray, std::uint32_t skip) const noexcept {
    Vec3Lanes origin, direction, offset{};
    origin.fill(ray.origin), direction.fill(ray.direction);
    Lanes<double> time;
    time.fill(ray.time);
    const WorldRays rays{true, direction, origin, offset, time, true};
    NearestHits nearest;
    nearest.clear();
    find_nearest_in_tree(at, rays, 1u, skip, nearest);
    HitBatch hits;
    finish(at, rays, nearest, hits);
    return hits[0];
}

}  // namespace narpa
