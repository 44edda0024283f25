/// estimator/dense/photometric_residuals.h - residuals of pixels in units of their noise (photometric_fit.h).
#pragma once

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <vector>

#include "estimator/dense/photometric_fit.h"

namespace narpa {

using Matrix8 = Eigen::Matrix<double, 8, 8>;
using Vector8 = Eigen::Matrix<double, 8, 1>;

struct PixelResidual {
    double r = 0;             ///< in units of s
    double inverse_s = 0;     ///< 1 / DN
    double sampling_dn2 = 0;  ///< part of s^2 that is `sampling_factor` times the render's sampling variance
    bool counts = false, shows_target = false;
};

class PixelResiduals {
public:
    PixelResiduals(const PhotometricImages& images, const Exposure& exposure, double model_dn2)
        : i_(images), e_(exposure), model_dn2_(model_dn2) {
        [[maybe_unused]] const std::size_t pixels = images.signal.size();
        assert(pixels == static_cast<std::size_t>(images.width) * static_cast<std::size_t>(images.height));
        assert(images.measured.empty() || images.measured.size() == pixels);
        assert(images.derivative.empty() || images.derivative.size() == pixels);
    }

    [[nodiscard]] PixelResidual at(int x, int y) const {
        const auto p =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(i_.width) + static_cast<std::size_t>(x);
        const auto at_p = [p](std::span<const float> v) { return v.empty() ? 0.0 : static_cast<double>(v[p]); };
        const double signal = at_p(i_.signal);
        const double expected = i_.sensor.black_dn + e_.gain * signal + e_.offset_dn;
        const double measured = i_.measured.empty() ? std::min(expected, i_.sensor.top_dn) : at_p(i_.measured);
        const bool clipped = i_.measured.empty() ? expected >= i_.sensor.top_dn
                                                 : !i_.measured_clipped.empty() && i_.measured_clipped[p] != 0;
        PixelResidual out;
        if (!i_.ignored.empty() && i_.ignored[p] != 0) return out;
        if (clipped && expected >= measured) return out;
        out.sampling_dn2 = e_.gain * e_.gain * i_.sampling_factor * at_p(i_.signal_variance);
        const double variance = i_.sensor.variance_dn2(expected) / i_.pixels_averaged + at_p(i_.measured_variance) +
                                model_dn2_ + i_.detail_dn2 + out.sampling_dn2 +
                                i_.model_part * i_.model_part * signal * signal;
        out.counts = variance > 0;
        if (!out.counts) return out;
        out.inverse_s = 1 / std::sqrt(variance);
        out.r = (measured - expected) * out.inverse_s;
        out.shows_target = signal > 0 || (!i_.derivative.empty() && !i_.derivative[p].isZero(0));
        return out;
    }
    [[nodiscard]] const Exposure& exposure() const noexcept { return e_; }
    /// The outermost pixels have no Jacobian.
    template <class Do>
    void each(int y, Do&& act) const {
        for (int x = 1; x < i_.width - 1; ++x)
            if (const PixelResidual r = at(x, y); r.counts)
                act(r,
                    static_cast<std::size_t>(y) * static_cast<std::size_t>(i_.width) + static_cast<std::size_t>(x));
    }

private:
    const PhotometricImages& i_;
    const Exposure& e_;
    const double model_dn2_;
};

/// Row by row, so that sums do not depend on the number of threads.
template <class Sum, class Add>
Sum sum_rows(const PhotometricImages& images, const Sum& zero, Add&& add) {
    std::vector<Sum> rows(static_cast<std::size_t>(std::max(images.height, 0)), zero);
    tbb::parallel_for(1, std::max(images.height - 1, 1), [&](int y) { add(y, rows[static_cast<std::size_t>(y)]); });
    Sum sum = zero;
    for (const Sum& row : rows) sum += row;
    return sum;
}
template <class Sum, class Add>
Sum sum_rows(const PhotometricImages& images, Add&& add) {
    return sum_rows(images, Sum{}, add);
}

/// Cauchy's weight of a residual, with the loss's scale k; infinite k: 1.
inline double cauchy_weight(double r, double k) {
    return std::isfinite(k) ? 1 / (1 + r * r / (k * k)) : 1;
}

/// Derivative of a pixel's expected DN by pose, gain and offset.
inline Vector8 design(const PhotometricImages& images, const Exposure& exposure, std::size_t p) {
    Vector8 J;
    J << exposure.gain * images.derivative[p].cast<double>(), static_cast<double>(images.signal[p]), 1;
    return J;
}

/// A pixel's row of a linearised fit: its design, the weight of its residual, and the residual.
template <class Vector>
struct FitRow {
    Vector design;
    double weight, residual;
};

/// Information and gradient of the pixels in one block.
template <class Square, class Vector>
struct BlockSums {
    Square information;
    Vector gradient;
};

/// Of blocks of block_px x block_px pixels that determine the pose. `row`: gives a pixel's FitRow.
template <class Square, class Row>
auto sums_of_blocks(const PhotometricImages& images, const PixelResiduals& residuals, const Square& zero,
                    int block_px, const Row& row) {
    using Vector = decltype(row(PixelResidual{}, std::size_t{}).design);
    using Sums = BlockSums<Square, Vector>;
    const auto across = static_cast<std::size_t>(images.width / block_px + 1);
    std::vector<std::vector<Sums>> lines(static_cast<std::size_t>(images.height / block_px + 1),
                                         std::vector<Sums>(across, Sums{zero, Vector::Zero(zero.rows())}));
    tbb::parallel_for(std::size_t{0}, lines.size(), [&](std::size_t line) {
        const int first = static_cast<int>(line) * block_px;
        for (int y = std::max(1, first); y < std::min(first + block_px, images.height - 1); ++y)
            residuals.each(y, [&](const PixelResidual& r, std::size_t p) {
                const auto of_pixel = row(r, p);
                const std::size_t x = p % static_cast<std::size_t>(images.width);
                Sums& sums = lines[line][x / static_cast<std::size_t>(block_px)];
                sums.gradient += of_pixel.weight * of_pixel.residual * of_pixel.design;
                if (images.detail_dn2 > 0)
                    sums.information.noalias() += of_pixel.weight * of_pixel.design * of_pixel.design.transpose();
            });
        std::erase_if(lines[line], [](const Sums& s) { return s.gradient.template head<6>().isZero(0); });
    });
    std::vector<Sums> all;
    for (const auto& line : lines) all.insert(all.end(), line.begin(), line.end());
    return all;
}

/// Empirical covariance of the gradient from blocks of 8 x 8 pixels.
///
/// If the model lacks details: from how far the step moves if one block is left out (jackknife; B. Efron, The
/// jackknife, the bootstrap and other resampling plans, 1982), as a block with much of the information hides its
/// own residuals. Details extend over an unknown distance, and smaller blocks are not independent: the block size
/// with the largest result, as long as enough of them cover the target.
template <class Square, class Row>
Square scatter_of_blocks(const PhotometricImages& images, const PixelResiduals& residuals,
                         const Square& information, const Row& row) {
    constexpr int kLeast_px = 8, kBlocksAcross = 4;
    // The pose follows a part of the details, which the residuals then do not show. Without the factor, NEES was 10
    // to 15 for a missing texture, another reflectance and a simplified mesh, and 30 for photographs of a board.
    constexpr double kFollowed = 3;
    const Square zero = Square::Zero(information.rows(), information.cols());
    if (images.detail_dn2 == 0) {
        Square sum = zero;
        for (const auto& b : sums_of_blocks(images, residuals, zero, kLeast_px, row))
            sum += b.gradient * b.gradient.transpose();
        return sum;
    }
    const Square inverse = information.inverse();
    Square largest = zero;
    for (int block_px = kLeast_px;
         block_px == kLeast_px || kBlocksAcross * block_px <= std::min(images.width, images.height);
         block_px *= 2) {
        Square sum = zero;
        const auto blocks = sums_of_blocks(images, residuals, zero, block_px, row);
        for (const auto& b : blocks) {
            const auto moved = (information * (information - b.information).ldlt().solve(b.gradient)).eval();
            sum += kFollowed * moved * moved.transpose();
        }
        if ((inverse * sum).trace() > (inverse * largest).trace()) largest = sum;
    }
    return largest;
}

}  // namespace narpa
