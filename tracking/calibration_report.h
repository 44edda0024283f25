/// tracking/calibration_report.h - text, JSON, CSV and plot of a camera's calibration (camera_calibration.h).
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tracking/camera_calibration.h"

namespace narpa {

[[nodiscard]] std::string to_text(const CameraCalibration& calibration);
/// All but the points.
[[nodiscard]] nlohmann::json to_json(const CameraCalibration& calibration);
/// CSV with a row for each image.
[[nodiscard]] std::string calibration_rows(const CameraCalibration& calibration);
/// Draws residuals over the image, each by itself and of each image. `width`, `height`: of the camera, px.
[[nodiscard]] Status plot_calibration(const std::string& path, const std::string& title, int width, int height,
                                      const CameraCalibration& calibration);

}  // namespace narpa
