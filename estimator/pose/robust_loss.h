/// estimator/pose/robust_loss.h - robust losses as in Ceres, functions of a residual's squared normalised length
/// s = r' C^-1 r.
#pragma once

#include <cmath>
#include <cstdint>

namespace narpa {

enum class Loss : std::uint8_t { none, huber, cauchy, tukey };

/// `scale` in standard deviations: where the loss begins to bend. Beyond it Huber's grows linearly, Cauchy's
/// logarithmically, Tukey's not at all.
struct RobustLoss {
    Loss kind = Loss::none;
    double scale = 2.5;

    /// rho(s); rho(s) = s - ... near 0.
    [[nodiscard]] double cost(double s) const {
        const double k2 = scale * scale;
        switch (kind) {
            case Loss::none: return s;
            case Loss::huber: return s <= k2 ? s : 2 * scale * std::sqrt(s) - k2;
            case Loss::cauchy: return k2 * std::log1p(s / k2);
            case Loss::tukey: {
                const double u = s < k2 ? 1 - s / k2 : 0;
                return k2 / 3 * (1 - u * u * u);
            }
        }
        return s;
    }
    /// rho'(s): the weight of iteratively reweighted least squares.
    [[nodiscard]] double weight(double s) const {
        const double k2 = scale * scale;
        switch (kind) {
            case Loss::none: return 1;
            case Loss::huber: return s <= k2 ? 1 : scale / std::sqrt(s);
            case Loss::cauchy: return k2 / (k2 + s);
            case Loss::tukey: {
                const double u = s < k2 ? 1 - s / k2 : 0;
                return u * u;
            }
        }
        return 1;
    }
};

}  // namespace narpa
