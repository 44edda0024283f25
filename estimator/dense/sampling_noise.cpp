#include "estimator/dense/sampling_noise.h"

#include <Eigen/LU>
#include <limits>
#include <vector>

#include "estimator/dense/photometric_residuals.h"

namespace narpa {
namespace {

constexpr double kLimitOfSquare = 9;    // of a squared residual
constexpr double kMeanLimited = 0.995;  // mean of min(z^2, 9), z normal

struct NoisyPixel {
    double square_dn2, sampling_dn2, other_dn2;
    double leverage;  ///< part in the pose
};

std::vector<NoisyPixel> pixels_with_sampling_noise(PhotometricImages images, const Exposure& exposure) {
    images.sampling_factor = 1;
    const PixelResiduals residuals(images, exposure, 0);
    const Matrix8 covariance =
        equations(images, exposure, {1, std::numeric_limits<double>::infinity(), 0}, false).information.inverse();
    std::vector<NoisyPixel> out;
    for (int y = 1; y < images.height - 1; ++y)
        residuals.each(y, [&](const PixelResidual& r, std::size_t p) {
            if (!(r.sampling_dn2 > 0) || images.derivative[p].isZero(0)) return;
            const double variance = 1 / (r.inverse_s * r.inverse_s);
            const Vector8 J = r.inverse_s * design(images, exposure, p);
            out.push_back({r.r * r.r * variance, r.sampling_dn2, variance - r.sampling_dn2, J.dot(covariance * J)});
        });
    return out;
}

}  // namespace

double sampling_factor(const PhotometricImages& images, const Exposure& exposure, double most) {
    const std::vector<NoisyPixel> pixels = pixels_with_sampling_noise(images, exposure);
    // Derivative of the weighted log-likelihood by the factor; positive below the solution.
    const auto score = [&](double factor) {
        double sum = 0;
        for (const NoisyPixel& p : pixels) {
            const double variance = p.other_dn2 + factor * p.sampling_dn2;
            sum += p.leverage * p.sampling_dn2 / variance *
                   (std::min(p.square_dn2 / variance, kLimitOfSquare) / kMeanLimited - 1);
        }
        return sum;
    };
    double low = kLeastSamplingFactor, high = most;
    if (!(score(low) > 0)) return low;
    constexpr int kHalvings = 24;
    for (int k = 0; k < kHalvings; ++k) {
        const double middle = std::sqrt(low * high);
        (score(middle) > 0 ? low : high) = middle;
    }
    return high;
}

}  // namespace narpa
