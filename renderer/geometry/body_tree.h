/// renderer/geometry/body_tree.h - a binary tree of spheres over the bodies of a scene, for rays among many of
/// them.
///
/// It holds for one set of poses, in double. Built by Tracer::arrange; a few bodies need none.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/vec3.h"

namespace narpa {

class BodyTree {
public:
    /// Up to so many bodies are tried one by one.
    static constexpr std::size_t kFewBodies = 32;

    /// A sphere that holds a body, at any time of the exposure.
    struct Sphere {
        Vec3 centre{};  ///< world
        double radius_m = 0;
    };
    struct Node {
        Sphere bounds{};             ///< holds those of its children
        std::uint32_t children = 0;  ///< index of the first of two; 0: a leaf
        std::uint32_t body = 0;      ///< of a leaf
    };

    /// Takes memory for a tree over `bodies`; none for a few.
    explicit BodyTree(std::size_t bodies);

    /// A sphere for each body, to be set before `build`; empty for a few bodies.
    [[nodiscard]] std::span<Sphere> spheres() noexcept { return spheres_; }
    /// Splits at medians, along the longest axis of the centres: the number of levels is the logarithm of the
    /// number of bodies. `owner`: whose bounds the spheres are. Allocates nothing.
    void build(const void* owner) noexcept;
    /// The poses have changed.
    void clear() noexcept { owner_ = nullptr; }
    [[nodiscard]] bool belongs_to(const void* owner) const noexcept { return owner_ != nullptr && owner_ == owner; }

    /// Root first.
    [[nodiscard]] std::span<const Node> nodes() const noexcept { return nodes_; }

    /// Levels of a tree over 2^32 bodies, and so the most nodes that wait at once while it is walked.
    static constexpr std::size_t kMaxLevels = 34;

    /// Visits the bodies that some lanes of `wanted` may meet: `meets(node, lanes)` returns those of the lanes that
    /// may meet the node's sphere, and `visit(body, lanes)` those that need no other body.
    template <class Meets, class Visit>
    void visit(std::uint32_t wanted, const Meets& meets, const Visit& visit) const noexcept {
        struct Open {
            std::uint32_t node, lanes;
        };
        std::array<Open, kMaxLevels> open;
        std::size_t n = 0;
        open[n++] = {0, wanted};
        std::uint32_t done = 0;
        while (n > 0) {
            const auto [index, lanes] = open[--n];
            const Node& node = nodes_[index];
            const std::uint32_t met = meets(node, lanes & ~done);
            if (met == 0) continue;
            if (node.children == 0)
                done |= visit(node.body, met);
            else
                open[n++] = {node.children, met}, open[n++] = {node.children + 1, met};
        }
    }

private:
    void split(std::uint32_t node, std::span<std::uint32_t> bodies) noexcept;

    std::vector<Sphere> spheres_;
    std::vector<std::uint32_t> order_;
    std::vector<Node> nodes_;
    std::uint32_t used_ = 0;  ///< nodes so far, while it is built
    const void* owner_ = nullptr;
};

}  // namespace narpa
