/// bench/estimation/untold_errors.h - errors of the world that estimators are not told of, by kind and size.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <span>
#include <string_view>

#include "base/radiance_image.h"
#include "estimator/pose/apparent_motion.h"
#include "renderer/frame/frame_settings.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// What a frame is made of.
struct TrueWorld {
    Scene scene;
    Camera camera;  ///< that exposes
    Rigid3 T_camera_target{};
    double target_radius_m = 1;
    ApparentMotion motion{};
    FrameSettings settings{};
    /// Change of the gain over the image's width and height.
    double gain_right = 0, gain_down = 0;

    void apply_gain(RadianceImage& image) const;
};

/// A kind of error, in three sizes.
struct UntoldError {
    std::string_view name;
    std::array<double, 3> sizes;
    std::string_view unit;
    void (*apply)(TrueWorld& world, double size, std::mt19937_64& random);
};

[[nodiscard]] std::span<const UntoldError> untold_errors() noexcept;

}  // namespace narpa
