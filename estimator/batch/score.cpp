#include "estimator/batch/score.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace narpa {
namespace {

constexpr double kStudent = 5;
constexpr double kScatterMax = 1e6;
constexpr Eigen::Index kPose = 6;
/// With fewer degrees of freedom left the scatter is not known.
constexpr double kFewestFreedom = 3;
/// Eigenvalues of the score's covariance, scaled to a unit diagonal, below this part of the largest are rounding.
constexpr double kRankTolerance = 1e-9;

/// Residuals and Jacobian in units of the errors at one scatter.
class Whitened {
public:
    Whitened(const Measurement& m, const Residuals& r, const Eigen::MatrixXd& jacobian, double scatter)
        : m_(m),
          d_(m.dimension()),
          factors_(static_cast<std::size_t>(r.value.size() / d_)),
          e_(r.value),
          X_(jacobian) {
        for (std::size_t i = 0; i < factors_.size(); ++i) {
            const Eigen::Matrix2d S = m.noise(i) + scatter * m.beyond(i);
            factors_[i] = d_ == 1 ? Eigen::Matrix2d(std::sqrt(S(0, 0)) * Eigen::Matrix2d::Identity())
                                  : Eigen::Matrix2d(S.llt().matrixL());
            const auto L = factors_[i].topLeftCorner(d_, d_).triangularView<Eigen::Lower>();
            L.solveInPlace(e_.segment(row(i), d_));
            if (X_.size() > 0) L.solveInPlace(X_.middleRows(row(i), d_));
        }
    }

