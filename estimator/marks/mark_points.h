/// estimator/marks/mark_points.h - what was measured of marks, as points for a solver of perspective-n-point.
#pragma once

#include <vector>

#include "estimator/marks/blob_finder.h"
#include "estimator/marks/mark_view.h"
#include "estimator/marks/tag_finder.h"

namespace narpa {

struct MarkPoint {
    const Mark* mark = nullptr;
    Vec3 body_m{};
    Pixel seen{};
    PixelCovariance noise{};   ///< by the sensor's noise
    PixelCovariance beyond{};  ///< by all else, for a scatter of one (MarkFit::scatter)
    int numbers = 2;           ///< of a disc two, of a point of a tag's side one: across the side
};

class MarkPoints {
public:
    /// `view`: the disc at a pose near the true one.
    void add_disc(const Mark& mark, const Blob& blob, const DiscView& view);
    void add_tag(const Mark& mark, const FoundTag& tag);
    void remove(const Mark& mark);

    [[nodiscard]] const std::vector<MarkPoint>& points() const noexcept { return points_; }
    [[nodiscard]] int numbers() const;  ///< measured numbers of all points
    [[nodiscard]] std::vector<const Mark*> marks() const;
    [[nodiscard]] std::vector<PixelCovariance> covariances(double scatter) const;
    /// How far the image is from the mean over each pixel: 0 for an integrating sensor, up to 1 for samples at the
    /// centres of pixels. By the rims of the discs.
    [[nodiscard]] double undersampled() const;

private:
    std::vector<MarkPoint> points_;
    double mixed_ = 0, rim_px_ = 0;  ///< sums over the discs: Blob::mixed, and the lengths of their rims
};

}  // namespace narpa
