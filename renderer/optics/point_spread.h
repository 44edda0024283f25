/// renderer/optics/point_spread.h - the blur of a lens as a filter of the pixels' radiance.
#pragma once

#include <complex>
#include <vector>

#include "renderer/optics/optical_effect.h"

namespace narpa {

extern const OpticsKind kPointSpread;

/// The image of a point as a sum of products of one column and one row, each 2 radius + 1 long and centred on the
/// point; it sums to 1.
struct SeparableFilter {
    struct Term {
        std::vector<float> column, row;
    };
    int radius = 0;
    std::vector<Term> terms;
};

/// The optical transfer function at (fx, fy) cycles per pixel, a product of the factors that `spread` gives: for
/// `sigma_px` exp(-2 pi^2 sigma^2 f^2); for `cutoff_per_px` the incoherent one of a circular aperture, 2 / pi (acos
/// v - v sqrt(1 - v^2)) with v = f / cutoff (Goodman, Introduction to Fourier Optics, 6.3); for `image` its Fourier
/// sum, 0 beyond half a cycle per sample. Complex where an image is not symmetric: transfer(-f) is its conjugate.
[[nodiscard]] std::complex<double> transfer(const PointSpreadFunction& spread, double fx, double fy) noexcept;

/// The pixels already hold the mean radiance over their area, so the filter has the transfer function of the lens
/// alone, up to half a cycle per pixel. It ends where less than 0.2 % of the light is beyond, at 31 pixels at most.
/// Narrow spreads (sigma below 0.5 px) have negative side lobes, as every filter does that is exact at these
/// frequencies.
[[nodiscard]] SeparableFilter filter_of(const PointSpreadFunction& spread);

}  // namespace narpa
