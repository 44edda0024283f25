/// renderer/geometry/poses_at.h - where a body or a camera is at sixteen moments of an exposure.
#pragma once

#include "base/lanes.h"
#include "renderer/geometry/body_poses.h"

namespace narpa {

/// PosePath::at for each time; the results are equal bit for bit.
void poses_at(const PosePath& path, const Lanes<double>& time, PoseLanes& T) noexcept;
/// The same for BodyPoses::T_world_body_at.
void poses_at(const BodyPoses& at, std::size_t body, const Lanes<double>& time, PoseLanes& T_world_body) noexcept;
/// The same for BodyPoses::position_at.
void positions_at(const BodyPoses& at, std::size_t body, const Lanes<double>& time, Vec3Lanes& position) noexcept;

}  // namespace narpa
