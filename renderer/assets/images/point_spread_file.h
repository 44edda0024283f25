/// renderer/assets/images/point_spread_file.h - reads the point spread function of a lens from an image file.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Most samples along a side.
inline constexpr int kMaxPointSpreadSamples = 256;

/// OpenEXR (a channel Y), or what decode_image reads, linear; one band. The samples are normalised to a sum of 1;
/// the centre is the middle of the image, of OpenEXR that of its display window, counted from the first sample
/// stored. Errors name the file. `warnings`: where sentences go about what the file declares and is not used.
Result<std::shared_ptr<PointSpreadImage>> read_point_spread_image(const std::string& path,
                                                                  std::vector<std::string>* warnings = nullptr);

}  // namespace narpa
