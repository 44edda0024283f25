#include "estimator/features/flow_noise.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace narpa {

Eigen::Matrix2d flow_covariance(const TonedImage& image, double variance, double u_px, double v_px, int half_px) {
    const int u0 = static_cast<int>(std::lround(u_px)), v0 = static_cast<int>(std::lround(v_px));
    const auto at = [&](int u, int v) {
        return static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(u);
    };
    Eigen::Matrix2d G = Eigen::Matrix2d::Zero();
    for (int v = std::max(1, v0 - half_px); v <= std::min(image.height - 2, v0 + half_px); ++v)
        for (int u = std::max(1, u0 - half_px); u <= std::min(image.width - 2, u0 + half_px); ++u) {
            const double gu = 0.5 * (image.pixels[at(u + 1, v)] - image.pixels[at(u - 1, v)]);
            const double gv = 0.5 * (image.pixels[at(u, v + 1)] - image.pixels[at(u, v - 1)]);
            Eigen::Matrix2d gg;
            gg << gu * gu, gu * gv, gu * gv, gv * gv;
            G += gg;
        }
    const double determinant = G.determinant(), trace = G.trace();
    if (determinant <= 1e-6 * trace * trace) return Eigen::Matrix2d::Zero();
    return variance * G.inverse();
}

}  // namespace narpa
