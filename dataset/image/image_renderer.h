/// dataset/image/image_renderer.h - renders images of one scene: the camera's bytes, and what is visible where.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "dataset/scene/image_scene.h"
#include "renderer/detector/sensor_array.h"
#include "renderer/frame/camera_image.h"

namespace narpa::dataset {

/// Factors of the camera's exposure time and gain. Without a detector, `time` acts on the radiance at full scale.
struct ExposureFactors {
    double time = 1, gain = 1;
};

class ImageRenderer {
public:
    explicit ImageRenderer(std::shared_ptr<ImageScene> scene);

    /// `seed` and `image` are those of samples and noise; fixed patterns of the detector have the scene's seed, as
    /// they belong to the camera. Runs on the calling thread's TBB arena.
    void render(const Placement& placement, const ExposureFactors& factors, std::uint64_t seed,
                std::uint32_t image);

    [[nodiscard]] ImageScene& scene() { return *scene_; }
    /// Of the last image.
    [[nodiscard]] const Camera& camera() const { return camera_; }
    [[nodiscard]] const RadianceImage& radiance() const { return radiance_; }
    [[nodiscard]] const Aovs& aovs() const { return aovs_; }
    [[nodiscard]] std::span<const std::uint8_t> bytes() const { return bytes_; }
    [[nodiscard]] const BodyPoses& poses() const { return poses_; }

private:
    std::shared_ptr<ImageScene> scene_;
    Camera camera_;
    CameraRenderer renderer_;
    std::unique_ptr<SensorArray> sensor_array_;  ///< null where the scene names none
    RadianceImage radiance_;
    Aovs aovs_;
    BodyPoses poses_;
    std::vector<std::uint8_t> bytes_;
};

}  // namespace narpa::dataset
