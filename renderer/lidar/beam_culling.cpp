#include "renderer/lidar/beam_culling.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <unordered_map>

#include "base/each_isa.h"
#include "renderer/geometry/poses_at.h"

namespace narpa {
namespace {

/// Relative to the distance: more than the error of single precision and of a ray that is traced again slightly
/// turned.
constexpr float kBeamSlack = 2e-6f;
/// Most boxes of a tree that are tested, for cones and for single rays. More boxes cull more beams and cost more
/// time. Relative times at the docking station: with 8 sub-rays 1.05 for 127 boxes and 1.01 for 2047; with one ray
/// 1.08 for 511.
constexpr std::size_t kMaxBoxes = 511, kMaxForRays = 127;
/// Least component of a direction, so that its reciprocal is finite.
constexpr float kMinDirection = 1e-12f;

/// The beams, cones about the rays, that may meet the bounds of a body: its sphere and its ellipsoid.
NARPA_EACH_ISA void find_meeting_body(const RayBatch& beams, const PoseLanes& T_world_body, double body_radius_m,
                                      const BodyBounds& body, double half_tangent, double beam_end_m,
                                      Lanes<int>& __restrict meeting) {
    const double radius_m = body_radius_m, tangent = half_tangent, end_m = beam_end_m;
    const Vec3 a = body.semi_axes_m, centre_m = body.centre_m;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Rigid3 T = T_world_body[i];
        const Vec3 to = T.t - beams.origin[i], d = beams.direction[i];
        const double along_m = dot(to, d), to2 = dot(to, to), to_m = std::sqrt(to2);
        const double spot_m = tangent * (to_m + radius_m), reach_m = radius_m + spot_m;
        const double reach2 = reach_m * reach_m;
        const bool near = (to2 <= reach2) | ((along_m >= 0) & (to2 - along_m * along_m <= reach2));
        const bool within = to_m - radius_m <= end_m;

        // An ellipsoid that holds all points within spot_m of the body's: (a + s)^2 <= 1.1 a^2 + 11 s^2.
        const auto [x, y, z] = columns(T.q);
        const auto axis = [&](double a_m) {
            return choose(tangent > 0, std::sqrt(1.1 * a_m * a_m + 11 * spot_m * spot_m), a_m * (1 + 1e-6));
        };
        const Vec3 b{axis(a.x), axis(a.y), axis(a.z)};
        const Vec3 o = (Vec3{-dot(x, to), -dot(y, to), -dot(z, to)} - centre_m) / b;
        const Vec3 v = Vec3{dot(x, d), dot(y, d), dot(z, d)} / b;
        const double ov = dot(o, v), vv = dot(v, v), c = dot(o, o) - 1;
        const bool inside = c <= 0, ahead = (ov < 0) & (ov * ov >= (1 - 1e-9) * vv * c);
        meeting[i] = -static_cast<int>(near & within & (inside | ahead));
    }
}

/// The beams that may come near a sphere of the tree over bodies.
NARPA_EACH_ISA void find_near_sphere(const RayBatch& beams, const BodyTree::Sphere& sphere, double half_tangent,
                                     double beam_end_m, Lanes<int>& __restrict meeting) {
    const double radius_m = sphere.radius_m, tangent = half_tangent, end_m = beam_end_m;
    const Vec3 centre = sphere.centre;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Vec3 to = centre - beams.origin[i], d = beams.direction[i];
        const double along_m = dot(to, d), to_m = norm(to);
        const Vec3 aside = to - along_m * d;
        const double reach_m = radius_m + tangent * (to_m + radius_m) + double{kBeamSlack} * (to_m + radius_m);
        const bool near = (to_m <= reach_m) | ((along_m >= 0) & (dot(aside, aside) <= reach_m * reach_m));
        meeting[i] = -static_cast<int>(near & (to_m - reach_m <= end_m));
    }
}

std::uint32_t near_sphere(const RayBatch& beams, const BodyTree::Sphere& sphere, double tangent, double end_m) {
    Lanes<int> meeting;
    find_near_sphere(beams, sphere, tangent, end_m, meeting);
    return bits_of(meeting);
}

/// Beams in the frame of a body.
struct alignas(64) LocalBeams {
    Lanes<float> x, y, z;              ///< where they start, metres
    Lanes<float> per_x, per_y, per_z;  ///< 1 / direction
    Lanes<float> slack_m;              ///< margin of a single ray, for the body's far end
};

