#include "estimator/dense/nuisance_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cassert>
#include <cmath>

#include "estimator/dense/photometric_residuals.h"
#include "estimator/uncertainty/untold.h"

namespace narpa {
namespace {

/// Pose, gain and offset; then the nuisance's unknowns.
constexpr int kPoseAndExposure = 8, kMostUnknowns = kPoseAndExposure + 6;
using VectorN = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMostUnknowns, 1>;
using MatrixN = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMostUnknowns, kMostUnknowns>;

/// Of a combination of unknowns, pose and exposure leave at least this part of its square: as much may be an error
/// of the derivative. (A smooth cylinder's roll and the light about its axis are one, and leave 0.01.)
constexpr double kLeastLeft = 0.02;

struct NuisanceSums {
    MatrixN information, scatter;
    VectorN gradient;
    NuisanceSums& operator+=(const NuisanceSums& b) {
        information += b.information, scatter += b.scatter, gradient += b.gradient;
        return *this;
    }
    static NuisanceSums zero(Eigen::Index n) {
        return {MatrixN::Zero(n, n), MatrixN::Zero(n, n), VectorN::Zero(n)};
    }
};

class NuisanceEquations {
public:
    NuisanceEquations(const PhotometricImages& images, const Exposure& exposure, const Robustness& robust,
                      const NuisanceColumns& columns)
        : images_(images),
          exposure_(exposure),
          columns_(columns),
          residuals_(images, exposure, robust.model_dn2),
          k_(robust.cauchy * robust.scale),
          size_(kPoseAndExposure + static_cast<Eigen::Index>(columns.size())) {}

    /// Design of a pixel: derivative of its normalised residual's expectation.
    [[nodiscard]] VectorN at(const PixelResidual& r, std::size_t p) const {
        VectorN x(size_);
        x.head<kPoseAndExposure>() = design(images_, exposure_, p);
        for (std::size_t i = 0; i < columns_.size(); ++i)
            x[kPoseAndExposure + static_cast<Eigen::Index>(i)] =
                exposure_.gain * static_cast<double>(columns_[i][p]);
        return r.inverse_s * x;
    }
    [[nodiscard]] MatrixN prior() const {
        MatrixN out = MatrixN::Zero(size_, size_);
        out(6, 6) = 1 / (images_.prior.gain_sigma * images_.prior.gain_sigma);
        out(7, 7) = 1 / (images_.prior.offset_sigma_dn * images_.prior.offset_sigma_dn);
        return out;
    }
    [[nodiscard]] NuisanceSums equations() const {
        NuisanceSums sums = sum_rows(images_, NuisanceSums::zero(size_), [&](int y, NuisanceSums& row) {
            residuals_.each(y, [&](const PixelResidual& r, std::size_t p) {
                const double weight = cauchy_weight(r.r, k_);
                if (!r.shows_target && !touches(p)) {  // the offset only
                    row.information(7, 7) += weight * r.inverse_s * r.inverse_s;
                    row.gradient[7] += weight * r.r * r.inverse_s;
                    return;
                }
                const VectorN x = at(r, p);
                row.information.noalias() += weight * x * x.transpose();
                row.gradient += weight * r.r * x;
            });
        });
        const MatrixN unit = prior();
        sums.information += unit;
        sums.gradient[6] -= unit(6, 6) * (exposure_.gain - 1), sums.gradient[7] -= unit(7, 7) * exposure_.offset_dn;
        return sums;
    }
    /// Covariance of the gradient in the basis `to` of the unknowns, after the step.
    [[nodiscard]] MatrixN scatter(const MatrixN& to, const MatrixN& information, const MatrixN& inverse,
                                  const VectorN& step) const {
        if (images_.detail_dn2 > 0)
            return scatter_of_blocks(images_, residuals_, information, [&](const PixelResidual& r, std::size_t p) {
                const VectorN x = to.transpose() * at(r, p);
                return FitRow<VectorN>{x, cauchy_weight(r.r, k_), r.r - x.dot(step)};
            });
        const Eigen::Index n = to.cols();
        NuisanceSums sums = sum_rows(images_, NuisanceSums::zero(n), [&](int y, NuisanceSums& row) {
            residuals_.each(y, [&](const PixelResidual& r, std::size_t p) {
                const double weight = cauchy_weight(r.r, k_);
                if (!r.shows_target && !touches(p)) {
                    const double left = weight * (r.r - r.inverse_s * step[7]) * r.inverse_s;
                    row.scatter(7, 7) += left * left;
                    return;
                }
                const VectorN x = to.transpose() * at(r, p);
                const double leverage = std::min(weight * x.dot(inverse * x), kMostLeverage);
                const double left = weight * (r.r - x.dot(step)) / (1 - leverage);
                row.scatter.noalias() += left * left * x * x.transpose();
            });
        });
        return sums.scatter;
    }

private:
    static constexpr double kMostLeverage = 0.9;

    [[nodiscard]] bool touches(std::size_t p) const {
        for (const std::vector<float>& column : columns_)
            if (column[p] != 0) return true;
        return false;
    }

