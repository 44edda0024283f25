/// bench/commands/scene.h - scenes shipped with narpa, at other image sizes.
#pragma once

#include <optional>
#include <string>

#include "apps/scene_argument.h"
#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// Path of a shipped scene: the scenes lie beside the folder of the program, in a build tree and when installed.
[[nodiscard]] Result<std::string> shipped_scene(const std::string& name);

/// Reads the scene, or the shipped one where no file is given; --set applies to both.
[[nodiscard]] Result<Scene> scene_or_shipped(SceneArgument scene, const std::string& shipped,
                                             std::optional<RenderSettings::Method> method = {});

/// Changes the resolution and keeps the view.
void resize(Camera& camera, int width, int height);
/// The same, with `pixels` on the longer side.
void resize_longer_side(Camera& camera, int pixels);

}  // namespace narpa::cli
