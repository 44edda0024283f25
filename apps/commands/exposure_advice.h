/// apps/commands/exposure_advice.h - detects over- and underexposed frames and suggests other camera settings.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "renderer/camera/signal_levels.h"
#include "renderer/scene/scene.h"

namespace narpa::cli {

/// "12 % of the pixels are saturated (...), expected exposure_s of about 5e-05 ..."; "the image is black: ...".
/// Empty: the exposure is good, or there is no light at all (no exposure helps).
[[nodiscard]] std::string exposure_advice(const Camera& camera, const SignalLevels& levels);

/// "0.062 %", "12 %".
[[nodiscard]] std::string percent(double share);

/// For --json.
[[nodiscard]] nlohmann::json signal_json(const SignalLevels& levels);

}  // namespace narpa::cli
