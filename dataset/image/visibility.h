/// dataset/image/visibility.h - which of the target's points the camera sees, and how much of the target.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "dataset/scene/image_scene.h"

namespace narpa::dataset {

struct KeypointView {
    enum class State : std::uint8_t {
        visible,
        occluded,  ///< within the image, behind a surface, its own body's or another's
        outside,   ///< of the image, or behind the camera
    };
    static constexpr std::array<std::string_view, 3> kStateNames{"visible", "occluded", "outside"};

    State state = State::outside;
    std::optional<ImagePoint> px{};  ///< projection, also outside of the image; none behind the camera
};

/// Whether an image point lies on one of the image's pixels, and light reaches it.
[[nodiscard]] bool is_in_image(const Camera& camera, const ImagePoint& p);

/// Points of the target (its axes, metres). A point counts as visible if nothing is in front of it by more than a
/// thousandth of the target's radius.
[[nodiscard]] std::vector<KeypointView> view_keypoints(const ImageScene& scene, const Placement& placement,
                                                       const std::vector<Vec3>& points);

/// Part of the target's solid angle that is visible: within the image and not behind another body. Of about 3200
/// rays into a sphere around the target; 0 to 1, and 0 where none meets it.
[[nodiscard]] double visible_part(const ImageScene& scene, const Placement& placement);

}  // namespace narpa::dataset
