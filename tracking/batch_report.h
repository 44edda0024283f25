/// tracking/batch_report.h - a batch as text, JSON, CSV and plot, against the truth of the run.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "base/result.h"
#include "estimator/batch/batch_solver.h"
#include "tracking/estimate_report.h"

namespace narpa {

/// What a batch is compared with.
struct BatchTruth {
    BatchValues unknowns{};              ///< what it should find, SI
    std::vector<BatchTime> times;        ///< with the poses of the run, in order of time
    std::vector<EstimateSummary> alone;  ///< of frames and of sweeps that were tracked one after another
};

/// Errors of a batch's trajectory.
struct BatchErrors {
    double rotation_rms_rad = 0, position_rms_m = 0;
    double nees_mean = 0;         ///< of poses, six expected
    double unknowns_nees = 0;     ///< of all unknowns, as many expected as there are
    double largest_of_sigma = 0;  ///< of the unknowns that are determined: |error| / sigma
};
[[nodiscard]] BatchErrors errors_of(const BatchResult& result, const BatchTruth& truth);

[[nodiscard]] std::string to_text(const BatchResult& result, const BatchTruth& truth);
/// The combinations of several unknowns that are not determined, a line each.
[[nodiscard]] std::string undetermined_text(const BatchResult& result);
[[nodiscard]] nlohmann::json undetermined_json(const BatchResult& result);
[[nodiscard]] nlohmann::json to_json(const BatchResult& result, const BatchTruth& truth);
/// A row for each frame and sweep used: what it measures, and the pose of the target at its time.
[[nodiscard]] std::string batch_rows(const BatchResult& result, const BatchTruth& truth);
[[nodiscard]] Status plot_batch(const std::string& path, const std::string& title, const BatchResult& result,
                                const BatchTruth& truth);

}  // namespace narpa
