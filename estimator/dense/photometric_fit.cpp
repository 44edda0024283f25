#include "estimator/dense/photometric_fit.h"

#include <tbb/parallel_for.h>
#include <cassert>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>
#include <vector>

#include "estimator/least_squares/median.h"
#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

/// Precision of an exact prior.
constexpr double kExactPriorPrecision = 1e12;

double precision(double sigma) {
    return sigma > 0 ? 1 / (sigma * sigma) : kExactPriorPrecision;
}

struct Residual {
    double r = 0;          ///< in units of s
    double inverse_s = 0;  ///< 1 / DN
    bool counts = false, shows_target = false;
};

class Residuals {
public:
    Residuals(const PhotometricImages& images, const Exposure& exposure, double model_dn2)
        : i_(images), e_(exposure), model_dn2_(model_dn2) {
        [[maybe_unused]] const std::size_t pixels = images.signal.size();
        assert(pixels == static_cast<std::size_t>(images.width) * static_cast<std::size_t>(images.height));
        assert(images.measured.empty() || images.measured.size() == pixels);
        assert(images.derivative.empty() || images.derivative.size() == pixels);
    }

    [[nodiscard]] Residual at(int x, int y) const {
        const auto p =
            static_cast<std::size_t>(y) * static_cast<std::size_t>(i_.width) + static_cast<std::size_t>(x);
        const auto at_p = [p](std::span<const float> v) { return v.empty() ? 0.0 : static_cast<double>(v[p]); };
        const double signal = at_p(i_.signal);
        const double expected = i_.sensor.black_dn + e_.gain * signal + e_.offset_dn;
        const double measured = i_.measured.empty() ? std::min(expected, i_.sensor.top_dn) : at_p(i_.measured);
        const bool clipped = i_.measured.empty() ? expected >= i_.sensor.top_dn
                                                 : !i_.measured_clipped.empty() && i_.measured_clipped[p] != 0;
        Residual out;
        if (clipped && expected >= measured) return out;
        const double variance = i_.sensor.variance_dn2(expected) / i_.pixels_averaged + at_p(i_.measured_variance) +
                                model_dn2_ + e_.gain * e_.gain * at_p(i_.signal_variance) +
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
            if (const Residual r = at(x, y); r.counts)
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
Sum sum_rows(const PhotometricImages& images, Add&& add) {
    std::vector<Sum> rows(static_cast<std::size_t>(std::max(images.height, 0)));
    tbb::parallel_for(1, std::max(images.height - 1, 1), [&](int y) { add(y, rows[static_cast<std::size_t>(y)]); });
    Sum sum;
    for (const Sum& row : rows) sum += row;
    return sum;
}

using Matrix8 = Eigen::Matrix<double, 8, 8>;
using Vector8 = Eigen::Matrix<double, 8, 1>;

/// Derivative of a pixel's expected DN by pose, gain and offset.
Vector8 design(const PhotometricImages& images, const Exposure& exposure, std::size_t p) {
    Vector8 J;
    J << exposure.gain * images.derivative[p].cast<double>(), static_cast<double>(images.signal[p]), 1;
    return J;
}

/// Adds weight J J' to the lower triangle; J is 0 before `first`.
void add_square(Matrix8& sum, const Vector8& J, double weight, int first) {
    for (int column = first; column < 8; ++column) {
        const double w = weight * J[column];
        for (int row = column; row < 8; ++row) sum(row, column) += w * J[row];
    }
}

/// Sums over blocks of kBlock_px x kBlock_px pixels. k: scale of Cauchy's loss.
Matrix8 scatter_of_blocks(const PhotometricImages& images, const Residuals& residuals, double k) {
    constexpr int kBlock_px = 8;
    const auto across = static_cast<std::size_t>(images.width / kBlock_px + 1);
    std::vector<Matrix8> rows(static_cast<std::size_t>(images.height / kBlock_px + 1), Matrix8::Zero());
    tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t row) {
        std::vector<Vector8> pulls(across, Vector8::Zero());
        const int first = static_cast<int>(row) * kBlock_px;
        for (int y = std::max(1, first); y < std::min(first + kBlock_px, images.height - 1); ++y)
            residuals.each(y, [&](const Residual& r, std::size_t p) {
                const double weight = std::isfinite(k) ? 1 / (1 + r.r * r.r / (k * k)) : 1;
                const std::size_t x = p % static_cast<std::size_t>(images.width);
                pulls[x / kBlock_px] += weight * r.r * r.inverse_s * design(images, residuals.exposure(), p);
            });
        for (const Vector8& pull : pulls) rows[row] += pull * pull.transpose();
    });
    Matrix8 sum = Matrix8::Zero();
    for (const Matrix8& row : rows) sum += row;
    return sum;
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
    const Residuals residuals(images, exposure, model_dn2);
    std::vector<float> size;
    for (int y = 1; y < images.height - 1; ++y)
        residuals.each(y, [&](const Residual& r, std::size_t) {
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
    const Residuals residuals(images, exposure, robust.model_dn2);
    const double k = robust.cauchy * robust.scale;
    auto sum = sum_rows<PhotometricCost>(images, [&](int y, PhotometricCost& row) {
        residuals.each(y, [&](const Residual& r, std::size_t) {
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

PhotometricEquations equations(const PhotometricImages& images, const Exposure& exposure, const Robustness& robust,
                               bool scatter) {
    const Residuals residuals(images, exposure, robust.model_dn2);
    const double k = robust.cauchy * robust.scale;
    auto out = sum_rows<PhotometricEquations>(images, [&](int y, PhotometricEquations& row) {
        residuals.each(y, [&](const Residual& r, std::size_t p) {
            const double weight = std::isfinite(k) ? 1 / (1 + r.r * r.r / (k * k)) : 1;
            const Vector8 J = r.inverse_s * design(images, exposure, p);
            const int first = images.derivative[p].isZero(0) ? 6 : 0;  // first column that is not 0
            add_square(row.information, J, weight, first);
            if (scatter) add_square(row.scatter, J, weight * weight * r.r * r.r, first);
            row.gradient += weight * r.r * J;
        });
    });
    if (scatter) out.block_scatter = scatter_of_blocks(images, residuals, k);
    out.information = Matrix8(out.information.selfadjointView<Eigen::Lower>());
    out.scatter = Matrix8(out.scatter.selfadjointView<Eigen::Lower>());
    // The prior in the units of residuals that are `scale` times their noise.
    const double unit = robust.scale * robust.scale;
    const Eigen::Vector2d prior =
        unit * Eigen::Vector2d(precision(images.prior.gain_sigma), precision(images.prior.offset_sigma_dn));
    out.information.diagonal().tail<2>() += prior;
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
    const bool as_expected = (inverse * larger).trace() <= 8;
    const Matrix6 C = (as_expected ? inverse : Matrix8(inverse * larger * inverse)).topLeftCorner<6, 6>();
    return 0.5 * (C + C.transpose());  // removes asymmetry due to rounding
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
    const Residuals residuals(images, exposure, robust.model_dn2);
    const double k = robust.cauchy * robust.scale;
    return sum_rows<Sum>(images,
                         [&](int y, Sum& row) {
                             residuals.each(y, [&](const Residual& r, std::size_t p) {
                                 const double weight = std::isfinite(k) ? 1 / (1 + r.r * r.r / (k * k)) : 1;
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
    const Residuals residuals(images, exposure, 0);
    const PhotometricEquations all =
        equations(images, exposure, {1, std::numeric_limits<double>::infinity(), 0}, false);
    const Matrix6 covariance = all.pose_information().inverse();
    std::vector<float> leverage(images.signal.size());
    tbb::parallel_for(1, std::max(images.height - 1, 1), [&](int y) {
        residuals.each(y, [&](const Residual& r, std::size_t p) {
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

double blur_score(const PhotometricImages& images, const Exposure& exposure, const PhotometricEquations& fit) {
    struct Sum {
        Vector8 shared = Vector8::Zero();
        double score = 0, variance = 0;
        Sum& operator+=(const Sum& b) {
            shared += b.shared, score += b.score, variance += b.variance;
            return *this;
        }
    };
    const Residuals residuals(images, exposure, 0);
    // A blur changes a pixel by its variance times half the Laplacian. The pixel's own sampling noise is in both
    // the Laplacian and the residual, so it must be small.
    const auto by_blur = [&](const Residual& r, std::size_t p) {
        if (!images.chosen.empty() && images.chosen[p] == 0 && images.signal[p] != 0) return 0.0;
        const auto& S = images.signal;
        const auto width = static_cast<std::size_t>(images.width);
        const auto around = static_cast<double>(S[p - 1] + S[p + 1] + S[p - width] + S[p + width]);
        return r.inverse_s * exposure.gain * (around - 4 * static_cast<double>(S[p]));
    };
    const Vector8 shared = sum_rows<Sum>(images, [&](int y, Sum& row) {
                               residuals.each(y, [&](const Residual& r, std::size_t p) {
                                   row.shared += by_blur(r, p) * r.inverse_s * design(images, exposure, p);
                               });
                           }).shared;
    const Vector8 taken = fit.information.inverse() * shared;  // part explained by pose and exposure
    const Sum sum = sum_rows<Sum>(images, [&](int y, Sum& row) {
        residuals.each(y, [&](const Residual& r, std::size_t p) {
            const double term = (by_blur(r, p) - r.inverse_s * design(images, exposure, p).dot(taken)) * r.r;
            row.score += term;
            row.variance += term * term;
        });
    });
    return sum.variance > 0 ? sum.score / std::sqrt(sum.variance) : 0;
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
