/// renderer/scene_file/doubtful_units.h - numbers of cameras that are likely in another unit than that of their
/// key.
#pragma once

#include <string>
#include <vector>

#include "renderer/scene/scene.h"

namespace narpa {

/// A sentence for each number of a detector or lens that no camera has: "camera nav: pixel_pitch_m = 5.5 m ...; if
/// it is in micrometres, write 5.5e-06".
[[nodiscard]] std::vector<std::string> doubtful_units(const Scene& scene);

}  // namespace narpa
