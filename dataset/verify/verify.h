/// dataset/verify/verify.h - whether the labels of a data set describe its images: renders images again at the pose
/// and with the Sun of their labels on disk, and compares.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/result.h"
#include "dataset/scene/scene_set.h"

namespace narpa::dataset {

/// Limits of a good label.
struct VerifyLimits {
    double silhouette = 1e-3;    ///< part of the mask's pixels, all bodies, that may differ; one may always
    double keypoint_px = 0.01;   ///< between a keypoint and the projection of its point at the labelled pose
    double sun_rad = 1e-6;       ///< between the labelled direction of the Sun, in the world, and the scene's
    double image_levels = 1e-3;  ///< part of the image's samples that may differ
};

/// The comparison of one image.
struct VerifiedImage {
    std::uint32_t image = 0;
    double silhouette = 0;    ///< part of the pixels of both masks together that differ
    double keypoint_px = 0;   ///< largest distance
    int keypoints_wrong = 0;  ///< visible, occluded or outside where the render says otherwise
    double sun_rad = 0;
    double image_levels = 0;  ///< part of the samples that differ
    bool passed = false;
};

/// Images whose numbers are spread evenly over all: `count` of `images`, or all.
[[nodiscard]] std::vector<std::uint32_t> sampled_images(std::uint32_t images, std::uint32_t count);
/// Compares an image on disk. Errors: a file that cannot be read; a label that is none.
[[nodiscard]] Result<VerifiedImage> verify_image(SceneSet& scenes, const std::string& folder, std::uint32_t image,
                                                 const VerifyLimits& limits = {});
[[nodiscard]] nlohmann::json to_json(const VerifiedImage& v);

}  // namespace narpa::dataset