/// Transforms beams to the frame of a body, with margins for single precision: relative to the mesh's size and to
/// the distance.
NARPA_EACH_ISA void to_body(const RayBatch& beams, const PoseLanes& T_world_body, double radius_m,
                            LocalBeams& __restrict local) {
    const auto reciprocal = [](double direction) {
        const auto d = static_cast<float>(direction);
        return 1 / std::copysign(std::max(std::abs(d), kMinDirection), d);
    };
    for (std::size_t i = 0; i < kLanes; ++i) {
        const Rigid3 T = T_world_body[i];
        const auto [x, y, z] = columns(T.q);
        const Vec3 o = beams.origin[i] - T.t, d = beams.direction[i];
        local.x[i] = static_cast<float>(dot(x, o));
        local.y[i] = static_cast<float>(dot(y, o));
        local.z[i] = static_cast<float>(dot(z, o));
        local.per_x[i] = reciprocal(dot(x, d));
        local.per_y[i] = reciprocal(dot(y, d));
        local.per_z[i] = reciprocal(dot(z, d));
        local.slack_m[i] = static_cast<float>(kEmbreeSlack * radius_m + kBeamSlack * (norm(o) + radius_m));
    }
}

/// Same as bits_of, by halving: GCC compiles the loop of bits_of to sixteen extractions where it follows another
/// loop.
inline std::uint32_t bits_of_masks(const Lanes<int>& masks) {
    using Sixteen [[gnu::vector_size(64)]] = int;
    using Eight [[gnu::vector_size(32)]] = int;
    using Four [[gnu::vector_size(16)]] = int;
    Sixteen bits;
    std::memcpy(&bits, masks.data(), sizeof bits);
    bits &= Sixteen{0x1,   0x2,   0x4,   0x8,   0x10,   0x20,   0x40,   0x80,
                    0x100, 0x200, 0x400, 0x800, 0x1000, 0x2000, 0x4000, 0x8000};
    const Eight eight = __builtin_shufflevector(bits, bits, 0, 1, 2, 3, 4, 5, 6, 7) |
                        __builtin_shufflevector(bits, bits, 8, 9, 10, 11, 12, 13, 14, 15);
    const Four four =
        __builtin_shufflevector(eight, eight, 0, 1, 2, 3) | __builtin_shufflevector(eight, eight, 4, 5, 6, 7);
    return static_cast<std::uint32_t>(four[0] | four[1] | four[2] | four[3]);
}

/// Tangent of half the full angle of beams, and their greatest range.
struct BeamReach {
    float tangent, end_m;
};

/// The beams that touch the box, grown by half the width of a beam at the box's far end.
template <bool cones>
std::uint32_t touching(const BeamBox& box, const LocalBeams& beams, const BeamReach& reach) {
    const BeamBox b = box;
    const float end_m = reach.end_m, tangent = reach.tangent, own_m = tangent * b.radius;
    Lanes<int> met;
    for (std::size_t i = 0; i < kLanes; ++i) {
        const float x = b.x - beams.x[i], y = b.y - beams.y[i], z = b.z - beams.z[i];
        float grow_m = beams.slack_m[i];
        if constexpr (cones) grow_m += own_m + tangent * std::sqrt(x * x + y * y + z * z);
        // Slab test on each axis: middle and half length of the interval within the box.
        const float mid_x = x * beams.per_x[i], half_x = (b.half_x + grow_m) * std::abs(beams.per_x[i]);
        const float mid_y = y * beams.per_y[i], half_y = (b.half_y + grow_m) * std::abs(beams.per_y[i]);
        const float mid_z = z * beams.per_z[i], half_z = (b.half_z + grow_m) * std::abs(beams.per_z[i]);
        const float enter = std::max(std::max(mid_x - half_x, mid_y - half_y), mid_z - half_z);
        const float leave = std::min(std::min(mid_x + half_x, mid_y + half_y), mid_z + half_z);
        met[i] = -static_cast<int>(std::max(enter, 0.0f) <= std::min(leave, end_m));
    }
    return bits_of_masks(met);
}

/// The beams that touch a leaf.
template <bool cones>
std::uint32_t touching_leaves(std::span<const BeamBox> boxes, const LocalBeams& beams, const BeamReach& reach,
                              std::uint32_t wanted) {
    std::array<std::uint32_t, kMaxBoxes> open;  // stack; grows by one with each level
    std::size_t n = 0;
    open[n++] = 0;
    std::uint32_t found = 0;
    while (n > 0 && found != wanted) {
        const BeamBox& box = boxes[open[--n]];
        const std::uint32_t met = touching<cones>(box, beams, reach) & wanted & ~found;
        if (met == 0) continue;
        if (box.children == 0)
            found |= met;
        else
            open[n++] = box.children, open[n++] = box.children + 1;
    }
    return found;
}

