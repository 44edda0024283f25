/// estimator/marks/tag_finder.h - square tags of a dictionary in an image, with the lines of their sides.
#pragma once

#include <array>
#include <vector>

#include "estimator/pnp/pnp_points.h"
#include "estimator/view/measured_image.h"

namespace narpa {

/// One side of a tag's black square: the line fitted to its edge, as two points on it (at side_parts()) whose
/// errors across the line are independent and have this variance.
struct TagSide {
    std::array<Pixel, 2> at;
    Pixel across;  ///< unit vector
    double variance_px2 = 0;
};

struct FoundTag {
    int id = 0;
    std::array<TagSide, 4> sides;  ///< from corner k to corner k + 1 of tag_corners()
};

/// Where the two points of a TagSide lie, as parts of the side's length.
[[nodiscard]] std::array<double, 2> side_parts() noexcept;

/// `dictionary`: index in kTagDictionaries. Tags whose sides are shorter than about ten pixels are not found.
[[nodiscard]] std::vector<FoundTag> find_tags(const MeasuredImage& image, int dictionary);

}  // namespace narpa
