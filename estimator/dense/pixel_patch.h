/// estimator/dense/pixel_patch.h - radiance and geometry on a grid of rays within a pixel and a ring around it.
#pragma once

#include <vector>

#include "estimator/view/measured_image.h"
#include "renderer/film/camera_batch.h"

namespace narpa {

/// DN above black of this radiance, not clipped.
[[nodiscard]] double signal_of(const SensorModel& sensor, const Rgb& radiance);

/// A camera with fineness x fineness pixels for each pixel of another.
class FineGrid {
public:
    /// All but `camera` outlive it.
    FineGrid(const RenderScene& render_scene, const BodyPoses& at, const Camera& camera,
             const Rigid3& T_world_camera, const FrameSettings& settings, int fineness);
    FineGrid(const FineGrid&) = delete;
    FineGrid& operator=(const FineGrid&) = delete;

    [[nodiscard]] int fineness() const noexcept { return fineness_; }
    [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
    [[nodiscard]] const Frame& frame() const noexcept { return frame_; }

private:
    int fineness_;
    Camera camera_;
    const Rigid3& T_world_camera_;
    FrameSettings settings_;
    Frame frame_;
};

/// The first hit of one ray. None: body -1, infinite range.
struct RaySample {
    double signal = 0;  ///< DN above black
    int body = -1;
    double range_m = 0;                          ///< along the ray
    Vec3 position{}, normal{}, ray_direction{};  ///< world
};

class PixelPatch {
public:
    /// Traces a pixel and the ring of grid points around it, without the ring's corners.
    void trace(const FineGrid& grid, const SensorModel& sensor, int x, int y);

    /// Point (i, j) of the pixel's own, 0 .. fineness - 1, or of the ring, -1 and fineness.
    [[nodiscard]] const RaySample& at(int i, int j) const {
        return points_[static_cast<std::size_t>(j + 1) * static_cast<std::size_t>(side_) +
                       static_cast<std::size_t>(i + 1)];
    }
    [[nodiscard]] bool sees_anything() const noexcept { return sees_anything_; }

private:
    int side_ = 0;
    bool sees_anything_ = false;
    std::vector<RaySample> points_;
};

}  // namespace narpa
