#include "renderer/geometry/body_tree.h"

#include <algorithm>
#include <numeric>

#include "base/constants.h"

namespace narpa {
namespace {

/// Of a node's radius: more than the rounding of the distances to what it holds.
constexpr double kNodeMargin = 1e-9;

/// Along which the centres are spread most.
int longest_axis(std::span<const std::uint32_t> bodies, std::span<const BodyTree::Sphere> spheres, Vec3& middle) {
    Vec3 low{kInfinity, kInfinity, kInfinity}, high = -low;
    for (const std::uint32_t body : bodies)
        for (int k = 0; k < 3; ++k) {
            low[k] = std::min(low[k], spheres[body].centre[k]);
            high[k] = std::max(high[k], spheres[body].centre[k]);
        }
    middle = low + 0.5 * (high - low);
    const Vec3 extent = high - low;
    if (extent.x >= extent.y && extent.x >= extent.z) return 0;
    return extent.y >= extent.z ? 1 : 2;
}

}  // namespace

BodyTree::BodyTree(std::size_t bodies) {
    if (bodies <= kFewBodies) return;
    spheres_.resize(bodies);
    order_.resize(bodies);
    nodes_.resize(2 * bodies - 1);
}

void BodyTree::build(const void* owner) noexcept {
    if (order_.empty()) return;
    std::iota(order_.begin(), order_.end(), 0u);
    used_ = 1;
    split(0, order_);
    owner_ = owner;
}

void BodyTree::split(std::uint32_t index, std::span<std::uint32_t> bodies) noexcept {
    Node& node = nodes_[index];
    if (bodies.size() == 1) {
        node = {spheres_[bodies[0]], 0, bodies[0]};
        return;
    }
    Vec3 middle;
    const int axis = longest_axis(bodies, spheres_, middle);
    double radius_m = 0;
    for (const std::uint32_t body : bodies)
        radius_m = std::max(radius_m, norm(spheres_[body].centre - middle) + spheres_[body].radius_m);
    node = {{middle, radius_m * (1 + kNodeMargin)}, used_, 0};
    used_ += 2;
    const std::size_t half = bodies.size() / 2;
    const auto is_lower = [&](std::uint32_t a, std::uint32_t b) {
        const double x = spheres_[a].centre[axis], y = spheres_[b].centre[axis];
        return x != y ? x < y : a < b;
    };
    std::nth_element(bodies.begin(), bodies.begin() + static_cast<std::ptrdiff_t>(half), bodies.end(), is_lower);
    const std::uint32_t children = node.children;
    split(children, bodies.first(half));
    split(children + 1, bodies.subspan(half));
}

}  // namespace narpa
