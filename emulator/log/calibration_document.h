/// emulator/log/calibration_document.h - what a navigation must know of a scene's sensors and marks:
/// calibration.json.
#pragma once

#include <string>

#include "renderer/scene/scene.h"

namespace narpa {

/// JSON. Cameras: size, mount, matrix and distortion as OpenCV has them (none of a projection that OpenCV lacks);
/// LiDARs: model and mount; marks of all bodies. Metres, quaternions w, x, y, z.
[[nodiscard]] std::string calibration_document(const Scene& scene);

}  // namespace narpa
