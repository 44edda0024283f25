#include "estimator/dense/photometric_fit.h"

#include <tbb/parallel_for.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>
#include <vector>

#include "estimator/dense/photometric_residuals.h"
#include "estimator/least_squares/median.h"
#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

/// Precision of an exact prior.
constexpr double kExactPriorPrecision = 1e12;

/// Of residuals so large that Cauchy's loss is concave at most of them, the second derivative is no information.
constexpr double kLeastCurvature = 0.3;

double precision(double sigma) {
    return sigma > 0 ? 1 / (sigma * sigma) : kExactPriorPrecision;
}

/// Adds weight J J' to the lower triangle; J is 0 before `first`.
void add_square(Matrix8& sum, const Vector8& J, double weight, int first) {
    for (int column = first; column < 8; ++column) {
        const double w = weight * J[column];
        for (int row = column; row < 8; ++row) sum(row, column) += w * J[row];
    }
}

}  // namespace

PhotometricCost& PhotometricCost::operator+=(const PhotometricCost& b) {
    robust += b.robust, chi2 += b.chi2, pixels += b.pixels, all_pixels += b.all_pixels;
    return *this;
}

PhotometricEquations& PhotometricEquations::operator+=(const PhotometricEquations& b) {
    information += b.information, scatter += b.scatter, block_scatter += b.block_scatter, gradient += b.gradient;
    return *this;
}

double residual_scale(const PhotometricImages& images, const Exposure& exposure, double model_dn2) {
    const PixelResiduals residuals(images, exposure, model_dn2);
    std::vector<float> size;
    for (int y = 1; y < images.height - 1; ++y)
        residuals.each(y, [&](const PixelResidual& r, std::size_t) {
            if (r.shows_target) size.push_back(static_cast<float>(std::abs(r.r)));
        });
    return std::max(1.0, kMadToSigma * static_cast<double>(upper_median(std::span(size))));
}

double signal_power(const PhotometricImages& images) {
    double sum = 0;
    std::size_t lit = 0;
    for (const float v : images.signal) {
        sum += static_cast<double>(v) * static_cast<double>(v);
        lit += v > 0 ? 1 : 0;
    }
    return sum / static_cast<double>(std::max<std::size_t>(lit, 1));
}

