/// scenes/generate/terrain.h - cratered ground to descend to: hills of a few tens of metres, craters of 3 to 40 m,
/// one metre between vertices. Its frame: origin in the middle, z up. Metres.
#pragma once

#include "scenes/generate/mesh.h"

namespace narpa::scenes {

/// From corner to corner along x and along y; ground.png covers it once.
inline constexpr double kTerrainSide = 360;

std::vector<MaterialSpec> terrain_materials();
/// An open sheet, seen from above.
Mesh build_terrain();

}  // namespace narpa::scenes
