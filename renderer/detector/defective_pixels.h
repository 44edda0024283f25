/// renderer/detector/defective_pixels.h - dead, hot and blinking photosites.
#pragma once

#include "renderer/detector/detector_stage.h"

namespace narpa {

/// Shares of the photosites, and the dark current that defects add at Detector::dark_reference_c.
struct DefectivePixels {
    double dead_share = 0;  ///< they collect no charge
    double hot_share = 0, hot_e_s = 0;
    double blinking_share = 0, blinking_e_s = 0;  ///< the same, in half of the frames
};
[[nodiscard]] std::shared_ptr<const DetectorStage> defective_pixels(const DefectivePixels& defects);

extern const DetectorStageKind kDefectivePixels;

}  // namespace narpa
