/// apps/bench_scene.h - scenes that come with narpa, at other sizes.
#pragma once

#include <optional>
#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// Where the scenes lie that narpa brings along: beside the folder of the program, in a build and when installed.
[[nodiscard]] Result<std::string> shipped_scene(const std::string& name);

/// The scene of this file; of an empty name the one that narpa brings along.
[[nodiscard]] Result<Scene> scene_or_shipped(const std::string& file, const std::string& shipped,
                                             std::optional<RenderSettings::Method> method = {});

/// The same view with other pixels.
void resize(Camera& camera, int width, int height);
/// The same view, its longer side so many pixels.
void resize_longer_side(Camera& camera, int pixels);

}  // namespace narpa::cli
