/// scenes/generate/approach.h - the approach: where the chaser is, second by second.
#pragma once

#include <string>

#include "base/pose.h"

namespace narpa::scenes {

inline constexpr double kApproachDuration_s = 60, kApproachStep_s = 0.1;

/// The chaser in the station's frame at a time in [0, 60] s: twice continuously differentiable, velocity and rate
/// its exact derivatives. Contact (pose of the port itself, turned half round about z) at 60 s.
Motion approach_at(double t_s);
/// Writes the table. Throws std::runtime_error where it cannot.
void write_approach(const std::string& path);

}  // namespace narpa::scenes
