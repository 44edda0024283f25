/// renderer/assets/calibration_file.h - a camera's calibration in the files of OpenCV and ROS.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "renderer/projection/projection_kind.h"

namespace narpa {

inline constexpr int kMaxPixelsPerSide = 16384;  ///< of a camera's image

struct Calibration {
    int width = 0, height = 0;
    std::shared_ptr<const CameraModel> model;  ///< a pinhole where all of OpenCV's coefficients are 0
    std::vector<std::string> warnings{};       ///< clauses about what the file states and is not used
};

/// YAML: calibrations of ROS (`distortion_model` is plumb_bob, rational_polynomial, equidistant or fisheye),
/// messages camera_info as `ros2 topic echo` prints them, and what OpenCV's calibration samples write
/// (`fisheye_model`). Size and model are those of the image that is read out: of the region `roi`, binned.
/// Rectification is not used. Errors name the file and the line.
[[nodiscard]] Result<Calibration> read_calibration(const std::string& file);

/// The text of a file that both can read; an error if they have no name for the camera's projection.
[[nodiscard]] Result<std::string> calibration_text(const std::string& camera_name, const Calibration& calibration);

}  // namespace narpa
