#include "renderer/assets/calibration_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/assets/yaml_file.h"

namespace narpa {
namespace {

/// Keys of calibration files, and of the messages camera_info of ROS 1 (upper case) and ROS 2.
constexpr std::array<std::string_view, 28> kUsedKeys{
    "image_width", "width", "image_height", "height", "camera_matrix", "K", "k", "distortion_model",
    "fisheye_model", "camera_model", "xi", "distortion_coefficients", "D", "d", "rectification_matrix", "R", "r",
    "projection_matrix", "P", "p", "binning_x", "binning_y", "roi",
    // About the calibration, not about the camera:
    "camera_name", "header", "avg_reprojection_error", "calibration_time", "flags"};
/// Also of OpenCV's samples, about the views from which the camera was calibrated.
constexpr std::array<std::string_view, 12> kKeysOfViews{"nframes",
                                                        "nr_of_frames",
                                                        "board_width",
                                                        "board_height",
                                                        "square_size",
                                                        "marker_size",
                                                        "aspectRatio",
                                                        "per_view_reprojection_errors",
                                                        "extrinsic_parameters",
                                                        "image_points",
                                                        "grid_points",
                                                        "pattern"};

/// The node of the first of these keys that the document has.
YAML::Node one_of(const YAML::Node& document, std::initializer_list<const char*> keys) {
    for (const char* key : keys)
        if (const YAML::Node node = document[key]; node && !node.IsNull()) return node;
    return YAML::Node(YAML::NodeType::Undefined);
}

YAML::Node part(const YAML::Node& document, std::initializer_list<const char*> keys, const char* expected) {
    const YAML::Node node = one_of(document, keys);
    if (!node) throw YamlFault{fmt::format("expected {}: {}", *keys.begin(), expected), YAML::Mark::null_mark()};
    return node;
}

int integer(const YAML::Node& node, const char* key, int low, int high) {
    int n = 0;
    if (!YAML::convert<int>::decode(node, n) || n < low || n > high)
        throw YamlFault{fmt::format("{}: expected an integer in [{}, {}]", key, low, high), node.Mark()};
    return n;
}

/// An integer of the message, which is 0 where nothing is set.
int setting(const YAML::Node& document, const char* key, int high) {
    const YAML::Node node = document[key];
    return node && !node.IsNull() ? integer(node, key, 0, high) : 0;
}

std::vector<double> matrix(const YAML::Node& node, const char* key) {
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
    if (!node.IsMap() || !node["rows"] || !node["cols"]) return numbers;
    const auto size = static_cast<std::size_t>(integer(node["rows"], "rows", 0, 10'000)) *
                      static_cast<std::size_t>(integer(node["cols"], "cols", 0, 10'000));
    if (size != numbers.size())
        throw YamlFault{
            fmt::format("{}: data has {} numbers, expected rows * cols = {}", key, numbers.size(), size),
            data.Mark()};
    return numbers;
}

Pinhole read_pinhole(const YAML::Node& document) {
    constexpr double kFar_px = 1e6;
    const YAML::Node node = part(document, {"camera_matrix", "K", "k"}, "3 x 3 numbers");
    const auto k = matrix(node, "camera_matrix");
    if (!k.empty() && std::ranges::all_of(k, [](double x) { return x == 0; }))
        throw YamlFault{"camera_matrix: all are 0, as of a camera that is not calibrated", node.Mark()};
    const bool square = k.size() == 9 && k[1] == 0 && k[3] == 0 && k[6] == 0 && k[7] == 0 && k[8] == 1;
    if (!square || !(k[0] > 0 && k[0] <= kFar_px) || !(k[4] > 0 && k[4] <= kFar_px) ||
        std::max(std::abs(k[2]), std::abs(k[5])) > kFar_px)
        throw YamlFault{
            "camera_matrix: expected [fx, 0, cx, 0, fy, cy, 0, 0, 1] with fx, fy > 0 and all below 1e6 px",
            node.Mark()};
    return {k[0], k[4], k[2], k[5]};
}

/// The kind that ROS calls so.
const ProjectionKind& ros_kind(const std::string& name, const char* key, const YAML::Mark& at) {
    std::vector<std::string_view> known;
    for (const ProjectionKind* kind : projection_kinds())
        for (const RosName& ros : kind->ros) {
            if (ros.name == name) return *kind;
            known.push_back(ros.name);
        }
    const std::string_view last = known.back();
    known.pop_back();
    throw YamlFault{
        fmt::format("{} \"{}\" is not known here, expected {} or {}", key, name, fmt::join(known, ", "), last), at};
}

/// What a key says about the kind of projection; null if it says nothing.
const ProjectionKind* kind_of_key(const YAML::Node& document, const char* key) {
    const YAML::Node node = document[key];
    if (!node || node.IsNull()) return nullptr;
    if (key == std::string_view("fisheye_model"))
        return opencv_kind(integer(node, key, 0, 1) != 0 ? "fisheye" : "opencv");
    const auto name = node.as<std::string>("");
    if (name.empty() || (key == std::string_view("camera_model") && (name == "pinhole" || name == "perspective")))
        return nullptr;
    return &ros_kind(name, key, node.Mark());
}

/// Null where no key says it.
const ProjectionKind* kind_of(const YAML::Node& document) {
    if (const YAML::Node xi = document["xi"])
        throw YamlFault{"xi: is of an omnidirectional camera model, which is not known here", xi.Mark()};
    const ProjectionKind* kind = nullptr;
    const char* from = "";
    for (const char* key : {"distortion_model", "fisheye_model", "camera_model"}) {
        const ProjectionKind* other = kind_of_key(document, key);
        if (kind != nullptr && other != nullptr && other != kind)
            throw YamlFault{fmt::format("{}: expected the model that {} names", key, from), document[key].Mark()};
        if (kind == nullptr && other != nullptr) kind = other, from = key;
    }
    return kind;
}

std::shared_ptr<const CameraModel> read_model(const YAML::Node& document, const Pinhole& pinhole,
                                              std::vector<std::string>& warnings) {
    const ProjectionKind* stated = kind_of(document);
    ProjectionParameters p{stated != nullptr ? stated : opencv_kind("opencv"), pinhole};
    const YAML::Node node = one_of(document, {"distortion_coefficients", "D", "d"});
    if (node) p.values = matrix(node, "distortion_coefficients");
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
                        node ? node.Mark() : YAML::Mark::null_mark()};
    if (stated == nullptr && p.values.size() == 4)
        warnings.push_back(
            "distortion_model is missing; its 4 coefficients are read as k1, k2, p1, p2 of plumb_bob");
    return model;
}

/// The part of the detector that is read out (`roi`), in pixels of the whole, and its binning. As in ROS, size and
/// camera matrix of the file are those of the whole detector.
void take_readout(const YAML::Node& document, Calibration& c, Pinhole& p) {
    if (const YAML::Node roi = document["roi"]; roi && roi.IsMap()) {
        const int x = setting(roi, "x_offset", kMaxPixelsPerSide), y = setting(roi, "y_offset", kMaxPixelsPerSide),
                  width = setting(roi, "width", kMaxPixelsPerSide),
                  height = setting(roi, "height", kMaxPixelsPerSide);
        const bool whole = width == 0 && height == 0 && x == 0 && y == 0;
        if (!whole && (width < 1 || height < 1 || x + width > c.width || y + height > c.height))
            throw YamlFault{fmt::format("roi: expected a part of the image of {} x {}", c.width, c.height),
                            roi.Mark()};
        if (!whole) c.width = width, c.height = height, p.cx -= x, p.cy -= y;
    }
    const auto bin = [&](const char* key, int& size, double& focal, double& centre) {
        const int n = std::max(1, setting(document, key, kMaxPixelsPerSide));
        if (size % n != 0)
            throw YamlFault{fmt::format("{}: expected a divisor of {} pixels", key, size), document[key].Mark()};
        size /= n, focal /= n;
        if (n > 1) centre = (centre + 0.5) / n - 0.5;  // pixel centres are whole numbers
    };
    bin("binning_x", c.width, p.fx, p.cx);
    bin("binning_y", c.height, p.fy, p.cy);
}

/// Rotation and projection of rectified images, which a camera does not make.
void warn_of_rectification(const YAML::Node& document, std::vector<std::string>& warnings) {
    const YAML::Node r = one_of(document, {"rectification_matrix", "R", "r"}),
                     p = one_of(document, {"projection_matrix", "P", "p"});
    const auto numbers_of = [](const YAML::Node& node, std::size_t size, const char* key) {
        auto numbers = node ? matrix(node, key) : std::vector<double>{};
        if (numbers.size() != size) numbers.clear();
        return numbers;
    };
    const auto rotation = numbers_of(r, 9, "rectification_matrix"),
               projection = numbers_of(p, 12, "projection_matrix");
    bool rectified = !projection.empty() && (projection[3] != 0 || projection[7] != 0);
    for (std::size_t i = 0; i < rotation.size(); ++i)
        rectified |= std::abs(rotation[i] - (i % 4 == 0 ? 1 : 0)) > 1e-9;
    const bool any = std::ranges::any_of(rotation, [](double x) { return x != 0; });
    if (rectified && (any || !projection.empty()))
        warnings.push_back(
            "its rectification_matrix and projection_matrix are of rectified images and are not used: "
            "frames are as the detector sees them");
}

Calibration read_document(const YAML::Node& document, int documents) {
    Calibration c;
    if (documents > 1) c.warnings.push_back(fmt::format("it holds {} documents; the first is used", documents));
    std::vector<std::string_view> known(kUsedKeys.begin(), kUsedKeys.end());
    known.insert(known.end(), kKeysOfViews.begin(), kKeysOfViews.end());
    warn_of_keys(document, known, c.warnings);
    c.width = integer(part(document, {"image_width", "width"}, "a number of pixels"), "image_width", 1,
                      kMaxPixelsPerSide);
    c.height = integer(part(document, {"image_height", "height"}, "a number of pixels"), "image_height", 1,
                       kMaxPixelsPerSide);
    Pinhole pinhole = read_pinhole(document);
    take_readout(document, c, pinhole);
    c.model = read_model(document, pinhole, c.warnings);
    warn_of_rectification(document, c.warnings);
    return c;
}

}  // namespace

Result<Calibration> read_calibration(const std::string& file) {
    return read_yaml<Calibration>(
        file, "a calibration in YAML, as OpenCV and ROS write it, or a message camera_info of ROS", read_document);
}

}  // namespace narpa
