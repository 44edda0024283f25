/// renderer/detector/dark_current.h - dark current, which doubles with each step of temperature.
#pragma once

#include "renderer/detector/detector_stage.h"

namespace narpa {

/// `e_s`: mean of a pixel at Detector::dark_reference_c, e-/s.
[[nodiscard]] std::shared_ptr<const DetectorStage> dark_current(double e_s);

/// Also reads the detector's temperature.
extern const DetectorStageKind kDarkCurrent;

}  // namespace narpa
