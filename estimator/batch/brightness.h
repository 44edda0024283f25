/// estimator/batch/brightness.h - brightness of a frame's target in small blocks, beside that of the model: what
/// tells the target's albedo and the direction of its light.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "estimator/batch/batch_unknowns.h"
#include "estimator/view/measured_image.h"
#include "renderer/frame/camera_image.h"

namespace narpa {

/// Means over kBlock_px x kBlock_px pixels, DN above black.
struct BrightnessBlock {
    double measured = 0, model = 0;
    /// Derivatives of `model` by a rotation of the Sun's direction about light_axes() of it, per radian.
    std::array<double, 2> by_light{};
    double variance = 0;   ///< of the sensor's noise, DN^2
    std::size_t part = 0;  ///< of the target's image: errors of the model are common to it
};
/// The unknowns that change brightness alone.
inline constexpr std::array kBrightnessUnknowns{BatchUnknown::albedo, BatchUnknown::light_x, BatchUnknown::light_y};

struct BrightnessObservations {
    static constexpr int kBlock_px = 8;
    static constexpr std::size_t kPartsAcross = 4, kParts = kPartsAcross * kPartsAcross;
    std::vector<BrightnessBlock> blocks;
    /// Rotation of the Sun's direction, rad about light_axes() of the scene's, that the model was rendered with.
    std::array<double, 2> light_rad{};
};

/// The blocks that lie in evenly lit parts of the target, where an error of the pose does not matter: renders at
/// this pose with light from three directions vary little in them. `at`: poses of all bodies; the target's
/// determines its illumination. `light_rad`: BrightnessObservations. Without a Sun, by_light is 0.
[[nodiscard]] BrightnessObservations observe_brightness(const RenderScene& scene, const Camera& camera,
                                                        std::size_t target, const BodyPoses& at,
                                                        const MeasuredImage& image, const Rigid3& T_camera_target,
                                                        const FrameSettings& settings,
                                                        const std::array<double, 2>& light_rad = {});

}  // namespace narpa
