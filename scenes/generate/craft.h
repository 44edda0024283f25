/// scenes/generate/craft.h - a spacecraft of 200,000 triangles to measure speed on: a bus in wrinkled blankets
/// between two long solar wings, trusses, dishes, antenna rods and a docking ring. Its frame: origin in the bus,
/// wings along y, docking ring towards x, z up. Metres; 16 m from tip to tip.
#pragma once

#include "scenes/generate/mesh.h"

namespace narpa::scenes {

/// Without textures.
std::vector<MaterialSpec> craft_materials();
Mesh build_craft();

}  // namespace narpa::scenes
