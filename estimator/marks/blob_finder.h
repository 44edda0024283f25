/// estimator/marks/blob_finder.h - bright spots of a known size in an image, with the accuracy of their centroids.
#pragma once

#include <span>
#include <vector>

#include "estimator/pnp/pnp_points.h"
#include "estimator/view/measured_image.h"

namespace narpa {

struct Blob {
    Pixel at;                ///< centroid of its light above the background
    PixelCovariance noise;   ///< of the centroid, by the sensor's noise
    double area_px2 = 0;     ///< its light over its contrast
    double contrast_dn = 0;  ///< above the background
    /// Sum over its pixels of part (1 - part), part: how much of the pixel it covers. About a sixth of the rim's
    /// length in pixels for an image that integrates over pixels, 0 for one with a sample at each pixel's centre.
    double mixed = 0;
};

/// Blobs of a disc's image of this radius inside the rectangle, brightest first, at most `most`. Areas that are
/// wider by a fifth and two pixels are no blobs. A blob stands out by at least eight standard deviations of the
/// noise.
[[nodiscard]] std::vector<Blob> find_blobs(const MeasuredImage& image, const SensorModel& sensor,
                                           const ImageRect& within, double radius_px, std::size_t most);

}  // namespace narpa
