/// estimator/filter/discretise.h - discretisation of a linear system driven by white noise.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace narpa {

/// x(t + dt) = transition x(t) + integral u + w for x' = F x + u + noise, u constant, the noise white of power
/// spectral density Qc (units of x'^2 s): w has the covariance `noise`.
template <int N>
struct Discrete {
    using Matrix = Eigen::Matrix<double, N, N>;
    Matrix transition, integral, noise;
};

/// Exact to rounding: power series over a short step, then doubling (the quantities of C. Van Loan, "Computing
/// integrals involving the matrix exponential", 1978).
template <int N>
[[nodiscard]] Discrete<N> discretise(const Eigen::Matrix<double, N, N>& F, const Eigen::Matrix<double, N, N>& Qc,
                                     double dt_s) {
    using Matrix = Eigen::Matrix<double, N, N>;
    constexpr int kTerms = 14;  // 0.5^14 / 14! is 7e-16
    int doublings = 0;
    double h = dt_s;
    const double size = F.cwiseAbs().rowwise().sum().maxCoeff();
    for (; size * std::abs(h) > 0.5; ++doublings) h *= 0.5;

    Discrete<N> d{Matrix::Identity(), h * Matrix::Identity(), h * Qc};
    Matrix power = Matrix::Identity(), lyapunov = h * Qc;
    for (int k = 1; k < kTerms; ++k) {
        power = (h / k) * (F * power);
        d.transition += power;
        d.integral += (h / (k + 1)) * power;
        const Matrix half = F * lyapunov;
        lyapunov = (h / (k + 1)) * (half + half.transpose());
        d.noise += lyapunov;
    }
    for (; doublings > 0; --doublings) {
        d.noise += (d.transition * d.noise * d.transition.transpose()).eval();
        d.integral += (d.transition * d.integral).eval();
        d.transition = (d.transition * d.transition).eval();
    }
    return d;
}

}  // namespace narpa
