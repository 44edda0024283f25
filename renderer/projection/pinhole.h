/// renderer/projection/pinhole.h - the pinhole camera, without distortion.
#pragma once

#include <cmath>

#include "renderer/projection/camera_model.h"

namespace narpa {

/// x = cx + fx X / Z, y = cy + fy Y / Z.
class Pinhole final : public CameraModel {
public:
    double fx = 0, fy = 0, cx = 0, cy = 0;  ///< px

    Pinhole() = default;
    Pinhole(double fx_px, double fy_px, double cx_px, double cy_px) : fx(fx_px), fy(fy_px), cx(cx_px), cy(cy_px) {}

    [[nodiscard]] Vec3 on_plane(const ImagePoint& p) const noexcept override {
        return {(p.x - cx) / fx, (p.y - cy) / fy, 1.0};
    }
    /// Image point of the direction (u, v, 1): the inverse.
    [[nodiscard]] ImagePoint of_plane(double u, double v) const noexcept { return {cx + fx * u, cy + fy * v}; }

    /// Rays as an affine function of the image point: (x, y) points along origin + x * per_x + y * per_y, of z = 1
    /// before `q` turns it.
    struct AffineRays {
        Vec3 origin, per_x, per_y;
    };
    [[nodiscard]] AffineRays rays(const Quat& q) const noexcept {
        return {q * Vec3{-cx / fx, -cy / fy, 1}, q * Vec3{1 / fx, 0, 0}, q * Vec3{0, 1 / fy, 0}};
    }
    [[nodiscard]] Pinhole with_scale(double x, double y) const noexcept {
        return {fx * x, fy * y, (cx + 0.5) * x - 0.5, (cy + 0.5) * y - 0.5};
    }
    [[nodiscard]] Pinhole with_origin(double x, double y) const noexcept { return {fx, fy, cx - x, cy - y}; }

    [[nodiscard]] Vec3 direction(const ImagePoint& p) const noexcept override { return normalized(on_plane(p)); }
    void directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                    Vec3Lanes& out) const noexcept override;
    [[nodiscard]] std::optional<ImagePoint> project(const Vec3& p) const noexcept override {
        if (!(p.z > 0)) return std::nullopt;
        return ImagePoint{fx * p.x / p.z + cx, fy * p.y / p.z + cy};
    }
    [[nodiscard]] ProjectionJacobian jacobian(const Vec3& p) const noexcept override {
        return {{fx / p.z, 0, -fx * p.x / (p.z * p.z)}, {0, fy / p.z, -fy * p.y / (p.z * p.z)}};
    }
    [[nodiscard]] double pixels_per_sr(const Vec3& d) const noexcept override {
        return fx * fy / (d.z * d.z * d.z);
    }
    [[nodiscard]] double pixels_per_radian() const noexcept override { return fx; }
    [[nodiscard]] DirectionCone bounds(const ImageRect& rect) const noexcept override;
    [[nodiscard]] std::shared_ptr<const CameraModel> scaled(double x, double y) const override;
    [[nodiscard]] std::shared_ptr<const CameraModel> windowed(double x, double y) const override;
    [[nodiscard]] bool is_valid() const noexcept override {
        return fx > 0 && fy > 0 && std::isfinite(fx) && std::isfinite(fy) && std::isfinite(cx) && std::isfinite(cy);
    }
    [[nodiscard]] ProjectionParameters parameters() const override;
    [[nodiscard]] const Pinhole* pinhole() const noexcept override { return this; }
};

/// The pinhole that agrees with a camera near its axis.
[[nodiscard]] Pinhole paraxial_pinhole(const CameraModel& model);

extern const ProjectionKind kPinhole;

}  // namespace narpa
