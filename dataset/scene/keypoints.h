/// dataset/scene/keypoints.h - points of the target that are labelled in each image.
#pragma once

#include <functional>
#include <vector>

#include "dataset/scene/image_scene.h"

namespace narpa::dataset {

/// `count` points of the target's surface, far from each other, target axes: the one farthest from the middle of
/// all, then each time the one farthest from those that are chosen already (T. Gonzalez, "Clustering to minimize
/// the maximum intercluster distance", Theoretical Computer Science 38, 1985). Of a mesh they are vertices; of
/// another shape, points that rays from outside meet. Points that are hidden from two thirds of all directions or
/// more are left out. Fewer where the surface has fewer.
[[nodiscard]] std::vector<Vec3> chosen_keypoints(const ImageScene& scene, int count);
/// The same of given points, without those that are not `good`.
[[nodiscard]] std::vector<Vec3> farthest_points(const std::vector<Vec3>& points, int count,
                                                const std::function<bool(const Vec3&)>& good);

}  // namespace narpa::dataset
