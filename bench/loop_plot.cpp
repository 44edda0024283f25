// The plot of bench/loop.h: for each camera and each run how many frames exceed which time.
#include <cmath>
#include <nlohmann/json.hpp>

#include "bench/loop.h"
#include "plot/plot.h"

namespace narpa {
namespace {

/// Pairs of ms and the fraction of the frames that exceed it, down to the one frame that took longest: each of the
/// last hundred, before them fewer and fewer. `least_ms`: a logarithmic axis needs a positive number.
template <class H>
nlohmann::json exceedance(const H& h, double least_ms) {
    nlohmann::json points = nlohmann::json::array();
    const auto n = static_cast<double>(h.count());
    for (double k = n; k >= 1; k = std::min(k - 1, std::floor(k * (k > 100 ? 0.97 : 1))))
        points.push_back({std::max(least_ms, h.percentile_ns((n - k + 1) / n) * 1e-6), k / n});
    return points;
}

}  // namespace

Status plot_loop(const std::string& path, const std::string& title, const std::vector<LoopRun>& runs) {
    constexpr double kLeast_ms = 1e-3;
    nlohmann::json of_runs = nlohmann::json::array();
    for (const LoopRun& run : runs) {
        nlohmann::json cameras = nlohmann::json::array();
        for (const CameraRun& c : run.cameras)
            cameras.push_back({{"name", c.name},
                               {"wake_late_ms", exceedance(c.stats.wake_late, kLeast_ms)},
                               {"hand_over_ms", exceedance(c.stats.hand_over, kLeast_ms)},
                               {"late_ms", exceedance(c.stats.late, -1e9)}});
        of_runs.push_back({{"name", run.name}, {"cameras", cameras}});
    }
    return write_plot(path, {{"plot", "loop"}, {"title", title}, {"runs", of_runs}});
}

}  // namespace narpa
