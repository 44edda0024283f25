/// apps/outputs.h - refuses outputs of a command that would overwrite its inputs.
#pragma once

#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// An Error that names the first output that is one of the inputs, by whatever path.
[[nodiscard]] Status keep_inputs(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs);
/// The same for the files that a scene was read from, and for `others`; empty names are ignored.
[[nodiscard]] Status keep_inputs(const std::vector<std::string>& outputs, const Scene& scene,
                                 std::vector<std::string> others);

}  // namespace narpa::cli
