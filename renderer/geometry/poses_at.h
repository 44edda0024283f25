/// renderer/geometry/poses_at.h - where a body is at sixteen moments of an exposure.
#pragma once

#include "base/lanes.h"
#include "renderer/geometry/body_poses.h"

namespace narpa {

/// BodyPoses::T_world_body_at each moment, to the last bit.
void poses_at(const BodyPoses& at, std::size_t body, const Lanes<double>& time, PoseLanes& T_world_body) noexcept;
/// BodyPoses::position_at each moment, to the last bit.
void positions_at(const BodyPoses& at, std::size_t body, const Lanes<double>& time, Vec3Lanes& position) noexcept;

}  // namespace narpa