    const PhotometricImages& images_;
    const Exposure& exposure_;
    const NuisanceColumns& columns_;
    const PixelResiduals residuals_;
    const double k_;
    const Eigen::Index size_;
};

/// The nuisance's unknowns with pose and exposure unknown too.
struct Left {
    VectorN unit;      ///< in which the image of each unknown has a square of one
    VectorN values;    ///< parts of the square that pose and exposure do not explain, ascending
    MatrixN vectors;   ///< the combinations of unknowns, in that unit
    MatrixN response;  ///< of pose and exposure to the unknowns

    explicit Left(const MatrixN& information) {
        const Eigen::Index n = information.rows() - kPoseAndExposure;
        const MatrixN shared = information.topLeftCorner(kPoseAndExposure, kPoseAndExposure),
                      mixed = information.topRightCorner(kPoseAndExposure, n);
        const MatrixN own = information.bottomRightCorner(n, n);
        response = shared.ldlt().solve(mixed);
        unit = own.diagonal();
        for (double& u : unit) u = u > 0 ? 1 / std::sqrt(u) : 0;
        const MatrixN left = unit.asDiagonal() * (own - mixed.transpose() * response) * unit.asDiagonal();
        const Eigen::SelfAdjointEigenSolver<MatrixN> eigen(left);
        values = eigen.eigenvalues(), vectors = eigen.eigenvectors();
    }
    /// Columns: the combinations that residuals can show.
    [[nodiscard]] MatrixN determined() const {
        Eigen::Index first = 0;
        while (first < values.size() && !(values[first] > kLeastLeft)) ++first;
        return unit.asDiagonal() * vectors.rightCols(values.size() - first);
    }
    /// Added covariance of the pose: its response to the unknowns, times their variance by residuals and prior. 0:
    /// no prior, and none of the unknowns that residuals do not show.
    [[nodiscard]] Matrix6 covariance(double prior, double overconfidence) const {
        Matrix6 sum = Matrix6::Zero();
        for (Eigen::Index i = 0; i < values.size(); ++i) {
            const VectorN unknowns = unit.asDiagonal() * vectors.col(i);
            if (unknowns.isZero(0)) continue;
            const Vector6 pose = response.topRows(6) * unknowns;
            const double by_residuals = std::max(values[i] - kLeastLeft, 0.0) / overconfidence;
            const double by_prior = prior > 0 ? unknowns.squaredNorm() / (prior * prior) : 0;
            if (by_residuals + by_prior > 0) sum += pose * pose.transpose() / (by_residuals + by_prior);
        }
        return sum;
    }
};

}  // namespace

NuisanceFit fit_nuisance(const PhotometricImages& images, const Exposure& exposure, const Robustness& robust,
                         const NuisanceColumns& columns, double prior, double overconfidence) {
    assert(!columns.empty() && columns.size() <= static_cast<std::size_t>(kMostUnknowns - kPoseAndExposure));
    const NuisanceEquations fit(images, exposure, robust, columns);
    const NuisanceSums sums = fit.equations();
    NuisanceFit out;
    const Left left(sums.information);
    if (prior > 0) out.covariance = left.covariance(prior, overconfidence);
    out.rotation_response = left.response.topRows(3).norm();
    constexpr double kNoPrior = 100;  // times the prior: what residuals do not show is then not observed
    out.covariance_without_prior = left.covariance(kNoPrior * prior, overconfidence);
    const MatrixN kept = left.determined();
    out.unknowns = static_cast<int>(kept.cols());
    if (out.unknowns == 0) return out;
    const Eigen::Index n = kPoseAndExposure + kept.cols();
    MatrixN to = MatrixN::Zero(sums.information.rows(), n);
    to.topLeftCorner(kPoseAndExposure, kPoseAndExposure).setIdentity();
    to.bottomRightCorner(kept.rows(), kept.cols()) = kept;
    const MatrixN information = to.transpose() * sums.information * to;
    const MatrixN inverse = information.ldlt().solve(MatrixN::Identity(n, n));
    const VectorN step = inverse * (to.transpose() * sums.gradient);
    const MatrixN covariance = inverse * fit.scatter(to, information, inverse, step) * inverse;
    const VectorN amount = step.tail(kept.cols());
    const MatrixN of_amount = covariance.bottomRightCorner(kept.cols(), kept.cols());
    out.sigmas = as_normal(amount.dot(of_amount.ldlt().solve(amount)), static_cast<double>(kept.cols()));
    const MatrixN shared = information.topLeftCorner(kPoseAndExposure, kPoseAndExposure);
    const VectorN without = shared.ldlt().solve(VectorN(sums.gradient.head(kPoseAndExposure)));
    out.shift = step.head<6>() - without.head<6>();
    const VectorN amounts = kept * amount;
    out.amounts.assign(amounts.begin(), amounts.end());
    out.pose_step = step.head<6>();
    out.exposure_step = {step[6], step[7]};
    return out;
}

}  // namespace narpa
