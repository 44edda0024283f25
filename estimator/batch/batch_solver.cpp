#include "estimator/batch/batch_solver.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "estimator/batch/batch_costs.h"
#include "estimator/batch/batch_covariance.h"
#include "estimator/batch/batch_nodes.h"
#include "estimator/batch/batch_problem.h"

namespace narpa {
namespace {

/// Settled: the unknowns move by less, in their priors' standard deviations.
constexpr double kSettled = 5e-4;
/// LiDAR points are associated again in so many linearisations: the same few points can change to and fro.
constexpr int kAssociations = 8;
/// Far from the solution all frames and sweeps are as wrong as the model: none is left out in the first
/// linearisations.
constexpr int kWithoutLoss = 3;

Status check(const BatchInput& input, const BatchOptions& options) {
    if (auto good = narpa::check(options.motion); !good) return good;
    if (!input.frames.empty() && !input.camera) return Error{"frames have no camera model"};
    if (!input.sweeps.empty() && !input.tracer) return Error{"sweeps have no model of the target"};
    for (std::size_t i = 0; i < kBatchUnknowns; ++i)
        if (!(options.prior_sigma[i] >= 0 && std::isfinite(options.prior_sigma[i])))
            return Error{fmt::format("{}: the prior's standard deviation is {}, expected 0 or more",
                                     batch_unknowns()[i].name, options.prior_sigma[i])};
    if (options.path && !(options.path->rotation_rad > 0 && options.path->position_m > 0))
        return Error{"standard deviations of the commanded poses: expected more than 0"};
    if (!options.has_motion && (options.path || at(options.prior_sigma, BatchUnknown::clock) > 0))
        return Error{"poses without motion have neither path nor clock"};
    return Ok{};
}

/// Unknowns that do not act on what is measured remain known.
BatchValues priors_in_use(const BatchInput& input, const BatchOptions& options) {
    BatchValues sigmas = options.prior_sigma;
    const auto has_brightness = [](const BatchFrame& f) { return !f.brightness.blocks.empty(); };
    if (std::ranges::none_of(input.frames, has_brightness))
        for (const BatchUnknown u : kBrightnessUnknowns) at(sigmas, u) = 0;
    for (std::size_t i = 0; i < kBatchUnknowns; ++i)
        if (!is_of_sensors(batch_unknowns()[i], !input.frames.empty(), !input.sweeps.empty())) sigmas[i] = 0;
    return sigmas;
}

}  // namespace

Result<BatchResult> solve_batch(const BatchInput& input, const BatchOptions& options) {
    if (auto good = check(input, options); !good) return good.error();
    BatchProblem problem(input, options, priors_in_use(input, options));
    if (problem.nodes() < fewest_times(options))
        return Error{fmt::format("frames and sweeps with a pose at {} times, expected at least {}", problem.nodes(),
                                 fewest_times(options))};
    BatchResult out;
    for (out.linearisations = 1; out.linearisations <= options.linearisations; ++out.linearisations) {
        const Status linear =
            problem.linearise(out.linearisations <= kAssociations, out.linearisations > kWithoutLoss);
        if (!linear) return linear.error();
        const auto solved = problem.solve();
        if (!solved) return solved.error();
        if (out.linearisations == 1) out.cost_start = solved->cost_start;
        out.cost = solved->cost, out.iterations += solved->iterations, out.solver = solved->solver;
        out.parameters = solved->parameters, out.numbers = solved->numbers;
        out.settled = solved->moved < kSettled && out.linearisations > kWithoutLoss;
        if (out.settled) break;
    }
    out.linearisations = std::min(out.linearisations, options.linearisations);
    problem.report(out);
    if (auto good = add_covariance(problem, out); !good) return good.error();
    return out;
}

}  // namespace narpa
