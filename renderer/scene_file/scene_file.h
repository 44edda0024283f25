/// renderer/scene_file/scene_file.h - scene file (TOML) and its meshes and textures -> Scene.
#pragma once

#include <span>
#include <string>

#include "base/result.h"
#include "renderer/keys/keys.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// The tables of a scene file.
extern const TableKeys kSceneFileKeys;

/// Reads a scene and everything it names; paths inside are relative to the file that they stand in. The key
/// reference is docs/scene.md. Errors carry file, line and column; a key that is not known is an error.
/// `overrides`: values of single keys, KEY=VALUE (renderer/keys/toml_override.h); the scene remembers them.
Result<Scene> read_scene(const std::string& path, std::span<const std::string> overrides = {});
/// The same of a file's text. `path`: its name for errors; names of files in it are relative to its folder.
Result<Scene> parse_scene(const std::string& text, const std::string& path,
                          std::span<const std::string> overrides = {});

/// Changes the method of a scene that has been read, and updates its warnings; an error where a material does not
/// allow the method.
Status use_method(Scene& scene, RenderSettings::Method method);

}  // namespace narpa
