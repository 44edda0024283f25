/// renderer/geometry/emission_tree.h - chooses among the emissive faces of a mesh by what each can send to a
/// receiver.
///
/// A binary tree of clusters of faces (A. Conty Estevez, C. Kulla, "Importance sampling of many lights with
/// adaptive tree splitting", Proc. ACM Comput. Graph. Interact. Tech. 1(2), 2018). A cluster's importance bounds
/// the light that it would send without occlusion: by its power, its distance, its height above the receiver's
/// horizon, and the angle between its faces' normals and the way to the receiver. Faces emit from both sides.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/vec3.h"

namespace narpa {

struct EmissiveFace {
    std::uint32_t face = 0;          ///< of the mesh
    std::array<Vec3, 3> corner_m{};  ///< body frame
    double power = 0;                ///< mean band of radiance times area, W/sr; positive
};

class EmissionTree {
public:
    /// A receiver of the light, in the body's axes.
    struct Seen {
        Vec3 to_origin_m{};  ///< from the receiver to the body's origin
        Vec3 up{};           ///< unit; only light from this hemisphere counts
    };

    explicit EmissionTree(std::vector<EmissiveFace> faces);

    [[nodiscard]] const std::vector<EmissiveFace>& faces() const noexcept { return faces_; }
    /// Index of the face in `faces` that `choice`, in [0, 1), chooses; nullopt if no light can arrive.
    [[nodiscard]] std::optional<std::size_t> choose(const Seen& from, double choice) const noexcept;
    /// Probability that `choose` returns a face of the mesh, over its power; 0 for other faces.
    [[nodiscard]] double probability_per_power(const Seen& from, std::uint32_t face) const noexcept;

private:
    /// Faces of a cluster: `first` to `end` - 1 of `faces_`.
    struct Node {
        Vec3 centre_m{};  ///< of a sphere that holds them
        double radius_m = 0;
        Vec3 axis{};  ///< about which their normals spread, with either sign
        double cos_spread = 1, sin_spread = 0;
        double power = 0;
        std::uint32_t first = 0, end = 0;
        std::uint32_t children = 0;  ///< index of the first of two; 0: a leaf, whose faces are chosen by power
        std::uint32_t parent = 0;
    };
    static constexpr std::uint32_t kNoLeaf = ~0u;

    [[nodiscard]] Node cluster(std::uint32_t first, std::uint32_t end) const;
    [[nodiscard]] bool is_compact(const Node& n) const;
    [[nodiscard]] std::uint32_t split(const Node& n);
    [[nodiscard]] static double importance(const Node& n, const Seen& from) noexcept;
    /// Probability of the first child of a node; negative if no light can arrive from either.
    [[nodiscard]] double first_probability(const Node& n, const Seen& from) const noexcept;

    std::vector<EmissiveFace> faces_;
    std::vector<Node> nodes_;
    std::vector<std::uint32_t> leaf_of_face_;  ///< by face of the mesh
};

}  // namespace narpa
