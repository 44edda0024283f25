/// emulator/log/estimate_report.h - how well poses were estimated over many frames: rows, a summary, a picture.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>

#include "emulator/frame_tracker.h"

namespace narpa {

/// First line of CAMERA.estimate.csv.
inline constexpr std::string_view kEstimateHeader =
    "frame,t_ns,state,x_m,y_m,z_m,qw,qx,qy,qz,sigma_rx_rad,sigma_ry_rad,sigma_rz_rad,sigma_x_m,sigma_y_m,sigma_z_m,"
    "error_rotation_rad,error_position_m,filtered_error_rotation_rad,filtered_error_position_m,nees,nis,"
    "bound_rotation_rad,bound_position_m,matches,renders,ms,answer,why";
/// One row, with its line end: the pose that the frame alone gives, with its errors against the truth. Missing
/// values are empty.
[[nodiscard]] std::string estimate_row(const TrackedFrame& frame);

/// Its class, why it is not good, the motions that are not observed, and other poses that are as likely.
[[nodiscard]] nlohmann::json to_json(const Answer& answer);
[[nodiscard]] nlohmann::json to_json(const Rigid3& pose);

/// Over the frames that gave a pose; RMS of the errors' lengths, in rotation and in position.
struct EstimateSummary {
    std::size_t frames = 0, measured = 0;                    ///< all; those whose pose the filter accepted
    std::array<std::size_t, kAnswerKinds.size()> answers{};  ///< frames of each class
    /// Of the good answers, those whose error is beyond 6 sigma (kBeyondNees): wrong in silence.
    std::size_t beyond = 0;
    double rotation_rms_rad = 0, position_rms_m = 0, position_rms_of_range = 0;
    double filtered_rotation_rms_rad = 0, filtered_position_rms_m = 0;  ///< over all frames with a track
    double nees_mean = 0;                                               ///< 6 where the covariances are right
    double nees_low = 0, nees_high = 0;  ///< 95 % of means over so many frames lie between, if they are
    double nis_mean = 0;
    double rotation_of_bound = 0, position_of_bound = 0;  ///< RMS of error / Cramer-Rao bound; 0: no bound
    double ms_median = 0, ms_most = 0;
};
/// A right covariance has a larger NEES in five of 10^9 answers, as few as a normal variable beyond 6 sigma.
inline constexpr double kBeyondNees = 50;
/// 95 % of the NEES of one pose lie between (chi-square with 6 degrees of freedom), where the covariance is right.
inline constexpr double kNeesLow = 1.237, kNeesHigh = 14.449;
/// Where a NEES lies, and what follows: "inside: the errors are as the covariances say".
[[nodiscard]] std::string nees_verdict(double nees, double low, double high);
[[nodiscard]] EstimateSummary summarise(std::span<const TrackedFrame> frames);
[[nodiscard]] nlohmann::json to_json(const EstimateSummary& summary);
[[nodiscard]] std::string in_words(const EstimateSummary& summary);

/// Plots (plot/plot.h) the errors of every frame over time, in rotation and in position, within three standard
/// deviations and above the bound.
Status plot_estimates(const std::string& path, const std::string& title, std::span<const TrackedFrame> frames);

}  // namespace narpa
