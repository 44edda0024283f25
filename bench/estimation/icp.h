/// bench/estimation/icp.h - ICP of LiDAR sweeps against the model from many starts: success rate, error beside its
/// bound, time.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "emulator/world.h"

namespace narpa {

/// Starts, each with its own sweep: off the truth by the angle about a random axis, and by the fraction of the
/// distance in a random direction.
struct IcpStarts {
    double start_angle_deg = 5;
    double start_distance_fraction = 0.05;
    int starts = 1000;
};

/// The LiDAR's distances from the target's origin.
inline constexpr double kIcpDistanceMin_m = 10, kIcpDistanceMax_m = 40;

/// `to_bound`: root mean square of the error over the bound's standard deviation, three axes together.
struct IcpRun : IcpStarts {
    int found = 0;       ///< within ten standard deviations of the bound that holds at the truth
    int told = 0;        ///< of the others, those that the estimator itself calls not credible
    int unobserved = 0;  ///< of the found, those with unobservable motions; excluded below
    double rotation_rms_deg = 0, translation_rms_m = 0;
    double rotation_to_bound = 0, translation_to_bound = 0;
    double nees = 0;                                    ///< mean; six for a consistent estimator
    double points = 0, iterations = 0;                  ///< mean
    double microseconds_p50 = 0, microseconds_p99 = 0;  ///< of an alignment: CPU time of its one thread

    [[nodiscard]] double found_fraction() const { return static_cast<double>(found) / starts; }
};

/// `target`: the body's index. `progress` is called with the starts done and the total.
[[nodiscard]] std::vector<IcpRun> run_icp(const World& world, std::size_t target,
                                          const std::vector<IcpStarts>& starts,
                                          const std::function<void(int, int)>& progress);

[[nodiscard]] nlohmann::json to_json(const std::vector<IcpRun>& runs);
/// A table, a line for each.
[[nodiscard]] std::string to_text(const std::vector<IcpRun>& runs);

}  // namespace narpa
