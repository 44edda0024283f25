/// bench/estimation/stereo.h - depth from two frames of a scene, by whole pixels as in the paper's section V and by
/// subpixel matches, against the tracer's ranges.
#pragma once

#include <array>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "estimator/stereo/stereo_matcher.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// One feature. Positions in the left camera's frame, m; the truth is where the ray through the left pixel meets
/// the scene.
struct StereoBenchPoint {
    Eigen::Vector2d left_px{0, 0}, right_px{0, 0};
    Eigen::Vector3d truth_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d whole_error_m = Eigen::Vector3d::Zero();  ///< the printed formula, whole pixels
    Eigen::Vector3d fine_error_m = Eigen::Vector3d::Zero();   ///< maximum likelihood, between pixels
    double sigma_depth_m = 0;                                 ///< predicted for the latter
    double epipolar_sigmas = 0;
};

/// Statistics of absolute values: quartiles; whiskers to the last value within 1.5 interquartile ranges of the box
/// (Tukey 1977); the number beyond.
struct Spread {
    std::array<double, 2> whiskers{};
    double lower_quartile = 0, median = 0, upper_quartile = 0;
    double largest = 0, rms = 0;
    int outliers = 0;
};
[[nodiscard]] Spread spread(std::vector<double> values);

struct StereoBench {
    std::string scene;
    StereoPair pair;
    MeasuredImage left;
    double left_top_dn = 1;
    std::vector<StereoBenchPoint> points;
    StereoCounts counts;
    double render_s = 0, match_s = 0;

    /// Errors along one axis (0 x, 1 y, 2 z), m; `relative`: divided by the point's range.
    [[nodiscard]] Spread errors(bool fine, int axis, bool relative) const;
    /// RMS depth error over range by whole pixels, over that by subpixel matches.
    [[nodiscard]] double gain() const;
    /// Means of the squared errors in predicted standard deviations, along the ray and across the epipolar line; 1
    /// is expected.
    [[nodiscard]] double mean_normalised_squared() const;
    [[nodiscard]] double mean_epipolar_squared() const;
};

/// Renders the scene's cameras `left` and `right`, exposes them with their detectors and matches so many points.
/// `progress` is called with each step. Errors: no such cameras; no surface in the middle of the left frame; what
/// match_stereo says; a match whose left pixel sees no surface.
[[nodiscard]] Result<StereoBench> measure_stereo(const Scene& scene, int points,
                                                 const std::function<void(const std::string&)>& progress);

/// What is wrong, one sentence each: fewer points than this, a gain below 5, errors that are not as predicted
/// (means off 1 by a factor of 1.5 and beyond three standard errors). Empty: nothing.
inline constexpr double kMinStereoGain = 5, kVarianceFactor = 1.5;
[[nodiscard]] std::vector<std::string> stereo_faults(const StereoBench& bench, int points);

[[nodiscard]] nlohmann::json to_json(const StereoBench& bench);
/// A table.
[[nodiscard]] std::string to_text(const StereoBench& bench);
/// Plots (plot/plot.h) the matches over the left frame, and the errors in x, y and z both ways, absolute and over
/// range.
[[nodiscard]] Status plot_stereo(const std::string& path, const StereoBench& bench);

}  // namespace narpa
