/// bench/convergence_plot.h - a convergence as a picture: error over samples and error over time, log-log.
#pragma once

#include <span>
#include <string>

#include "base/result.h"
#include "bench/convergence.h"

namespace narpa {

struct ConvergencePlot {
    std::string title;
    std::span<const ErrorRow> rows;
    std::span<const double> seconds;  ///< a picture, for each row
    double level = 1;                 ///< mean radiance of the picture: what the error is a part of
};

/// Writes a PNG. Rows without error (rmse 0) are left out.
[[nodiscard]] Status write_plot(const std::string& path, const ConvergencePlot& plot);

}  // namespace narpa
