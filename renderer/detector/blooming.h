/// renderer/detector/blooming.h - charge above the full well that flows into the neighbours of its column.
#pragma once

#include <algorithm>

#include "base/lanes.h"
#include "renderer/detector/detector_stage.h"

namespace narpa {

[[nodiscard]] std::shared_ptr<const DetectorStage> blooming();

extern const DetectorStageKind kBlooming;

/// Charge above the full well flows along its column of `rows` photosites, half down and then half up,
/// until a photosite has room for it or it leaves at the edge. Handles `columns` <= kLanes columns from `top` on;
/// rows are `stride` apart.
inline void bloom(float* top, std::size_t stride, std::size_t rows, std::size_t columns,
                  float full_well_e) noexcept {
    Lanes<float> carried{};
    // Downwards. The half that flows up stays in its photosite until the second pass.
    for (std::size_t y = 0; y < rows; ++y)
        for (std::size_t i = 0; i < columns; ++i) {
            float& e = top[y * stride + i];
            const float half = std::max(0.0f, e - full_well_e) / 2;
            const float filled = std::min(e, full_well_e) + carried[i];
            carried[i] = std::max(0.0f, filled - full_well_e) + half;
            e = std::min(filled, full_well_e) + half;
        }
    carried.fill(0);
    for (std::size_t y = rows; y-- > 0;)
        for (std::size_t i = 0; i < columns; ++i) {
            float& e = top[y * stride + i];
            const float filled = std::min(e, full_well_e) + carried[i];
            carried[i] = std::max(0.0f, filled - full_well_e) + std::max(0.0f, e - full_well_e);
            e = std::min(filled, full_well_e);
        }
}

}  // namespace narpa
