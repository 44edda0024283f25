/// scenes/generate/station.h - the station, in its own frame: origin at the centre of the docking interface plane,
/// x out of the port towards a visitor, z up. Metres; about 29 m across.
#pragma once

#include "scenes/generate/mesh.h"

namespace narpa::scenes {

/// Radius of the free opening of the docking ring, and the ring's outer radius, metres: both ships have them.
inline constexpr double kRingInner = 0.60, kRingOuter = 0.74;

std::vector<MaterialSpec> scene_materials();
Mesh build_station();
/// The port alone: ring, guide petals, latches, hatch, target. Its hull reaches back to x = -2.5.
void add_docking_port(Mesh& mesh);

}  // namespace narpa::scenes
