#include "renderer/assets/calibration_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "renderer/assets/yaml_file.h"

namespace narpa {
namespace {

YAML::Node part(const YAML::Node& document, const char* key, const char* expected) {
    const YAML::Node node = document[key];
    if (!node) throw YamlFault{fmt::format("expected {}: {}", key, expected), YAML::Mark::null_mark()};
    return node;
}

int pixels(const YAML::Node& document, const char* key) {
    const YAML::Node node = part(document, key, "a number of pixels");
    int n = 0;
    if (!YAML::convert<int>::decode(node, n) || n < 1 || n > kMaxPixelsPerSide)
        throw YamlFault{fmt::format("{}: expected an integer in [1, {}]", key, kMaxPixelsPerSide), node.Mark()};
    return n;
}

std::vector<double> matrix(const YAML::Node& document, const char* key, const char* expected) {
    const YAML::Node node = part(document, key, expected);
    const YAML::Node data = node.IsMap() ? node["data"] : node;
    if (!data || !data.IsSequence())
        throw YamlFault{fmt::format("{}: expected rows, cols and data: [...]", key), node.Mark()};
    std::vector<double> numbers;
    for (const YAML::Node& element : data) {
        double x = 0;
        if (!YAML::convert<double>::decode(element, x) || !std::isfinite(x))
            throw YamlFault{fmt::format("{}: expected finite numbers", key), element.Mark()};
        numbers.push_back(x);
    }
    return numbers;
}

Pinhole read_pinhole(const YAML::Node& document) {
    constexpr double kFar_px = 1e6;
    const auto k = matrix(document, "camera_matrix", "3 x 3 numbers");
    const bool square = k.size() == 9 && k[1] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0 && k[8] == 1;
    if (!square || !(k[0] > 0 && k[0] <= kFar_px) || !(k[4] > 0 && k[4] <= kFar_px) ||
        std::max(std::abs(k[2]), std::abs(k[5])) > kFar_px)
        throw YamlFault{
            "camera_matrix: expected [fx, 0, cx, 0, fy, cy, 0, 0, 1] with fx, fy > 0 and all below 1e6 px",
            document["camera_matrix"].Mark()};
    return {k[0], k[4], k[2], k[5]};
}

const ProjectionKind& kind_of(const YAML::Node& document) {
    if (const YAML::Node node = document["fisheye_model"])
        return *opencv_kind(node.as<int>(0) != 0 ? "fisheye" : "opencv");
    const YAML::Node node = document["distortion_model"];
    const auto name = node ? node.as<std::string>("") : "";
    if (name.empty()) return *opencv_kind("opencv");
    std::vector<std::string_view> known;
    for (const ProjectionKind* kind : projection_kinds())
        for (const RosName& ros : kind->ros) {
            if (ros.name == name) return *kind;
            known.push_back(ros.name);
        }
    const std::string_view last = known.back();
    known.pop_back();
    throw YamlFault{fmt::format("distortion_model \"{}\" is not known here, expected {} or {}", name,
                                fmt::join(known, ", "), last),
                    node.Mark()};
}

std::shared_ptr<const CameraModel> read_model(const YAML::Node& document) {
    ProjectionParameters p{&kind_of(document), read_pinhole(document)};
    if (const YAML::Node node = document["distortion_coefficients"]; node && !node.IsNull())
        p.values = matrix(document, "distortion_coefficients", "numbers");
    constexpr std::size_t kTilted = 14;
    if (p.values.size() == kTilted && p.values[12] == 0 && p.values[13] == 0) p.values.resize(12);
    const bool opencv = p.kind->opencv == "opencv";
    if (opencv && std::ranges::all_of(p.values, [](double c) { return c == 0; }))
        return std::make_shared<Pinhole>(p.pinhole);
    std::shared_ptr<const CameraModel> model = make_projection(p);
    if (!model)
        throw YamlFault{fmt::format("distortion_coefficients: got {}, expected {}", p.values.size(),
                                    opencv ? "4, 5, 8 or 12 (a tilted detector is not in this version)"
                                           : "4, as the model is a fisheye"),
                        document["distortion_coefficients"].Mark()};
    return model;
}

}  // namespace

Result<Calibration> read_calibration(const std::string& file) {
    return read_yaml<Calibration>(file, "a calibration in YAML, as OpenCV and ROS write it",
                                  [](const YAML::Node& document) {
                                      Calibration c;
                                      c.width = pixels(document, "image_width");
                                      c.height = pixels(document, "image_height");
                                      c.model = read_model(document);
                                      return c;
                                  });
}

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
