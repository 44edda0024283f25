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
#include <span>

#include "estimator/pose/pose_estimate.h"

namespace narpa {

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

/// h = (A + lambda D)^-1 g. The one place where damped normal equations are solved: the loop below and the dense
/// alignment's (level_solver.h) differ in how a step is accepted.
[[nodiscard]] DampedStep damped_step(const NormalEquations& eq, double lambda, Damping damping = Damping::diagonal);

/// A^-1. False where A is singular within rounding: some direction is not observable.
[[nodiscard]] bool invert_information(const Matrix6& A, Matrix6& inverse);

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
