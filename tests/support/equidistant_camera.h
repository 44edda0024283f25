/// tests/support/equidistant_camera.h - a camera that the product does not have: a fisheye lens whose image radius
/// is proportional to the angle from its axis, r = f theta. It shows that the joint holds for more than the
/// pinhole.
#pragma once

#include <cmath>
#include <memory>

#include "renderer/camera/scene_camera.h"

namespace narpa::test {

class EquidistantCamera final : public CameraModel {
public:
    /// fx, fy: px per radian; `max_rad`: the image circle.
    EquidistantCamera(double fx, double fy, double cx, double cy, double max_rad = 3.1)
        : fx_(fx), fy_(fy), cx_(cx), cy_(cy), max_rad_(max_rad) {}

    [[nodiscard]] Vec3 direction(const ImagePoint& p) const noexcept override {
        const double a = (p.x - cx_) / fx_, b = (p.y - cy_) / fy_, theta = std::hypot(a, b);
        const double s = theta > 0 ? std::sin(theta) / theta : 1;
        return {s * a, s * b, std::cos(theta)};
    }
    [[nodiscard]] std::optional<ImagePoint> project(const Vec3& p) const noexcept override {
        const double side = std::hypot(p.x, p.y), theta = std::atan2(side, p.z);
        if (!(theta < max_rad_)) return std::nullopt;
        const double k = side > 0 ? theta / side : 1 / p.z;
        return ImagePoint{cx_ + fx_ * k * p.x, cy_ + fy_ * k * p.y};
    }
    [[nodiscard]] ProjectionJacobian jacobian(const Vec3& p) const noexcept override {
        const double side = std::hypot(p.x, p.y), square = dot(p, p), theta = std::atan2(side, p.z);
        if (side < 1e-9 * p.z) return {{fx_ / p.z, 0, 0}, {0, fy_ / p.z, 0}};
        // theta (x, y) / side, with d theta = (z x, z y, -side^2) / (side square).
        const double k = theta / side, c = p.x / side, s = p.y / side, along = p.z / square;
        return {fx_ * Vec3{along * c * c + k * s * s, (along - k) * c * s, -side * c / square},
                fy_ * Vec3{(along - k) * c * s, along * s * s + k * c * c, -side * s / square}};
    }
    [[nodiscard]] bool sees(const ImagePoint& p) const noexcept override {
        return std::hypot((p.x - cx_) / fx_, (p.y - cy_) / fy_) < max_rad_;
    }
    [[nodiscard]] double pixels_per_radian() const noexcept override { return fx_; }
    /// Directions are nowhere further apart than their image points, in radians.
    [[nodiscard]] DirectionCone bounds(const ImageRect& r) const noexcept override {
        return {direction({0.5 * (r.x_low + r.x_high), 0.5 * (r.y_low + r.y_high)}),
                0.5 * std::hypot((r.x_high - r.x_low) / fx_, (r.y_high - r.y_low) / fy_)};
    }
    [[nodiscard]] std::shared_ptr<const CameraModel> scaled(double x, double y) const override {
        return std::make_shared<EquidistantCamera>(fx_ * x, fy_ * y, (cx_ + 0.5) * x - 0.5, (cy_ + 0.5) * y - 0.5,
                                                   max_rad_);
    }
    [[nodiscard]] std::shared_ptr<const CameraModel> windowed(double x, double y) const override {
        return std::make_shared<EquidistantCamera>(fx_, fy_, cx_ - x, cy_ - y, max_rad_);
    }

private:
    double fx_, fy_, cx_, cy_, max_rad_;
};

/// A camera of this kind with its axis through the middle of the image.
inline Camera with_equidistant(Camera c, double pixels_per_radian, double max_rad = 3.1) {
    c.model = std::make_shared<EquidistantCamera>(pixels_per_radian, pixels_per_radian, (c.width - 1) / 2.0,
                                                  (c.height - 1) / 2.0, max_rad);
    return c;
}

}  // namespace narpa::test
