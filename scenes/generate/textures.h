/// scenes/generate/textures.h - the pictures on the station's skin, and on the ground of the descent: 1024 x 1024,
/// 8 bits a band.
#pragma once

#include <string>

#include "scenes/generate/shapes.h"

namespace narpa::scenes {

/// hull.png is an atlas of 8 x 8 different shield panels: rivets, seams, stains, marks.
inline constexpr int kPanelsPerSide = 8;
/// blanket.png repeats every kBlanketTile metres: quilted multi-layer insulation.
inline constexpr double kBlanketTile = 2.56;
/// cells.png repeats every kCellTile metres: 8 x 8 solar cells with their bus bars.
inline constexpr double kCellTile = 2.0;
/// port.png covers the hatch of the docking port, kHatchTile metres across, its centre at (0.5, 0.5).
inline constexpr double kHatchTile = 1.28;

/// ring.png covers the docking ring's face, kRingTile metres across, its centre at (0.5, 0.5).
inline constexpr double kRingTile = 2.0;

/// Writes ground.png. Throws std::runtime_error where it cannot.
void write_ground_texture(const std::string& directory);

/// Writes the station's five pictures into `directory`. Throws std::runtime_error where it cannot.
void write_textures(const std::string& directory);

}  // namespace narpa::scenes