    [[nodiscard]] std::size_t groups() const { return factors_.size(); }
    [[nodiscard]] Eigen::Index row(std::size_t i) const { return static_cast<Eigen::Index>(i) * d_; }
    [[nodiscard]] auto X(std::size_t i) const { return X_.middleRows(row(i), d_); }
    [[nodiscard]] const Eigen::MatrixXd& X() const { return X_; }
    [[nodiscard]] auto e(std::size_t i) const { return e_.segment(row(i), d_); }
    [[nodiscard]] double squared(std::size_t i) const { return e(i).squaredNorm(); }
    [[nodiscard]] double weight(std::size_t i) const {
        return (kStudent + m_.numbers(i)) / (kStudent + squared(i));
    }
    /// L^-1 of group i, from the left.
    [[nodiscard]] Eigen::MatrixXd solved(std::size_t i, const Eigen::MatrixXd& m) const {
        return factors_[i].topLeftCorner(d_, d_).triangularView<Eigen::Lower>().solve(m);
    }
    [[nodiscard]] double weighted_chi2() const {
        double sum = 0;
        for (std::size_t i = 0; i < groups(); ++i) sum += weight(i) * squared(i);
        return sum;
    }

private:
    const Measurement& m_;
    int d_;
    std::vector<Eigen::Matrix2d> factors_;
    Eigen::VectorXd e_;
    Eigen::MatrixXd X_;
};

/// The scatter at which the weighted sum of squares is equal to its degrees of freedom.
double scatter_of(const Measurement& m, const Residuals& r, double freedom) {
    const Eigen::MatrixXd none;
    const auto chi2 = [&](double scatter) { return Whitened(m, r, none, scatter).weighted_chi2(); };
    double low = m.scatter_min(), high = std::max(1.0, 2 * low);
    if (chi2(low) <= freedom) return low;
    while (chi2(high) > freedom && high < kScatterMax) low = high, high *= 4;
    constexpr int kBisections = 30;
    for (int k = 0; k < kBisections; ++k) {
        const double middle = 0.5 * (low + high);
        (chi2(middle) > freedom ? low : high) = middle;
    }
    return high;
}

/// Columns of the Jacobian for what the measurement fits alone: its pose, or its unknowns.
Eigen::MatrixXd own_columns(const Measurement& m, const Eigen::MatrixXd& jacobian) {
    return m.has_pose() ? jacobian.leftCols(kPose) : jacobian.rightCols(jacobian.cols() - kPose);
}

/// The residuals about the measurement's own solution: what scatter and weights follow from, so that neither the
/// motion model nor other measurements make a frame look noisy.
Residuals about_own_solution(const Measurement& m, const Residuals& r, double freedom) {
    constexpr int kSteps = 3;
    Residuals own = r;
    const Eigen::MatrixXd columns = own_columns(m, r.jacobian);
    for (int step = 0; step < kSteps; ++step) {
        const Whitened w(m, own, columns, scatter_of(m, own, freedom));
        Eigen::MatrixXd information = Eigen::MatrixXd::Zero(columns.cols(), columns.cols());
        Eigen::VectorXd pull = Eigen::VectorXd::Zero(columns.cols());
        for (std::size_t i = 0; i < w.groups(); ++i) {
            information += w.weight(i) * w.X(i).transpose() * w.X(i);
            pull += w.weight(i) * w.X(i).transpose() * w.e(i);
        }
        own.value -= columns * information.completeOrthogonalDecomposition().solve(pull);
    }
    return own;
}

/// Sum over pairs of groups that share errors.
Eigen::MatrixXd shared_information(const Measurement& m, const Whitened& w) {
    const Eigen::Index k = w.X().cols();
    Eigen::MatrixXd sum = Eigen::MatrixXd::Zero(k, k);
    if (!m.has_shared()) return sum;
    Eigen::MatrixXd neighbours(m.dimension(), k);
    for (std::size_t i = 0; i < w.groups(); ++i) {
        neighbours.setZero();
        for (std::size_t j = 0; j < i; ++j)
            if (const double part = m.shared(i, j); part > 0) neighbours += part * w.X(j);
        sum += w.X(i).transpose() * neighbours;
    }
    return sum + sum.transpose();
}

/// Factor on the covariance of robust estimates with these weights, whose derivative is taken with constant
/// weights, so that H G^-1 H is right: Huber's E[psi^2] / E[psi']^2, times E[w]^2.
double robust_factor(const Measurement& m, const Whitened& w, bool scatter_is_least) {
    double slope = 0, squares = 0, weights = 0, n = 0;
    for (std::size_t i = 0; i < w.groups(); ++i) {
        const double s = w.squared(i), weight = w.weight(i), numbers = m.numbers(i);
        slope += weight * (numbers - 2 * s / (kStudent + s));
        squares += weight * weight * s;
        weights += weight * numbers;
        n += numbers;
    }
    double factor = squares * n / (slope * slope);
    if (scatter_is_least)
        factor = std::max(1.0, factor);  // small residuals may be of errors that all have in common
    return factor * (weights / n) * (weights / n);
}

/// Rows R with R G R' = 1, of the directions in which G is not 0.
Eigen::MatrixXd inverse_root(const Eigen::MatrixXd& G) {
    const Eigen::VectorXd scale = G.diagonal().unaryExpr([](double v) { return v > 0 ? 1 / std::sqrt(v) : 0.0; });
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * G * scale.asDiagonal());
    const Eigen::VectorXd& values = eigen.eigenvalues();
    const Eigen::Index rank = (values.array() > kRankTolerance * values.maxCoeff()).count();
    const Eigen::VectorXd roots = values.tail(rank).cwiseSqrt().cwiseInverse();
    return roots.asDiagonal() * eigen.eigenvectors().rightCols(rank).transpose() * scale.asDiagonal();
}

