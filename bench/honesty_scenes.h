/// bench/honesty_scenes.h - targets made in code for the campaign of honesty.h: with and without symmetries.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Names of the targets: boxes of several shapes, an n-gonal prism, smooth and rough bodies.
[[nodiscard]] std::vector<std::string_view> honesty_targets();

/// One body, lit by the Sun and a little light from everywhere; a grey camera of 12 bits, square, at the world's
/// origin. `size`: its pixels. `target`: one of these names, a body of about 2 m radius about its origin; or a
/// scene file (.toml), whose first body and light it takes. Errors: no target of this name, or a file that has
/// none.
[[nodiscard]] Result<Scene> honesty_scene(std::string_view target, int size);

}  // namespace narpa
