/// dataset/gather/annotations.h - labels in the formats that others read: COCO, and that of the SPEED+ data set.
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>

namespace narpa::dataset {

/// Collects images, annotations and categories of https://cocodataset.org/#format-data: a category for each body,
/// an annotation for each body that an image shows, with its mask; keypoints belong to the target's category.
/// Keypoints that are outside of the image have v = 0, occluded ones 1, visible ones 2.
class CocoDocument {
public:
    CocoDocument();
    ~CocoDocument();

    void add(const nlohmann::json& label);
    [[nodiscard]] nlohmann::json document() const;

private:
    struct Parts;
    const std::unique_ptr<Parts> parts_;
};

/// An entry of train.json of SPEED+ (T. H. Park et al., "SPEED+: Next-generation dataset for spacecraft pose
/// estimation across domain gap", IEEE Aerospace Conference 2022). q_vbs2tango_true is scalar first. As a passive
/// direction cosine matrix it takes camera axes (vbs) to target axes; the same numbers as a Hamilton quaternion
/// rotate target coordinates into camera coordinates. So it is the quaternion of T_camera_target, with w >= 0.
[[nodiscard]] nlohmann::json speed_entry(const nlohmann::json& label);
/// camera.json of SPEED+. Lengths in metres are null if the camera has no detector, which has the pixels' size.
/// Null where the label has no camera matrix.
[[nodiscard]] nlohmann::json speed_camera(const nlohmann::json& label);

}  // namespace narpa::dataset
