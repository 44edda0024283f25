/// scenes/generate/small_body.h - a small body to fly around: a triaxial ellipsoid of 56 x 40 x 34 m with craters
/// of 1 to 18 m and boulders of half a metre to 3 m. Its frame: origin in the middle, longest axis x, z its spin
/// axis.
#pragma once

#include "scenes/generate/mesh.h"

namespace narpa::scenes {

std::vector<MaterialSpec> small_body_materials();
/// Closed; about 0.4 m between vertices.
Mesh build_small_body();

}  // namespace narpa::scenes
