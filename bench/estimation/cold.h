/// bench/estimation/cold.h - pose estimation without an initial guess: random attitudes, ranges and Sun directions,
/// and the errors of the answers.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/stop.h"
#include "emulator/threads.h"
#include "protocols/estimate.h"
#include "renderer/scene/scene.h"

namespace narpa {

struct ColdOptions {
    std::vector<std::string> targets{"craft",
                                     "detailed"};  ///< of consistency_scenes.h, or bodies of the docking scene
    int trials = 60;
    int size = 96;            ///< pixels of the longer side of the camera
    double range_part = 0.3;  ///< the expected range is off by up to this part of the true one
    double phase_deg = 100;   ///< most angle at the target between the Sun and the camera
    bool noise_known = true;  ///< the search is told the sampling noise of the frames
    std::uint64_t seed = 1;
};

struct ColdTrial {
    int number = 0;
    std::string target;
    AnswerKind answer = AnswerKind::refused;
    std::string why;
    double range_in_radii = 0, phase_deg = 0;
    double nees = 0, rotation_rad = 0, position_of_range = 0;  ///< where there is a pose
    double cpu_s = 0;                                          ///< of the search, all threads
    int templates = 0, renders = 0;

    /// A good answer that is not the truth within its covariance: kSixSigmaNees.
    [[nodiscard]] bool wrong() const;
};

/// A trial depends on its number, the seed and the options alone. `docking`: the scene with the station. Errors: no
/// such target.
[[nodiscard]] Result<std::vector<ColdTrial>> run_cold(const ColdOptions& options, const Scene& docking, int first,
                                                      TracingThreads& threads,
                                                      const std::function<void(const ColdTrial&)>& progress,
                                                      const StopFlag& stop);

[[nodiscard]] nlohmann::json to_json(const std::vector<ColdTrial>& trials);
[[nodiscard]] std::string to_text(const std::vector<ColdTrial>& trials);

}  // namespace narpa
