/// tracking/estimate_report.h - how well poses were estimated over many frames: rows, a summary, a picture.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <string_view>

#include "tracking/target_tracker.h"

namespace narpa {

/// First line of CAMERA.estimate.csv.
inline constexpr std::string_view kEstimateHeader =
    "frame,t_ns,state,x_m,y_m,z_m,qw,qx,qy,qz,sigma_rx_rad,sigma_ry_rad,sigma_rz_rad,sigma_x_m,sigma_y_m,sigma_z_m,"
    "error_rotation_rad,error_position_m,filtered_error_rotation_rad,filtered_error_position_m,nees,nis,"
    "bound_rotation_rad,bound_position_m,matches,renders,ms,answer,why";
/// One row, with its line end: the pose that the frame alone gives, with its errors against the truth. Missing
/// values are empty.
[[nodiscard]] std::string estimate_row(const TrackedFrame& frame);

/// Its class, why it is not good, the unobservable motions, and other poses that are as likely.
[[nodiscard]] nlohmann::json to_json(const Answer& answer);
[[nodiscard]] nlohmann::json to_json(const Rigid3& pose);

/// Over the frames (or sweeps) that gave a pose; RMS of the errors' lengths, in rotation and in position.
struct EstimateSummary {
    std::size_t frames = 0, measured = 0;                    ///< all; those whose pose the filter accepted
    std::array<std::size_t, kAnswerKinds.size()> answers{};  ///< frames of each class
    /// Good answers whose error is beyond 6 sigma (kSixSigmaNees): failures that were not detected.
    std::size_t beyond = 0;
    double rotation_rms_rad = 0, position_rms_m = 0, position_rms_of_range = 0;
    double filtered_rotation_rms_rad = 0, filtered_position_rms_m = 0;  ///< over all frames with a track
    /// Of observed motions only, and what it is if the covariances are correct: the mean number of these, 6 if all
    /// are observed.
    double nees_mean = 0, nees_expected = 0;
    double nees_low = 0, nees_high = 0;  ///< 95 % interval of a mean over this many frames, if they are correct
    double nis_mean = 0, nis_expected = 0;
    double rotation_of_bound = 0, position_of_bound = 0;  ///< RMS of error / Cramer-Rao bound; 0: no bound
    double ms_median = 0, ms_max = 0;
};
/// With a correct covariance, five of 10^9 answers have a larger NEES: about as few as a normal variable has beyond
/// 6 sigma.
inline constexpr double kSixSigmaNees = 50;
struct NeesBand {
    double low = 0, high = 0;
};
/// 95 % interval of the NEES of one pose of which this many motions are observed, 1 to 6, if the covariance is
/// correct.
[[nodiscard]] NeesBand nees_band(int observed);
/// The interpretation of a NEES as text: "inside: the errors are as the covariances say".
[[nodiscard]] std::string nees_verdict(double nees, double low, double high);
[[nodiscard]] EstimateSummary summarise(std::span<const TrackedFrame> frames);
[[nodiscard]] nlohmann::json to_json(const EstimateSummary& summary);
/// `item`: what the poses were estimated from, "frame" or "sweep".
[[nodiscard]] std::string to_text(const EstimateSummary& summary, std::string_view item = "frame");

/// Plots (plot/plot.h) the errors of every frame over time, in rotation and in position, with three standard
/// deviations and the Cramer-Rao bound.
Status plot_estimates(const std::string& path, const std::string& title, std::span<const TrackedFrame> frames);

}  // namespace narpa
