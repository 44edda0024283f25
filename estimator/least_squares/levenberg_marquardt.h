/// estimator/least_squares/levenberg_marquardt.h - damped least squares over six parameters, on normal equations.
///
/// The paper's appendix B with its misprints corrected: the step (A + lambda D) h = g has the same D, diag(A), as
/// the gain ratio's denominator h . (lambda D h + g); a rejected step multiplies lambda, and with L_up = 11 and
/// L_down = 9 (Gavin, "The Levenberg-Marquardt algorithm for nonlinear least squares curve-fitting problems") the
/// damping cannot return to where it was and cycle. Allocates nothing.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "estimator/pose/pose_estimate.h"

namespace narpa {

/// M = L D L' with L of unit diagonal; of M the lower triangle is read.
class Cholesky6 {
public:
    explicit Cholesky6(const Matrix6& M) {
        double scaled[kSize][kSize];  // L D
#pragma GCC unroll 6
        for (int j = 0; j < kSize; ++j) {
            double d = M(j, j);
#pragma GCC unroll 6
            for (int k = 0; k < j; ++k) d -= scaled[j][k] * L_[j][k];
            positive_ = positive_ && d > 0;
            // A pivot over its diagonal entry does not depend on the row's unit.
            smallest_ = std::min(smallest_, d / M(j, j));
            inverse_d_[j] = 1 / d;
#pragma GCC unroll 6
            for (int i = j + 1; i < kSize; ++i) {
                double l = M(i, j);
#pragma GCC unroll 6
                for (int k = 0; k < j; ++k) l -= scaled[i][k] * L_[j][k];
                scaled[i][j] = l;
                L_[i][j] = l * inverse_d_[j];
            }
        }
    }

    [[nodiscard]] bool positive_definite() const noexcept {
        return positive_;
    }
    /// The smallest pivot over its diagonal entry, in (0, 1]: near rounding if the matrix is rank-deficient.
    [[nodiscard]] double smallest_pivot() const noexcept {
        return smallest_;
    }

    [[nodiscard]] Vector6 solve(const Vector6& b) const {
        double x[kSize];
#pragma GCC unroll 6
        for (int i = 0; i < kSize; ++i) {
            x[i] = b[i];
#pragma GCC unroll 6
            for (int k = 0; k < i; ++k) x[i] -= L_[i][k] * x[k];
        }
        Vector6 out;
#pragma GCC unroll 6
        for (int i = kSize - 1; i >= 0; --i) {
            x[i] *= inverse_d_[i];
#pragma GCC unroll 6
            for (int k = i + 1; k < kSize; ++k) x[i] -= L_[k][i] * x[k];
            out[i] = x[i];
        }
        return out;
    }

    [[nodiscard]] Matrix6 inverse() const {
        Matrix6 out;
        for (int j = 0; j < kSize; ++j) out.col(j) = solve(Vector6::Unit(j));
        return 0.5 * (out + out.transpose());
    }

private:
    static constexpr int kSize = 6;
    double L_[kSize][kSize];
    double inverse_d_[kSize];
    double smallest_ = 1;
    bool positive_ = true;
};

/// Normal equations of residuals e = measured - predicted with weights W: A = J' W J, g = J' W e, chi2 = e' W e (or
/// the robust cost). Only the lower triangle of A is read. `rounding`: the part of chi2 due to rounding of the
/// residuals; a smaller predicted reduction of chi2 is not significant.
struct NormalEquations {
    Matrix6 A = Matrix6::Zero();
    Vector6 g = Vector6::Zero();
    double chi2 = 0;
    double rounding = 0;
};

enum class Damping : std::uint8_t { diagonal, identity };  ///< D = diag(A) or I

struct DampedStep {
    Vector6 h = Vector6::Zero();
    double predicted_reduction = 0;  ///< of chi2 by the linear model; > 0 unless g is 0
    bool solved = false;             ///< false: A + lambda D is not positive definite
};

/// h = (A + lambda D)^-1 g.
[[nodiscard]] inline DampedStep damped_step(const NormalEquations& eq, double lambda,
                                            Damping damping = Damping::diagonal) {
    Matrix6 M = eq.A;
    const Vector6 D = damping == Damping::diagonal ? Vector6(eq.A.diagonal()) : Vector6(Vector6::Ones());
    M.diagonal() += lambda * D;
    const Cholesky6 factor(M);
    DampedStep step;
    if (!factor.positive_definite()) return step;
    step.h = factor.solve(eq.g);
    step.predicted_reduction = step.h.dot(lambda * D.cwiseProduct(step.h) + eq.g);
    step.solved = std::isfinite(step.predicted_reduction);
    return step;
}

/// A^-1. False where A is singular within rounding: some direction is not observable.
[[nodiscard]] inline bool invert_information(const Matrix6& A, Matrix6& inverse) {
    constexpr double kSmallestPivot = 1e-12;
    const Cholesky6 factor(A);
    if (!factor.positive_definite() || !(factor.smallest_pivot() > kSmallestPivot)) return false;
    inverse = factor.inverse();
    return inverse.allFinite();
}

inline constexpr std::size_t kLmIterationsMax = 200;
inline constexpr int kLmPatience = 6;

/// Converged: the undamped step is shorter than step_sigma, or its predicted reduction is below rounding; or, in a
/// curved valley, a step was accepted and chi2 fell by less than chi2_settled, far below its noise, over the last
/// kLmPatience iterations.
struct LmOptions {
    double lambda = 1e-3;      ///< at the start
    double gain_min = 1e-3;    ///< a step is accepted if the gain ratio exceeds this
    double step_sigma = 1e-4;  ///< standard deviations
    double chi2_settled = 3e-3;
    int iterations_max = 100;  ///< steps tried, accepted or not; at most kLmIterationsMax
    Damping damping = Damping::diagonal;
    double up = 11, down = 9;  ///< lambda *= up if a step is rejected, /= down if it is accepted
};

enum class LmStatus : std::uint8_t { converged, no_convergence, no_start };

struct LmSummary {
    LmStatus status = LmStatus::no_start;
    int iterations = 0;                                  ///< steps tried
    NormalEquations equations;                           ///< at the last state that was evaluated
    std::array<double, kLmIterationsMax + 1> chi2_at{};  ///< of the state held after so many iterations

