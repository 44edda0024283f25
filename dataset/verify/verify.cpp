#include "dataset/verify/verify.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/file_bytes.h"
#include "dataset/folder/dataset_folder.h"
#include "dataset/gather/gather.h"
#include "dataset/image/image_renderer.h"
#include "dataset/image/label.h"
#include "dataset/image/visibility.h"
#include "renderer/assets/images/image_reader.h"
#include "renderer/image/image_file.h"

namespace narpa::dataset {
namespace {

using nlohmann::json;

/// Where the label says that camera and bodies are.
Result<Placement> placement_of(const json& label, const Scene& scene, const std::string& path) {
    Placement p;
    p.T_world_camera = pose_from(label.at("T_world_camera"));
    p.T_world_body.resize(scene.bodies.size());
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
        const auto& bodies = label.at("bodies");
        const auto body =
            std::ranges::find_if(bodies, [&](const json& b) { return b.at("name") == scene.bodies[i].name; });
        if (body == bodies.end())
            return Error{fmt::format("has no body \"{}\", expected all bodies of the scene", scene.bodies[i].name),
                         path};
        const bool is_target = body->at("id") == label.at("target_id");
        const Rigid3 T_camera_body = pose_from(is_target ? label.at("T_camera_target") : body->at("T_camera_body"));
        p.T_world_body[i] = p.T_world_camera * T_camera_body;
        p.T_world_body[i].q = normalized(p.T_world_body[i].q);
    }
    return p;
}

/// Part of the pixels that the mask or the render gives to a body, of those that they give to different ones.
double silhouette_difference(const DecodedImage& mask, const std::vector<std::int32_t>& body,
                             const std::vector<int>& ids) {
    std::size_t different = 0, all = 0;
    for (std::size_t i = 0; i < body.size(); ++i) {
        const int own = body[i] < 0 ? 0 : ids[static_cast<std::size_t>(body[i])];
        all += own != 0 || mask.samples[i] != 0 ? 1u : 0u;
        different += own != mask.samples[i] ? 1u : 0u;
    }
    return different <= 1 ? 0 : static_cast<double>(different) / static_cast<double>(all);
}

void compare_keypoints(const json& label, const ImageScene& scene, const Placement& placement, VerifiedImage& out) {
    const json& keypoints = label.at("keypoints");
    std::vector<Vec3> points;
    for (const json& k : keypoints) points.push_back(vec3_from(k.at("position_m")));
    const std::vector<KeypointView> views = view_keypoints(scene, placement, points);
    for (std::size_t i = 0; i < views.size(); ++i) {
        const json& px = keypoints[i].at("px");
        if (px.is_null() != !views[i].px) {
            ++out.keypoints_wrong;
            continue;
        }
        const auto state = KeypointView::kStateNames[static_cast<std::size_t>(views[i].state)];
        if (keypoints[i].at("state") != state) ++out.keypoints_wrong;
        if (!views[i].px) continue;
        const double off =
            std::hypot(px.at(0).get<double>() - views[i].px->x, px.at(1).get<double>() - views[i].px->y);
        out.keypoint_px = std::max(out.keypoint_px, off);
    }
}

/// Part of the image's samples that differ from those on disk. Pixels of YUYV are not stored as such in an image
/// file and are not compared.
Result<double> image_difference(const std::string& path, const ImageRenderer& renderer) {
    if (renderer.camera().format == PixelFormat::yuyv) return 0.0;
    const auto bytes = read_frame(path, renderer.camera());
    if (!bytes) return bytes.error();
    std::size_t different = 0;
    for (std::size_t i = 0; i < bytes->size(); ++i) different += (*bytes)[i] != renderer.bytes()[i] ? 1u : 0u;
    return static_cast<double>(different) / static_cast<double>(bytes->size());
}

Result<DecodedImage> read_mask(const std::string& path, const Camera& camera) {
    const auto file = read_file(path);
    if (!file) return file.error();
    auto mask = decode_image(path, {reinterpret_cast<const std::uint8_t*>(file->data()), file->size()});
    if (mask && (mask->width != camera.width || mask->height != camera.height || mask->channels != 1))
        return Error{"is no mask of this data set, expected a grey image of the camera's size", path};
    return mask;
}

Result<VerifiedImage> compare(SceneSet& scenes, const std::string& folder, std::uint32_t image, const json& label,
                              const VerifyLimits& limits) {
    const Recipe& recipe = scenes.recipe();
    const std::string path = folder + "/" + image_file(kLabelOutput, image);
    VerifiedImage out{.image = image};
    const auto variant = label.at("variant_index").get<std::size_t>(),
               backdrop = label.at("background_index").get<std::size_t>();
    if (variant >= recipe.variants.size() || backdrop >= recipe.backdrops.size())
        return Error{"has a variant or a background that the recipe does not have", path};
    auto scene = recipe.albedo_factor ? scenes.make(variant, backdrop) : scenes.shared(variant, backdrop);
    if (!scene) return scene.error();
    if (recipe.albedo_factor) (*scene)->set_albedo_factor(label.at("albedo_factor").get<double>());
    const auto placement = placement_of(label, (*scene)->scene(), path);
    if (!placement) return placement.error();
    ImageRenderer renderer(*scene);
    renderer.render(*placement, {label.at("time_factor").get<double>(), label.at("gain_factor").get<double>()},
                    label.at("seed").get<std::uint64_t>(), image);
    if (recipe.outputs[kMaskOutput]) {
        const auto mask = read_mask(folder + "/" + image_file(kMaskOutput, image), renderer.camera());
        if (!mask) return mask.error();
        out.silhouette = silhouette_difference(*mask, renderer.aovs().body, (*scene)->body_ids());
    }
    compare_keypoints(label, **scene, *placement, out);
    if (const auto& sun = scenes.facts().sun_world) {
        const Vec3 labelled = placement->T_world_camera.q * vec3_from(label.at("sun_direction_camera"));
        out.sun_rad = std::atan2(norm(cross(labelled, *sun)), dot(labelled, *sun));
    }
    const auto difference = image_difference(folder + "/" + image_file(kImageOutput, image), renderer);
    if (!difference) return difference.error();
    out.image_levels = *difference;
    out.passed = out.silhouette <= limits.silhouette && out.keypoint_px <= limits.keypoint_px &&
                 out.keypoints_wrong == 0 && out.sun_rad <= limits.sun_rad &&
                 out.image_levels <= limits.image_levels;
    return out;
}

}  // namespace

std::vector<std::uint32_t> sampled_images(std::uint32_t images, std::uint32_t count) {
    count = std::min(count, images);
    std::vector<std::uint32_t> sample;
    for (std::uint64_t k = 0; k < count; ++k) sample.push_back(static_cast<std::uint32_t>(k * images / count));
    return sample;
}

Result<VerifiedImage> verify_image(SceneSet& scenes, const std::string& folder, std::uint32_t image,
                                   const VerifyLimits& limits) {
    const auto label = read_label(folder, image);
    if (!label) return label.error();
    try {
        return compare(scenes, folder, image, *label, limits);
    } catch (const json::exception& e) {
        return Error{fmt::format("is not the label of an image: {}", e.what()),
                     folder + "/" + image_file(kLabelOutput, image)};
    }
}

json to_json(const VerifiedImage& v) {
    return {{"image", v.image},
            {"silhouette", v.silhouette},
            {"keypoint_px", v.keypoint_px},
            {"keypoints_wrong", v.keypoints_wrong},
            {"sun_rad", v.sun_rad},
            {"image_levels", v.image_levels},
            {"passed", v.passed}};
}

}  // namespace narpa::dataset
