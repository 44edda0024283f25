/// renderer/scene_file/scene_inputs.h - the files that a scene was read from.
#pragma once

#include <string>
#include <vector>

#include "renderer/scene/scene.h"

namespace narpa {

/// The scene file, the files that it is based on, those that it names (meshes, DEMs, images, calibrations,
/// descriptions, catalogues), and the images that its meshes name. Parses the TOML files again; what cannot be read
/// is left out.
std::vector<std::string> files_of(const Scene& scene);

}  // namespace narpa