    [[nodiscard]] std::span<const double> costs() const {
        return {chi2_at.data(), static_cast<std::size_t>(iterations) + 1};
    }
};

/// Problem: `bool evaluate(const State&, NormalEquations&) const`, false if the state is impossible (a point behind
/// the camera); `State moved(const State&, const Vector6&) const`. `state`: start value on entry, minimum on
/// return. `summary` is filled in place because it is large.
template <class Problem, class State>
void levenberg_marquardt(const Problem& problem, State& state, const LmOptions& o, LmSummary& summary) {
    constexpr double kLambdaMin = 1e-7, kLambdaMax = 1e7;
    constexpr double kRounding = 1e-14;  // of chi2: a smaller reduction cannot be told from rounding
    const int iterations_max = std::clamp(o.iterations_max, 0, static_cast<int>(kLmIterationsMax));
    NormalEquations& now = summary.equations;
    summary.iterations = 0;
    summary.status = LmStatus::no_start;
    if (!problem.evaluate(state, now) || !std::isfinite(now.chi2)) return;
    summary.chi2_at[0] = now.chi2;
    summary.status = LmStatus::no_convergence;
    double lambda = o.lambda;
    // Rounding changes chi2 by itself and by its product with the residuals. The limit on chi2 keeps the large
    // residuals of a pose that does not fit from ending the iteration early.
    constexpr double kChi2OfAFit = 1e3;
    const auto small = [&](const DampedStep& s) {
        const double unresolved = now.rounding + 2 * std::sqrt(std::min(now.chi2, kChi2OfAFit) * now.rounding);
        return s.predicted_reduction <= std::max({o.step_sigma * o.step_sigma, kRounding * now.chi2, unresolved});
    };
    while (summary.iterations < iterations_max) {
        const DampedStep step = damped_step(now, lambda, o.damping);
        if (step.solved && small(step)) {
            // Damping shortens steps too, so convergence is judged by the undamped step.
            const DampedStep full = damped_step(now, 0, o.damping);
            if (!full.solved || small(full)) {
                if (full.solved) state = problem.moved(state, full.h);
                summary.status = LmStatus::converged;
                return;
            }
        }
        const int i = ++summary.iterations;
        NormalEquations there;
        bool taken = false;
        if (step.solved) {
            const State candidate = problem.moved(state, step.h);
            taken =
                problem.evaluate(candidate, there) && now.chi2 - there.chi2 > o.gain_min * step.predicted_reduction;
            if (taken) state = candidate, now = there;
        }
        summary.chi2_at[static_cast<std::size_t>(i)] = now.chi2;
        if (taken && i >= kLmPatience &&
            summary.chi2_at[static_cast<std::size_t>(i - kLmPatience)] - now.chi2 < o.chi2_settled) {
            summary.status = LmStatus::converged;
            return;
        }
        if (!taken && lambda >= kLambdaMax) return;
        lambda = taken ? std::max(lambda / o.down, kLambdaMin) : std::min(lambda * o.up, kLambdaMax);
    }
}

}  // namespace narpa
