/// estimator/search/frame_view.h - a frame in units of its noise, averaged over areas of any size.
#pragma once

#include <vector>

#include "estimator/view/measured_image.h"

namespace narpa {

/// Variance-stabilising transform of digital numbers: the noise of the result has the same variance at every level,
/// 1 for a single pixel. It is the integral of 1 / sigma (F. Anscombe, Biometrika 35, 1948, with read noise). 0 at
/// black.
class NoiseScale {
public:
    explicit NoiseScale(const SensorModel& sensor);
    [[nodiscard]] double operator()(double dn) const noexcept;

private:
    double black_dn_, read_dn2_, shot_dn_;
};

/// Sums of the frame's pixels over areas, from a summed-area table.
class FrameView {
public:
    explicit FrameView(const MeasuredImage& frame);
    /// Mean DN over a square of this side about (x, y), pixels; beyond the border the outermost pixels are
    /// repeated.
    [[nodiscard]] double mean(double x, double y, double side) const noexcept;
    [[nodiscard]] bool holds(double x, double y) const noexcept {
        return x >= -0.5 && y >= -0.5 && x <= width_ - 0.5 && y <= height_ - 0.5;
    }

private:
    [[nodiscard]] double sum_to(double x, double y) const noexcept;

    int width_, height_;
    std::vector<double> sums_;  ///< of all pixels left of and above each pixel corner
};

}  // namespace narpa
