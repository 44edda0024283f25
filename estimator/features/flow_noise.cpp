#include "estimator/features/flow_noise.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace narpa {

std::vector<float> toned_variance(const TonedImage& image, const SensorModel& sensor, double top_dn) {
    // tone = 255 sqrt(part), so d tone / d DN = 255^2 / (2 tone span); in the darkest steps the root is clipped.
    const double span = top_dn - sensor.black_dn;
    std::array<float, 256> of_tone{};
    for (int t = 0; t < 256; ++t) {
        const double tone = std::max(t, 1), dn = sensor.black_dn + span * (tone / 255) * (tone / 255);
        const double slope = 255.0 * 255.0 / (2 * tone * span);
        of_tone[static_cast<std::size_t>(t)] =
            static_cast<float>(std::min(slope * slope * sensor.variance_dn2(dn), 255.0) + 1.0 / 12);
    }
    std::vector<float> variance;
    variance.reserve(image.pixels.size());
    for (const std::uint8_t t : image.pixels) variance.push_back(of_tone[t]);
    return variance;
}

Eigen::Matrix2d flow_covariance(const TonedImage& image, const std::vector<float>& variance, double u_px,
                                double v_px, int half_px) {
    const int u0 = static_cast<int>(std::lround(u_px)), v0 = static_cast<int>(std::lround(v_px));
    const auto at = [&](int u, int v) {
        return static_cast<std::size_t>(v) * static_cast<std::size_t>(image.width) + static_cast<std::size_t>(u);
    };
    Eigen::Matrix2d G = Eigen::Matrix2d::Zero(), noise = Eigen::Matrix2d::Zero();
    for (int v = std::max(1, v0 - half_px); v <= std::min(image.height - 2, v0 + half_px); ++v)
        for (int u = std::max(1, u0 - half_px); u <= std::min(image.width - 2, u0 + half_px); ++u) {
            const double gu = 0.5 * (image.pixels[at(u + 1, v)] - image.pixels[at(u - 1, v)]);
            const double gv = 0.5 * (image.pixels[at(u, v + 1)] - image.pixels[at(u, v - 1)]);
            Eigen::Matrix2d gg;
            gg << gu * gu, gu * gv, gu * gv, gv * gv;
            G += gg;
            noise += static_cast<double>(variance[at(u, v)]) * gg;
        }
    const double determinant = G.determinant(), trace = G.trace();
    if (determinant <= 1e-6 * trace * trace) return Eigen::Matrix2d::Zero();
    const Eigen::Matrix2d inverse = G.inverse();
    return inverse * noise * inverse;
}

}  // namespace narpa