NARPA_EACH_ISA std::uint32_t leaves_on_cones(std::span<const BeamBox> boxes, const LocalBeams& beams,
                                             const BeamReach& reach, std::uint32_t wanted) {
    return touching_leaves<true>(boxes, beams, reach, wanted);
}
NARPA_EACH_ISA std::uint32_t leaves_on_rays(std::span<const BeamBox> boxes, const LocalBeams& beams,
                                            const BeamReach& reach, std::uint32_t wanted) {
    return touching_leaves<false>(boxes, beams, reach, wanted);
}

/// The first boxes of a tree, which are the largest; a box whose children are left out becomes a leaf.
std::vector<BeamBox> beam_boxes(std::span<const BoxNode> nodes, std::size_t most) {
    std::vector<BeamBox> boxes;
    for (const BoxNode& node : nodes.first(std::min(nodes.size(), most))) {
        const Vec3f low{node.low[0], node.low[1], node.low[2]}, high{node.high[0], node.high[1], node.high[2]};
        const Vec3f half = 0.5f * (high - low), middle = low + half;
        const bool leaf = node.children + 1 >= most;
        boxes.push_back(
            {middle.x, middle.y, middle.z, half.x, half.y, half.z, norm(half), leaf ? 0 : node.children});
    }
    return boxes;
}

}  // namespace

BeamCulling::BeamCulling(const Tracer& tracer, double tangent, double range_max_m)
    : tracer_(tracer), tangent_(tangent), range_max_m_(range_max_m) {
    const std::size_t most = tangent > 0 ? kMaxBoxes : kMaxForRays;
    std::unordered_map<const Shape*, std::size_t> known;
    for (const std::uint32_t body : tracer.all_bodies()) {
        const Shape& shape = tracer.shape(body);
        const auto [index, is_new] = known.try_emplace(&shape, shapes_.size());
        if (is_new) shapes_.push_back({&shape, beam_boxes(shape.boxes(), most)});
        shape_of_body_.push_back(index->second);
    }
    meetings_.resize(shape_of_body_.size());
    bodies_.resize(shape_of_body_.size());
}

std::uint32_t BeamCulling::meeting(const BodyPoses& at, const RayBatch& beams, std::size_t body) const noexcept {
    const std::uint32_t wanted = lanes_below(beams.n);
    PoseLanes T_world_body;
    poses_at(at, body, beams.time, T_world_body);
    const std::span<const BeamBox> boxes = shapes_[shape_of_body_[body]].boxes;
    const double radius_m = tracer_.bounding_radius_m(body);
    if (boxes.empty()) {
        Lanes<int> meeting;
        find_meeting_body(beams, T_world_body, radius_m, tracer_.bounds(body), tangent_, range_max_m_, meeting);
        return bits_of(meeting) & wanted;
    }
    LocalBeams local;
    to_body(beams, T_world_body, radius_m, local);
    const BeamReach reach{
        static_cast<float>(tangent_),
        static_cast<float>(range_max_m_ * (1 + 2 * double{kBeamSlack}) + kEmbreeSlack * radius_m)};
    return tangent_ > 0 ? leaves_on_cones(boxes, local, reach, wanted)
                        : leaves_on_rays(boxes, local, reach, wanted);
}

std::uint32_t BeamCulling::find_meeting(const BodyPoses& at, const RayBatch& beams) noexcept {
    met_ = 0;
    std::uint32_t any = 0;
    const auto try_body = [&](std::size_t body) {
        const std::uint32_t met = meeting(at, beams, body);
        if (met != 0) meetings_[met_++] = {static_cast<std::uint32_t>(body), met};
        any |= met;
    };
    if (const BodyTree* const tree = tracer_.tree(at)) {
        tree->visit(
            lanes_below(beams.n),
            [&](const BodyTree::Node& node, std::uint32_t lanes) {
                return lanes == 0 ? 0 : near_sphere(beams, node.bounds, tangent_, range_max_m_) & lanes;
            },
            [&](std::uint32_t body, std::uint32_t) {
                try_body(body);
                return 0u;
            });
        std::ranges::sort(std::span(meetings_).first(met_), {}, &Meeting::body);
    } else {
        for (std::size_t body = 0; body < meetings_.size(); ++body) try_body(body);
    }
    return any;
}

std::span<const std::uint32_t> BeamCulling::bodies_of(std::uint32_t beams) noexcept {
    std::size_t n = 0;
    for (const Meeting& m : std::span(meetings_).first(met_))
        if ((m.beams & beams) != 0) bodies_[n++] = m.body;
    return std::span(bodies_).first(n);
}

}  // namespace narpa
