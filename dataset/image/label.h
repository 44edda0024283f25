/// dataset/image/label.h - the label of an image as JSON: docs/datasets.md, "Labels".
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>

#include "base/pose.h"
#include "dataset/image/image_renderer.h"
#include "dataset/scene/scene_set.h"

namespace narpa::dataset {

/// Of the image that was rendered last.
[[nodiscard]] nlohmann::json make_label(const SceneSet& scenes, const ImageDraw& draw, const Placement& placement,
                                        ImageRenderer& renderer, std::uint32_t image);

[[nodiscard]] nlohmann::json to_json(const Vec3& v);
/// {"position_m": [x, y, z], "attitude_wxyz": [w, x, y, z]}
[[nodiscard]] nlohmann::json to_json(const Rigid3& T);
/// The inverses. Throw nlohmann::json::exception where the document is no such thing.
[[nodiscard]] Vec3 vec3_from(const nlohmann::json& document);
[[nodiscard]] Rigid3 pose_from(const nlohmann::json& document);

}  // namespace narpa::dataset
