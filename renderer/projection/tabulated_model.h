/// renderer/projection/tabulated_model.h - the rays of a camera model with distortion, from a table made at start.
///
/// The inverse of a distortion costs more than the tracing of the ray. It is smooth, so on a cell of 8 to 64 pixels
/// a side each component of the direction is a polynomial of third degree in x and in y, through the 16 products of
/// Chebyshev's nodes. Cells are the largest that keep a quarter of kTabulatedError_px at further points of
/// each; a cell that does not, such as one at the rim of the image, has the rays of the model itself.
#pragma once

#include "renderer/projection/camera_model.h"

namespace narpa {

/// Largest error of a tabulated ray, px.
inline constexpr double kTabulatedError_px = 1e-5;

/// The model with tabulated `directions` and `bounds` for an image of this size; all else is the model's own. A
/// pinhole, whose rays are cheap, stays as it is.
[[nodiscard]] std::shared_ptr<const CameraModel> tabulated(std::shared_ptr<const CameraModel> model, int width,
                                                           int height);

}  // namespace narpa
