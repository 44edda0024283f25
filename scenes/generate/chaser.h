/// scenes/generate/chaser.h - the visiting ship, in its own frame: origin at the centre of its docking interface
/// plane, x forward (out of its port), z up. Its nose is an open tunnel, from whose hatch the camera looks out.
#pragma once

#include "scenes/generate/mesh.h"

namespace narpa::scenes {

Mesh build_chaser();

}  // namespace narpa::scenes
