/// estimator/stereo/spline_image.h - an image between its pixels: the cubic spline through them.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/view/measured_image.h"

namespace narpa {

class SplineImage {
public:
    explicit SplineImage(const MeasuredImage& image);

    struct Sample {
        double dn = 0;
        Eigen::Vector2d gradient{0, 0};  ///< DN per px
    };
    /// At a point for which holds() is true, else undefined.
    [[nodiscard]] Sample sample(const Eigen::Vector2d& px) const;
    [[nodiscard]] double dn(const Eigen::Vector2d& px) const;  ///< that of sample()

    static constexpr int kMargin_px = 2;
    [[nodiscard]] bool holds(const Eigen::Vector2d& px) const {
        return px.x() >= kMargin_px && px.y() >= kMargin_px && px.x() < width_ - 1 - kMargin_px &&
               px.y() < height_ - 1 - kMargin_px;
    }

private:
    int width_, height_;
    std::vector<double> coefficients_;
};

}  // namespace narpa
