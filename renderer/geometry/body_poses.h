/// renderer/geometry/body_poses.h - where every body is during one exposure.
#pragma once

#include <vector>

#include "base/pose_path.h"
#include "renderer/geometry/body_tree.h"

namespace narpa {

/// Moments within an exposure are fractions of it, 0 at its start and 1 at its end.
inline constexpr double kMidExposure = 0.5;

/// Reused from frame to frame: no allocation after construction.
class BodyPoses {
public:
    explicit BodyPoses(std::size_t bodies) : T_world_body(bodies), paths_(bodies), tree_(bodies) {}

    /// The body stands still during the exposure.
    void set(std::size_t body, const Rigid3& T) noexcept { set(body, T, T); }
    /// The body moves from `start` to `end`: its origin along a straight line, turning about a fixed axis, both at
    /// constant rates.
    void set(std::size_t body, const Rigid3& start, const Rigid3& end) noexcept;

    /// Whether any body, or this one, moves within the exposure.
    [[nodiscard]] bool moving() const noexcept { return moving_ > 0; }
    [[nodiscard]] bool moves(std::size_t body) const noexcept { return moving_ > 0 && paths_[body].moves(); }
    /// Exactly the start pose at 0 and the end pose at 1.
    [[nodiscard]] Rigid3 T_world_body_at(std::size_t body, double time) const noexcept {
        return moves(body) ? paths_[body].at(time) : T_world_body[body];
    }
    /// Position of the body's origin, world.
    [[nodiscard]] Vec3 position_at(std::size_t body, double time) const noexcept {
        return moves(body) ? paths_[body].position_at(time) : T_world_body[body].t;
    }

    [[nodiscard]] const PosePath& path(std::size_t body) const noexcept { return paths_[body]; }

    std::vector<Rigid3> T_world_body;  ///< at mid-exposure; changed by `set`

    /// Of Tracer::arrange; cleared by `set`.
    [[nodiscard]] BodyTree& tree() noexcept { return tree_; }
    [[nodiscard]] const BodyTree& tree() const noexcept { return tree_; }

private:
    std::vector<PosePath> paths_;
    std::size_t moving_ = 0;  ///< bodies that move
    BodyTree tree_;
};

inline void BodyPoses::set(std::size_t body, const Rigid3& start, const Rigid3& end) noexcept {
    PosePath& path = paths_[body];
    moving_ -= path.moves() ? 1 : 0;
    path = {start, end};
    moving_ += path.moves() ? 1 : 0;
    T_world_body[body] = path.at(kMidExposure);
    tree_.clear();
}

}  // namespace narpa
