/// estimator/dense/photometric_residuals.h - residuals of pixels in units of their noise (photometric_fit.h).
#pragma once

#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <cassert>
#include <cmath>
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
        if (clipped && expected >= measured) return out;
        out.sampling_dn2 = e_.gain * e_.gain * i_.sampling_factor * at_p(i_.signal_variance);
        const double variance = i_.sensor.variance_dn2(expected) / i_.pixels_averaged + at_p(i_.measured_variance) +
                                model_dn2_ + out.sampling_dn2 + i_.model_part * i_.model_part * signal * signal;
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

}  // namespace narpa
