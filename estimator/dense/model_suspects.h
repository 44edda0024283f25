/// estimator/dense/model_suspects.h - errors of the scene model that residuals are tested for.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "estimator/dense/level_view.h"
#include "estimator/dense/nuisance_fit.h"

namespace narpa {

/// What a suspect's columns are made of: the finest level at the answer, differentiated and rendered with the
/// images' signal and derivative. Columns may render with `settings`, at the same pose.
struct SuspectScene {
    LevelView& view;
    const PhotometricImages& images;
    const Rigid3& T_camera_target;
    const FrameSettings& settings;
    const ModelUncertainty& model;
    double pixels_per_radian;
};

/// An error of the model that no uncertainty states.
struct Suspect {
    std::string_view name;
    std::string_view sentence;  ///< "SENTENCE, by N standard deviations"
    /// Standard deviation of an error that is not told, if the answer is widened by it where the frame cannot test
    /// it (NuisanceFit::covariance); 0: none.
    double prior;
    /// Whether it can be solved with the pose: always, as it changes the pixels' light only; if the model is known
    /// to lack details, as its column is an approximation; or never.
    enum class Solved : std::uint8_t { never, if_details_lack, always } solved;
    /// Largest amount for which its columns are valid, beside as much of the camera's own blur; 0: any.
    double most;
    /// Empty where there can be no such error.
    NuisanceColumns (*columns)(const SuspectScene& scene);
};

[[nodiscard]] std::span<const Suspect> model_suspects() noexcept;

/// A suspect's test.
struct Suspicion {
    const Suspect* suspect = nullptr;
    NuisanceFit fit;
    bool solved = false;  ///< added to the prediction, with the amounts of an earlier test
};

/// Tests all of them. `overconfidence`: DenseEstimate.
[[nodiscard]] std::vector<Suspicion> suspicions(const SuspectScene& scene, const Exposure& exposure,
                                                const Robustness& robust, double overconfidence);

}  // namespace narpa