std::array<int, 2> best_shift(const PhotometricImages& images, int most) {
    const int side = 2 * most + 1;
    std::vector<double> sums(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
    tbb::parallel_for(0, side * side, [&](int shift) {
        const int dx = shift % side - most, dy = shift / side - most;
        double sum = 0;
        for (int y = 0; y < images.height; ++y)
            for (int x = 0; x < images.width; ++x) {
                const auto p = static_cast<std::size_t>(y * images.width + x);
                const int from_x = x - dx, from_y = y - dy;
                const bool inside = from_x >= 0 && from_x < images.width && from_y >= 0 && from_y < images.height;
                const auto from = static_cast<std::size_t>(inside ? from_y * images.width + from_x : 0);
                const double expected =
                    images.sensor.black_dn + (inside ? static_cast<double>(images.signal[from]) : 0);
                const double r = static_cast<double>(images.measured[p]) - std::min(expected, images.sensor.top_dn);
                sum += r * r;
            }
        sums[static_cast<std::size_t>(shift)] = sum;
    });
    const int best = static_cast<int>(std::min_element(sums.begin(), sums.end()) - sums.begin());
    return {best % side - most, best / side - most};
}

PhotometricCost cost(const PhotometricImages& images, const Exposure& exposure, const Robustness& robust) {
    const PixelResiduals residuals(images, exposure, robust.model_dn2);
    const double k = robust.cauchy * robust.scale;
    auto sum = sum_rows<PhotometricCost>(images, [&](int y, PhotometricCost& row) {
        residuals.each(y, [&](const PixelResidual& r, std::size_t) {
            const double square = r.r * r.r;
            row.robust += std::isfinite(k) ? k * k * std::log1p(square / (k * k)) : square;
            ++row.all_pixels;
            if (!r.shows_target) return;
            row.chi2 += square;
            ++row.pixels;
        });
    });
    const double off = exposure.gain - 1;
    sum.robust += robust.scale * robust.scale *
                  (off * off * precision(images.prior.gain_sigma) +
                   exposure.offset_dn * exposure.offset_dn * precision(images.prior.offset_sigma_dn));
    return sum;
}

namespace {

/// Residuals are smaller than the noise by the part of it that the fit follows: the pixel's leverage (HC2 of J. G.
/// MacKinnon, H. White, J. Econometrics 29, 1985).
void add_scatter(const PhotometricImages& images, const PixelResiduals& residuals, double k,
                 PhotometricEquations& out) {
    constexpr double kMostLeverage = 0.9;
    struct Sum {
        Matrix8 scatter = Matrix8::Zero();
        double curvature = 0, leverage = 0;
        Sum& operator+=(const Sum& b) {
            scatter += b.scatter, curvature += b.curvature, leverage += b.leverage;
            return *this;
        }
    };
    const Matrix8 inverse = out.information.inverse();
    const Sum sum = sum_rows<Sum>(images, [&](int y, Sum& row) {
        residuals.each(y, [&](const PixelResidual& r, std::size_t p) {
            const double weight = cauchy_weight(r.r, k);
            const Vector8 J = r.inverse_s * design(images, residuals.exposure(), p);
            const bool moves = !images.derivative[p].isZero(0);
            const double leverage = moves ? weight * J.dot(inverse * J) : 0;
            add_square(row.scatter, J, weight * weight * r.r * r.r / (1 - std::min(leverage, kMostLeverage)),
                       moves ? 0 : 6);
            row.leverage += leverage, row.curvature += (2 * weight - 1) * leverage;
        });
    });
    out.scatter = Matrix8(sum.scatter.selfadjointView<Eigen::Lower>());
    out.block_scatter =
        scatter_of_blocks(images, residuals, out.information, [&](const PixelResidual& r, std::size_t p) {
            return FitRow<Vector8>{r.inverse_s * design(images, residuals.exposure(), p), cauchy_weight(r.r, k),
                                   r.r};
        });
    if (sum.leverage > 0) out.curvature = std::max(sum.curvature / sum.leverage, kLeastCurvature);
}

}  // namespace

PhotometricEquations equations(const PhotometricImages& images, const Exposure& exposure, const Robustness& robust,
                               bool scatter) {
    const PixelResiduals residuals(images, exposure, robust.model_dn2);
    const double k = robust.cauchy * robust.scale;
    auto out = sum_rows<PhotometricEquations>(images, [&](int y, PhotometricEquations& row) {
        residuals.each(y, [&](const PixelResidual& r, std::size_t p) {
            const double weight = cauchy_weight(r.r, k);
            const Vector8 J = r.inverse_s * design(images, exposure, p);
            const int first = images.derivative[p].isZero(0) ? 6 : 0;  // first column that is not 0
            add_square(row.information, J, weight, first);
            row.gradient += weight * r.r * J;
        });
    });
    out.information = Matrix8(out.information.selfadjointView<Eigen::Lower>());
    // The prior in the units of residuals that are `scale` times their noise.
    const double unit = robust.scale * robust.scale;
    const Eigen::Vector2d prior =
        unit * Eigen::Vector2d(precision(images.prior.gain_sigma), precision(images.prior.offset_sigma_dn));
    out.information.diagonal().tail<2>() += prior;
    if (scatter) add_scatter(images, residuals, k, out);
    out.scatter.diagonal().tail<2>() += prior;
    out.block_scatter.diagonal().tail<2>() += prior;
    out.gradient.tail<2>() -= prior.cwiseProduct(Eigen::Vector2d(exposure.gain - 1, exposure.offset_dn));
    return out;
}

Matrix6 PhotometricEquations::pose_information() const {
    const Eigen::Matrix2d of_exposure = information.bottomRightCorner<2, 2>().inverse();
    return information.topLeftCorner<6, 6>() -
           information.topRightCorner<6, 2>() * of_exposure * information.bottomLeftCorner<2, 6>();
}

Matrix6 PhotometricEquations::pose_covariance() const {
    const Matrix8 inverse = information.inverse();
    const Matrix8& larger =
        (inverse * block_scatter).trace() > (inverse * scatter).trace() ? block_scatter : scatter;
    const double per_information = 1 / (curvature * curvature);
    const bool as_expected = overconfidence() == 1;
    const Matrix6 C =
        (as_expected ? inverse : Matrix8(per_information * inverse * larger * inverse)).topLeftCorner<6, 6>();
    return 0.5 * (C + C.transpose());  // removes asymmetry due to rounding
}

double PhotometricEquations::overconfidence() const {
    const Matrix8 inverse = information.inverse();
    const double larger = std::max((inverse * block_scatter).trace(), (inverse * scatter).trace());
    return std::max(1.0, larger / (8 * curvature * curvature));
}

double PhotometricEquations::residual() const {
    return std::sqrt((information.inverse() * scatter).trace() / 8);
}

Vector6 PhotometricEquations::pose_step(const Vector8& response) const {
    return (information.inverse() * response).head<6>();
}

Vector8 response(const PhotometricImages& images, const Exposure& exposure, const Robustness& robust,
                 std::span<const float> change) {
    struct Sum {
        Vector8 gradient = Vector8::Zero();
        Sum& operator+=(const Sum& b) {
            gradient += b.gradient;
            return *this;
        }
    };
    const PixelResiduals residuals(images, exposure, robust.model_dn2);
    const double k = robust.cauchy * robust.scale;
    return sum_rows<Sum>(images,
                         [&](int y, Sum& row) {
                             residuals.each(y, [&](const PixelResidual& r, std::size_t p) {
                                 const double weight = cauchy_weight(r.r, k);
                                 const double e = exposure.gain * static_cast<double>(change[p]) * r.inverse_s;
                                 row.gradient += weight * e * r.inverse_s * design(images, exposure, p);
                             });
                         })
        .gradient;
}

std::vector<std::uint8_t> informative_pixels(const PhotometricImages& of_samples, const Exposure& exposure,
                                             double part) {
    PhotometricImages images = of_samples;
    images.signal_variance = {};
    const PixelResiduals residuals(images, exposure, 0);
    const PhotometricEquations all =
        equations(images, exposure, {1, std::numeric_limits<double>::infinity(), 0}, false);
    const Matrix6 covariance = all.pose_information().inverse();
    std::vector<float> leverage(images.signal.size());
    tbb::parallel_for(1, std::max(images.height - 1, 1), [&](int y) {
        residuals.each(y, [&](const PixelResidual& r, std::size_t p) {
            if (images.derivative[p].isZero(0)) return;
            const Vector6 J = r.inverse_s * exposure.gain * images.derivative[p].cast<double>();
            leverage[p] = static_cast<float>(J.dot(covariance * J));
        });
    });
    std::vector<float> sorted;
    std::ranges::copy_if(leverage, std::back_inserter(sorted), [](float l) { return l > 0; });
    std::ranges::sort(sorted, std::greater<>());
    const double enough = part * std::accumulate(sorted.begin(), sorted.end(), 0.0);
    double sum = 0;
    const auto last =
        std::ranges::find_if(sorted, [&](float l) { return (sum += static_cast<double>(l)) >= enough; });
    const float least = last == sorted.end() ? 0 : *last;
    std::vector<std::uint8_t> chosen(leverage.size());
    std::ranges::transform(leverage, chosen.begin(), [&](float l) { return l > 0 && l >= least ? 1 : 0; });
    return chosen;
}

Vector6 PhotometricEquations::pose_gradient() const {
    const Eigen::Matrix2d of_exposure = information.bottomRightCorner<2, 2>().inverse();
    return gradient.head<6>() - information.topRightCorner<6, 2>() * of_exposure * gradient.tail<2>();
}

Eigen::Vector2d PhotometricEquations::exposure_step(const Vector6& pose_step) const {
    return information.bottomRightCorner<2, 2>().inverse() *
           (gradient.tail<2>() - information.bottomLeftCorner<2, 6>() * pose_step);
}

double PhotometricCost::excess() const {
    constexpr double kLossOfNoise = 0.8741;  // mean of 9 ln(1 + r^2 / 9), r normal
    return robust - kLossOfNoise * static_cast<double>(all_pixels);
}

bool PhotometricEquations::observes_pose() const {
    constexpr double kMin = 1e-10;
    const Matrix6 of_pose = pose_information();
    const Vector6 sizes = of_pose.diagonal();
    if (!(sizes.minCoeff() > 0) || !sizes.allFinite()) return false;
    const Vector6 unit = sizes.cwiseSqrt().cwiseInverse();
    const Matrix6 scaled = unit.asDiagonal() * of_pose * unit.asDiagonal();
    return symmetric_eigen(scaled).values[0] > kMin;
}

}  // namespace narpa