/// Factor, at least 1, by which the scatter of the own columns' score exceeds G: its parts, on squares of the
/// image, share errors of model and light (clustered residuals: Liang and Zeger 1986), as in
/// ModelMatches::inflation.
double part_factor(const Measurement& m, const Whitened& w, const Eigen::MatrixXd& G) {
    const Eigen::MatrixXd own = own_columns(m, w.X());
    const Eigen::Index unknowns = own.cols();
    if (m.parts() == 0 || unknowns == 0) return 1;
    Eigen::MatrixXd pulls = Eigen::MatrixXd::Zero(unknowns, static_cast<Eigen::Index>(m.parts()));
    std::vector<int> members(m.parts());
    for (std::size_t i = 0; i < w.groups(); ++i) {
        pulls.col(static_cast<Eigen::Index>(m.part(i))) +=
            w.weight(i) * own.middleRows(w.row(i), m.dimension()).transpose() * w.e(i);
        ++members[m.part(i)];
    }
    const auto parts = static_cast<double>(std::ranges::count_if(members, [](int n) { return n > 0; }));
    const auto estimated = static_cast<double>(unknowns);
    const double few = parts / std::max(1.0, parts - estimated);
    const Eigen::Index first = m.has_pose() ? 0 : kPose;
    const Eigen::MatrixXd scatter = pulls * pulls.transpose(), expected = G.block(first, first, unknowns, unknowns);
    return std::max(1.0, few * expected.ldlt().solve(scatter).trace() / estimated);
}

}  // namespace

Score score_of(const Measurement& m, const Residuals& at_solution, const std::vector<Eigen::Index>& columns,
               double variance_factor) {
    Score out;
    const int d = m.dimension();
    const auto n = static_cast<double>(at_solution.value.size());
    if (n > 0) out.rms = std::sqrt(at_solution.value.squaredNorm() * d / n);
    out.freedom = -static_cast<double>(own_columns(m, at_solution.jacobian).cols());
    for (Eigen::Index i = 0; i < at_solution.value.size() / d; ++i)
        out.freedom += m.numbers(static_cast<std::size_t>(i));
    if (!(out.freedom >= kFewestFreedom)) return out;
    const Residuals r = about_own_solution(m, at_solution, out.freedom);
    const Eigen::MatrixXd jacobian = r.jacobian(Eigen::all, columns);
    // Points that share errors are fewer independent ones.
    if (m.has_shared()) {
        const Whitened at_first(m, r, jacobian, scatter_of(m, r, out.freedom));
        const Eigen::MatrixXd pose = at_first.X().leftCols<6>();
        const Eigen::Matrix<double, 6, 6> information = pose.transpose() * pose;
        const Eigen::Matrix<double, 6, 6> overlap = shared_information(m, at_first).topLeftCorner<6, 6>();
        out.freedom -= information.ldlt().solve(overlap).trace();
        if (!(out.freedom >= kFewestFreedom)) return out;
    }
    out.scatter = scatter_of(m, r, out.freedom);
    const Whitened w(m, r, jacobian, out.scatter);

    Eigen::MatrixXd information = w.X().transpose() * w.X();
    information += shared_information(m, w);
    Eigen::MatrixXd common = Eigen::MatrixXd::Zero(jacobian.cols(), d), weighted(jacobian.cols(), r.value.size());
    for (std::size_t i = 0; i < w.groups(); ++i) {
        const double weight = w.weight(i);
        out.downweighted += (weight < 0.25 * (1 + m.numbers(i) / kStudent)) / static_cast<double>(w.groups());
        const Eigen::MatrixXd root = w.solved(i, Eigen::MatrixXd::Identity(d, d));
        weighted.middleCols(w.row(i), d) = weight * w.X(i).transpose() * root;
        common += weight * m.common(i) * w.X(i).transpose() * root;
    }
    // Weights that are estimated from few residuals each (P. Meier, "Variance of a weighted mean", Biometrics 9,
    // 1953).
    const double few = out.freedom / std::max(1.0, out.freedom - 4);
    Eigen::MatrixXd G = robust_factor(m, w, out.scatter <= m.scatter_min()) * few * m.inflation() * information;
    G += common * common.transpose();
    out.whitening = inverse_root(variance_factor * part_factor(m, w, G) * G) * weighted;
    return out;
}

}  // namespace narpa
