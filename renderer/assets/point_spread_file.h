/// renderer/assets/point_spread_file.h - reads the point spread function of a lens from an image file.
#pragma once

#include <memory>
#include <string>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Most samples along a side.
inline constexpr int kMaxPointSpreadSamples = 256;

/// OpenEXR (a channel Y), or what read_texture reads, 8 or 16 bits, linear; one band. The samples are normalised to
/// a sum of 1; the centre is the image's middle. Errors name the file.
Result<std::shared_ptr<PointSpreadImage>> read_point_spread_image(const std::string& path);

}  // namespace narpa
