/// renderer/geometry/body_poses.h - where every body is during one exposure.
#pragma once

#include <span>
#include <vector>

#include "base/pose.h"

namespace narpa {

/// Moments are fractions of the exposure, 0 at its start and 1 at its end. Reused from frame to frame: no
/// allocation after construction.
class BodyPoses {
public:
    /// `knots`: the most poses that a body's path through the exposure may have, at least 2.
    explicit BodyPoses(std::size_t bodies, std::size_t knots = 2)
        : T_world_body(bodies), path_(bodies * knots), path_size_(bodies, 1), knots_(knots) {}

    /// The body stands still during the exposure.
    void set(std::size_t body, const Rigid3& T) noexcept {
        moving_ -= path_size_[body] > 1 ? 1 : 0;
        path_size_[body] = 1;
        T_world_body[body] = T;
    }
    /// The body moves through these poses, which are evenly spaced in time, the first at the exposure's start and
    /// the last at its end. In between its origin moves along a straight line and it turns about a fixed axis, both
    /// at constant rates.
    void set(std::size_t body, std::span<const Rigid3> path) noexcept;

    /// Does any body, or this one, move within the exposure?
    [[nodiscard]] bool moving() const noexcept { return moving_ > 0; }
    [[nodiscard]] bool moves(std::size_t body) const noexcept { return moving_ > 0 && path_size_[body] > 1; }
    /// At the poses of the path exactly those.
    [[nodiscard]] Rigid3 T_world_body_at(std::size_t body, double time) const noexcept {
        return moves(body) ? pose_on_path(body, time) : T_world_body[body];
    }
    /// Where the body's origin is, world.
    [[nodiscard]] Vec3 position_at(std::size_t body, double time) const noexcept {
        return moves(body) ? position_on_path(body, time) : T_world_body[body].t;
    }

    std::vector<Rigid3> T_world_body;  ///< at mid-exposure; changed by `set`

private:
    struct Segment {
        const Rigid3 &start, &end;
        double part;  ///< of the way from start to end
    };
    [[nodiscard]] Segment segment(std::size_t body, double time) const noexcept;
    [[nodiscard]] Rigid3 pose_on_path(std::size_t body, double time) const noexcept;
    [[nodiscard]] Vec3 position_on_path(std::size_t body, double time) const noexcept;

    std::vector<Rigid3> path_;  ///< knots_ for each body
    std::vector<std::size_t> path_size_;
    std::size_t knots_, moving_ = 0;  ///< bodies that move
};

}  // namespace narpa
