/// bench/estimation/pnp_methods.h - the solvers that the bench of poses from points compares: narpa's, OpenCV's and
/// Ceres's.
#pragma once

#include "bench/estimation/pnp.h"

namespace narpa {

struct PoseResult {
    std::optional<Rigid3> T_camera_body;
    bool flagged = false;  ///< the solver calls it ambiguous or imprecise
};

struct PnpMethod {
    std::string name;
    /// `start`: the tracked pose, for methods that need one.
    std::function<PoseResult(const PnpTrial&, const Rigid3& start)> solve;
};

/// Those that take points of this setting. Copies share their memory.
[[nodiscard]] std::vector<PnpMethod> pnp_methods(const PnpSetting& setting);

}  // namespace narpa
