/// renderer/geometry/world_rays.h - a batch of rays among the bodies of a scene, for the sources of the tracer.
#pragma once

#include <bit>

#include "base/constants.h"
#include "renderer/geometry/shape.h"

namespace narpa {

/// Rays in world axes. Their starts are stored in two parts, as the sum would be rounded. All lanes are finite,
/// also inactive ones.
struct WorldRays {
    bool coherent;
    const Vec3Lanes& direction;
    const Vec3Lanes& base;    ///< world: the ray's origin, or that of the body that it leaves
    const Vec3Lanes& offset;  ///< from there to the start
    const Lanes<double>& time;
    bool same_time;                        ///< all have the same time
    const Lanes<int>* own = nullptr;       ///< the bodies that they leave; null: none
    const Vec3Lanes* own_start = nullptr;  ///< in the frame of that body
    std::uint32_t inside = 0;              ///< those that leave an inner side

    /// Origin relative to a body at `t`. Positions are subtracted first, so that a common offset of the whole scene
    /// cancels.
    [[nodiscard]] Vec3 origin_from(const Vec3& t, std::size_t i) const { return offset[i] + (base[i] - t); }
    [[nodiscard]] std::uint32_t that_leave(std::uint32_t body) const {
        return own == nullptr ? 0 : lanes_with(*own, static_cast<int>(body));
    }
};

/// The nearest hit of each ray so far.
struct NearestHits {
    std::uint32_t met = 0;
    Lanes<int> body;                      ///< -1: none
    ShapeHits at;                         ///< infinite range: none
    std::size_t posed = ~std::size_t{0};  ///< the body that was traced last
    PoseLanes T_world_body;               ///< its pose at each ray's time, if it moves among these

    void clear() noexcept {
        met = at.inner = 0;
        posed = ~std::size_t{0};
        body.fill(-1);
        at.range_m.fill(kInfinity);
    }
};

/// The lanes whose ray enters before its end.
[[nodiscard]] inline std::uint32_t lanes_before(const Lanes<double>& entry_m, const Lanes<double>& end_m) noexcept {
    Lanes<int> before;
    for (std::size_t i = 0; i < kLanes; ++i) before[i] = -static_cast<int>(entry_m[i] < end_m[i]);
    return bits_of(before);
}

/// Groups lanes by body.
class BodyGroups {
public:
    struct Group {
        std::size_t body;
        std::uint32_t lanes;
    };
    BodyGroups(const Lanes<int>& body, std::uint32_t lanes) noexcept {
        for (std::uint32_t rest = lanes; rest != 0;
             rest &= ~groups_[n_++].lanes) {  // NOLINT(bugprone-infinite-loop)
            const int first = body[static_cast<std::size_t>(std::countr_zero(rest))];
            groups_[n_] = {static_cast<std::size_t>(first), lanes_with(body, first) & rest};
        }
    }
    [[nodiscard]] const Group* begin() const { return groups_.data(); }
    [[nodiscard]] const Group* end() const { return groups_.data() + n_; }

private:
    Lanes<Group> groups_;
    std::size_t n_ = 0;
};

}  // namespace narpa
