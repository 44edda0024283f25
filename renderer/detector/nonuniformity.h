/// renderer/detector/nonuniformity.h - spatial nonuniformity: gains and offsets that differ between photosites.
#pragma once

#include "renderer/detector/detector_stage.h"

namespace narpa {

/// Standard deviations after EMVA 1288, release 4.0.
struct Nonuniformity {
    double prnu = 0;    ///< of the pixels' gains, relative to their mean
    double dsnu_e = 0;  ///< of the pixels' offsets
};
[[nodiscard]] std::shared_ptr<const DetectorStage> nonuniformity(const Nonuniformity& deviations);

extern const DetectorStageKind kNonuniformity;

}  // namespace narpa
