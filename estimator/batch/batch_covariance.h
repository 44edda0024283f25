/// estimator/batch/batch_covariance.h - covariance of a batch's solution, and what the run does not determine.
#pragma once

#include "estimator/batch/batch_problem.h"

namespace narpa {

/// Sets unknowns, covariance, undetermined combinations and states. Errors: a singular problem.
[[nodiscard]] Status add_covariance(BatchProblem& problem, BatchResult& out);

}  // namespace narpa
