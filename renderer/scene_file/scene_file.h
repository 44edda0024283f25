/// renderer/scene_file/scene_file.h - scene file (TOML) and its meshes and textures -> Scene.
#pragma once

#include <string>

#include "base/result.h"
#include "renderer/keys/keys.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The tables of a scene file.
extern const TableKeys kSceneFileKeys;

/// Reads a scene and everything it names; paths inside are relative to the scene file. The key reference is
/// docs/scene.md. Errors carry file, line and column; a key that is not known is an error.
Result<Scene> read_scene(const std::string& path);

/// Changes the method of a scene that has been read, and updates its warnings; an error where a material does not
/// allow the method.
Status use_method(Scene& scene, RenderSettings::Method method);

}  // namespace narpa
