#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "renderer/assets/calibration_file.h"

namespace narpa {

Result<std::string> calibration_text(const std::string& camera_name, const Calibration& c) {
    const auto [kind, p, coefficients] = opencv_parameters(*c.model);
    if (kind == nullptr || kind->ros.empty()) {
        const ProjectionKind* own = c.model->parameters().kind;
        return Error{fmt::format("camera \"{}\": files of OpenCV and ROS cannot state its projection, {}",
                                 camera_name, own == nullptr ? "of a kind of its own" : own->name)};
    }
    const bool fisheye = kind->opencv == "fisheye";
    const auto model = std::ranges::find_if(
        kind->ros, [n = coefficients.size()](const RosName& name) { return n <= name.parameters_max; });
    const auto list = [](const std::vector<double>& numbers) {
        return fmt::format("[{}]", fmt::join(numbers, ", "));
    };
    const auto matrix = [&](const char* key, int rows, const std::vector<double>& numbers) {
        return fmt::format("{}: !!opencv-matrix\n  rows: {}\n  cols: {}\n  dt: d\n  data: {}\n", key, rows,
                           numbers.size() / static_cast<std::size_t>(rows), list(numbers));
    };
    return fmt::format("%YAML:1.0\n---\nimage_width: {}\nimage_height: {}\ncamera_name: {}\n", c.width, c.height,
                       camera_name) +
           matrix("camera_matrix", 3, {p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1}) +
           fmt::format("distortion_model: {}\n", model->name) + (fisheye ? "fisheye_model: 1\n" : "") +
           matrix("distortion_coefficients", 1, coefficients) +
           matrix("rectification_matrix", 3, {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
           matrix("projection_matrix", 3, {p.fx, 0, p.cx, 0, 0, p.fy, p.cy, 0, 0, 0, 1, 0});
}

}  // namespace narpa
