/// bench/estimation/consistency_scenes.h - targets made in code for the campaign of consistency.h: with and without
/// symmetries.
#pragma once

#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "estimator/view/model_view.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Names of the targets: boxes of several shapes, an n-gonal prism, smooth and rough bodies.
[[nodiscard]] std::vector<std::string_view> consistency_targets();

/// One body, lit by the Sun and a little light from everywhere; a grey camera of 12 bits, square, at the world's
/// origin. `size`: its pixels. `target`: one of these names, a body of about 2 m radius about its origin; or a
/// scene file (.toml), whose first body and light it takes. Errors: no target of this name, or a file that has
/// none.
[[nodiscard]] Result<Scene> consistency_scene(std::string_view target, int size);

/// Variance of the sampling noise of such frames of the view, DN^2, from frames of other seeds. The estimate from
/// the frame itself is too low where its samples happened to miss the light, which would bias weights.
[[nodiscard]] std::vector<float> sampling_variance(ModelView& view, const Rigid3& T_camera_target,
                                                   FrameSettings settings, std::mt19937_64& random);

}  // namespace narpa
