#include "dataset/image/label.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>

#include "base/constants.h"
#include "dataset/folder/dataset_folder.h"
#include "dataset/image/run_length.h"
#include "dataset/image/visibility.h"
#include "renderer/camera/read_out.h"
#include "renderer/projection/projection_kind.h"

namespace narpa::dataset {
namespace {

using nlohmann::json;

json camera_json(const Camera& c) {
    const auto [kind, p, coefficients] = opencv_parameters(*c.model);
    json camera{{"name", c.name},
                {"width", c.width},
                {"height", c.height},
                {"format", std::string(narpa::name(c.format))},
                {"pixel_pitch_m", c.detector ? json(c.detector->pixel_pitch_m) : json(nullptr)},
                {"camera_matrix", nullptr},
                {"distortion_model", nullptr},
                {"distortion_coefficients", nullptr}};
    if (kind) {  // else OpenCV has no name for the projection
        camera["camera_matrix"] = {{p.fx, 0, p.cx}, {0, p.fy, p.cy}, {0, 0, 1}};
        camera["distortion_model"] = std::string(kind->opencv);
        camera["distortion_coefficients"] = coefficients;
    }
    return camera;
}

struct PixelBox {
    int x_low = 0, y_low = 0, x_high = -1, y_high = -1;
    int area = 0;
};

PixelBox box_of(const std::vector<std::int32_t>& body, int width, std::int32_t value) {
    PixelBox box;
    for (std::size_t i = 0; i < body.size(); ++i) {
        if (body[i] != value) continue;
        const int x = static_cast<int>(i) % width, y = static_cast<int>(i) / width;
        if (box.area++ == 0) box = {x, y, x, y, 1};
        box.x_low = std::min(box.x_low, x), box.x_high = std::max(box.x_high, x);
        box.y_low = std::min(box.y_low, y), box.y_high = std::max(box.y_high, y);
    }
    return box;
}

/// `value`: of the body in `pixels`.
json body_json(const Body& body, int id, const Rigid3& T_camera_body, const Camera& camera,
               const std::vector<std::int32_t>& pixels, std::int32_t value) {
    const PixelBox box = box_of(pixels, camera.width, value);
    json out{{"id", id}, {"name", body.name}, {"T_camera_body", to_json(T_camera_body)}, {"area_px", box.area}};
    out["bbox_px"] = box.area > 0
                         ? json{box.x_low, box.y_low, box.x_high - box.x_low + 1, box.y_high - box.y_low + 1}
                         : json(nullptr);
    if (box.area > 0)
        out["segmentation"] = {{"size", {camera.height, camera.width}},
                               {"counts", run_length_text(runs_of(pixels, camera.width, camera.height, value))}};
    return out;
}

json keypoints_json(const std::vector<Vec3>& points, const std::vector<KeypointView>& views) {
    json all = json::array();
    for (std::size_t i = 0; i < points.size(); ++i)
        all.push_back({{"position_m", to_json(points[i])},
                       {"px", views[i].px ? json{views[i].px->x, views[i].px->y} : json(nullptr)},
                       {"state", KeypointView::kStateNames[static_cast<std::size_t>(views[i].state)]}});
    return all;
}

double brightness_of(const Camera& camera, std::span<const std::uint8_t> bytes) {
    const Region whole{0, 0, static_cast<std::uint16_t>(camera.width), static_cast<std::uint16_t>(camera.height)};
    return mean_level({camera.width, camera.height, camera.format, camera.period_ns}, whole, bytes);
}

}  // namespace

json to_json(const Vec3& v) {
    return {v.x, v.y, v.z};
}
json to_json(const Rigid3& T) {
    return {{"position_m", to_json(T.t)}, {"attitude_wxyz", {T.q.w, T.q.x, T.q.y, T.q.z}}};
}
Vec3 vec3_from(const json& document) {
    return {document.at(0).get<double>(), document.at(1).get<double>(), document.at(2).get<double>()};
}
Rigid3 pose_from(const json& document) {
    const json& q = document.at("attitude_wxyz");
    return {normalized(
                Quat{q.at(0).get<double>(), q.at(1).get<double>(), q.at(2).get<double>(), q.at(3).get<double>()}),
            vec3_from(document.at("position_m"))};
}

json make_label(const SceneSet& scenes, const ImageDraw& draw, const Placement& placement, ImageRenderer& renderer,
                std::uint32_t image) {
    const Recipe& recipe = scenes.recipe();
    const ImageScene& scene = renderer.scene();
    const Scene& s = scene.scene();
    const Rigid3 T_camera_world = inverse(placement.T_world_camera);
    const auto T_camera = [&](std::size_t body) {
        Rigid3 T = T_camera_world * placement.T_world_body[body];
        T.q = normalized(T.q);
        return T;
    };
    const std::size_t target = scene.roles().target;
    json bodies = json::array();
    for (std::size_t i = 0; i < s.bodies.size(); ++i)
        bodies.push_back(body_json(s.bodies[i], scene.body_ids()[i], T_camera(i), renderer.camera(),
                                   renderer.aovs().body, static_cast<std::int32_t>(i)));
    json label{
        {"image", image},
        {"file", image_file(kImageOutput, image)},
        {"seed", recipe.seed},
        {"variant", recipe.variants[draw.variant].name},
        {"variant_index", draw.variant},
        {"background", Backdrop::kKindNames[static_cast<std::size_t>(recipe.backdrops[draw.backdrop].kind)]},
        {"background_index", draw.backdrop},
        {"camera", camera_json(renderer.camera())},
        {"target", s.bodies[target].name},
        {"target_id", scene.body_ids()[target]},
        {"T_camera_target", to_json(T_camera(target))},
        {"T_world_camera", to_json(placement.T_world_camera)},
        {"range_m", draw.range_m},
        {"phase_deg", draw.sun_camera ? json(kDegPerRad * draw.phase_rad) : json(nullptr)},
        {"sun_direction_camera", draw.sun_camera ? to_json(*draw.sun_camera) : json(nullptr)},
        {"time_factor", draw.time_factor},
        {"gain_factor", draw.gain_factor},
        {"albedo_factor", draw.albedo_factor},
        {"brightness", brightness_of(renderer.camera(), renderer.bytes())},
        {"visible_part", visible_part(scene, placement)},
        {"bodies", bodies},
        {"keypoints", keypoints_json(scenes.keypoints(), view_keypoints(scene, placement, scenes.keypoints()))}};
    label["exposure_s"] = renderer.camera().detector ? json(renderer.camera().detector->exposure_s) : json(nullptr);
    return label;
}

}  // namespace narpa::dataset
