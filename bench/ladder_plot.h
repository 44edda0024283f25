/// bench/ladder_plot.h - ladders of budgets as a picture: for each scene error over time, log-log, and
/// where the time of each budget goes.
#pragma once

#include <span>
#include <string>

#include "base/result.h"
#include "bench/gates.h"

namespace narpa {

/// Writes a PNG with a panel for each scene. Rungs without error (rmse 0) are left out.
[[nodiscard]] Status write_plot(const std::string& path, const std::string& title,
                                std::span<const SceneLadder> scenes);

}  // namespace narpa
