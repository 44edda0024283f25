/// renderer/camera/scene_camera.h - the camera model of a scene's camera, and cameras of other sizes.
#pragma once

#include <memory>
#include <utility>

#include "renderer/geometry/tracer.h"
#include "renderer/projection/pinhole.h"

namespace narpa {

/// The pinhole of the camera's intrinsics, whatever its model is.
[[nodiscard]] inline Pinhole pinhole_of(const Camera& c) {
    return {c.fx, c.fy, c.cx, c.cy};
}

/// The model of a camera, by value: the one it was given, or the pinhole of its intrinsics. Making one allocates
/// nothing.
class CameraModelHandle {
public:
    CameraModelHandle(const Pinhole& pinhole = {}) : pinhole_(pinhole) {}  // NOLINT(google-explicit-constructor)
    CameraModelHandle(const Camera& c)
        : pinhole_(pinhole_of(c)), given_(c.model) {}            // NOLINT(google-explicit-constructor)
    CameraModelHandle(std::shared_ptr<const CameraModel> model)  // NOLINT(google-explicit-constructor)
        : given_(std::move(model)) {}

    [[nodiscard]] const CameraModel& operator*() const noexcept { return given_ ? *given_ : pinhole_; }
    [[nodiscard]] const CameraModel* operator->() const noexcept { return &**this; }

private:
    Pinhole pinhole_;
    std::shared_ptr<const CameraModel> given_;
};

/// The ray through image point (x, y), world axes.
[[nodiscard]] inline Ray camera_ray(const CameraModelHandle& model, const Rigid3& T_world_camera, double x,
                                    double y) {
    return {T_world_camera.t, T_world_camera.q * model->direction({x, y})};
}

/// The same camera with the number of pixels along x and y multiplied by these factors; incomplete pixels at the
/// right and bottom edges are dropped.
[[nodiscard]] Camera scaled(const Camera& camera, double factor_x, double factor_y);
/// The same camera cropped to a part of its image.
[[nodiscard]] Camera windowed(const Camera& camera, int x, int y, int width, int height);

}  // namespace narpa
