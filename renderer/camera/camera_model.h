/// renderer/camera/camera_model.h - which ray passes a point of the image, and where a point of the scene appears.
///
/// Camera axes: x right, y down, z forward, origin at the centre of projection, metres. Image points are in pixels;
/// the centre of the top-left pixel is (0, 0), as in OpenCV, so that pixel (i, j) extends half a pixel to each
/// side.
///
/// A new kind of camera is a class of its own, set as Camera::model: renderer, tile culling and estimator use this
/// interface alone. Algorithms that need straight lines to stay straight ask for `pinhole()`.
#pragma once

#include <cmath>
#include <memory>
#include <optional>

#include "renderer/geometry/tracer.h"

namespace narpa {

struct ImagePoint {
    double x = 0, y = 0;
};

/// A rectangle of the image, px. Pixels i .. j reach from i - 1/2 to j + 1/2.
struct ImageRect {
    double x_low = 0, y_low = 0, x_high = 0, y_high = 0;
};

/// All directions within an angle of its axis, camera axes.
struct DirectionCone {
    Vec3 axis{0, 0, 1};  ///< unit
    double half_angle_rad = 0;
};

/// How the image point moves with the point of the scene: gradients of x and of y, px per metre, camera axes.
struct ProjectionJacobian {
    Vec3 x{}, y{};
};
/// The largest singular value: px that a point moves by at most, per metre.
[[nodiscard]] double largest_stretch(const ProjectionJacobian& J) noexcept;

class Pinhole;

/// A central projection: all rays pass the origin of the camera's axes. Immutable.
class CameraModel {
public:
    virtual ~CameraModel() = default;

    /// Unit direction of the ray through an image point. Continues smoothly where the camera does not see.
    [[nodiscard]] virtual Vec3 direction(const ImagePoint& p) const noexcept = 0;
    /// The same of length z = 1, for rays with z > 0.
    [[nodiscard]] virtual Vec3 on_plane(const ImagePoint& p) const noexcept {
        const Vec3 d = direction(p);
        return d / d.z;
    }
    /// Unit directions for a batch, in the axes that `q` turns camera axes into.
    virtual void directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                            Vec3Lanes& out) const noexcept;
    /// Where a point (camera axes; any length, so a direction as well) appears, on or off the detector. Nothing
    /// where no ray comes from: of a pinhole z <= 0.
    [[nodiscard]] virtual std::optional<ImagePoint> project(const Vec3& point) const noexcept = 0;
    /// Of `project`, at a point that has an image.
    [[nodiscard]] virtual ProjectionJacobian jacobian(const Vec3& point) const noexcept = 0;
    /// Does light reach the detector there? False beyond the image circle of a lens: such pixels stay black.
    [[nodiscard]] virtual bool sees(const ImagePoint&) const noexcept { return true; }

    /// Image area per solid angle about a unit direction that has an image, px^2 sr^-1; 1 over it is the solid
    /// angle of a pixel.
    [[nodiscard]] virtual double pixels_per_sr(const Vec3& direction) const noexcept;
    /// Along x at the centre of projection: 1 over it is the angular width of a pixel.
    [[nodiscard]] virtual double pixels_per_radian() const noexcept = 0;
    /// Holds the directions of all rays through a rectangle of the image.
    [[nodiscard]] virtual DirectionCone bounds(const ImageRect& rect) const noexcept = 0;

    /// Of an image with so many times the pixels along x and y over the same field of view.
    [[nodiscard]] virtual std::shared_ptr<const CameraModel> scaled(double factor_x, double factor_y) const = 0;
    /// Of the part of the image whose top-left pixel is (x, y).
    [[nodiscard]] virtual std::shared_ptr<const CameraModel> windowed(double x, double y) const = 0;

    /// Finite parameters that define a projection.
    [[nodiscard]] virtual bool is_valid() const noexcept { return true; }
    /// Itself if it is a pinhole, else null.
    [[nodiscard]] virtual const Pinhole* pinhole() const noexcept { return nullptr; }
};

/// x = cx + fx X / Z, y = cy + fy Y / Z.
class Pinhole final : public CameraModel {
public:
    double fx = 0, fy = 0, cx = 0, cy = 0;  ///< px

    Pinhole() = default;
    Pinhole(double fx_px, double fy_px, double cx_px, double cy_px) : fx(fx_px), fy(fy_px), cx(cx_px), cy(cy_px) {}
    explicit Pinhole(const Camera& c) : Pinhole(c.fx, c.fy, c.cx, c.cy) {}

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
    [[nodiscard]] const Pinhole* pinhole() const noexcept override { return this; }
};

/// The model of a camera, by value: the one it was given, or the pinhole of its intrinsics. Making one allocates
/// nothing.
class CameraModelHandle {
public:
    CameraModelHandle(const Pinhole& pinhole = {}) : pinhole_(pinhole) {}  // NOLINT(google-explicit-constructor)
    CameraModelHandle(const Camera& c) : pinhole_(c), given_(c.model) {}   // NOLINT(google-explicit-constructor)
    CameraModelHandle(std::shared_ptr<const CameraModel> model)            // NOLINT(google-explicit-constructor)
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

/// The same camera with so many times the pixels along x and y; what does not fill a whole one at the right and at
/// the bottom is left out.
[[nodiscard]] Camera scaled(const Camera& camera, double factor_x, double factor_y);
/// The same camera, of whose image a part is kept.
[[nodiscard]] Camera windowed(const Camera& camera, int x, int y, int width, int height);

}  // namespace narpa
