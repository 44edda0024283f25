/// renderer/projection/camera_model.h - camera projection: rays through image points, and image points of the
/// scene.
///
/// Camera axes: x right, y down, z forward, origin at the centre of projection, metres. Image points are in pixels;
/// the centre of the top-left pixel is (0, 0), as in OpenCV, so that pixel (i, j) extends half a pixel to each
/// side.
///
/// A new kind of camera is a class of its own, set as Camera::model: renderer, tile culling and estimator use only
/// this interface. Algorithms that need straight lines to stay straight use `pinhole()`. Kinds that scene files
/// name are in projection_kind.h.
#pragma once

#include <memory>
#include <optional>

#include "base/lanes.h"
#include "base/pose.h"

namespace narpa {

struct ImagePoint {
    double x = 0, y = 0;
};

/// A rectangle of the image, px. Pixels i .. j reach from i - 1/2 to j + 1/2.
struct ImageRect {
    double x_low = 0, y_low = 0, x_high = 0, y_high = 0;
};

[[nodiscard]] inline ImagePoint middle(const ImageRect& r) noexcept {
    return {0.5 * (r.x_low + r.x_high), 0.5 * (r.y_low + r.y_high)};
}

/// All directions within an angle of its axis, camera axes.
struct DirectionCone {
    Vec3 axis{0, 0, 1};  ///< unit
    double half_angle_rad = 0;
};

/// Derivatives of the image point by the point of the scene: gradients of x and of y, px per metre, camera axes.
struct ProjectionJacobian {
    Vec3 x{}, y{};
};
/// The largest singular value: largest motion of the image point in px per metre.
[[nodiscard]] double largest_stretch(const ProjectionJacobian& J) noexcept;

class Pinhole;
struct ProjectionKind;
struct ProjectionParameters;

/// A central projection: all rays pass the origin of the camera's axes. Immutable.
class CameraModel {
public:
    virtual ~CameraModel() = default;

    /// Unit direction of the ray through an image point. Continues smoothly where the camera does not see.
    [[nodiscard]] virtual Vec3 direction(const ImagePoint& p) const noexcept = 0;
    /// The same scaled to z = 1, for rays with z > 0.
    [[nodiscard]] virtual Vec3 on_plane(const ImagePoint& p) const noexcept {
        const Vec3 d = direction(p);
        return d / d.z;
    }
    /// Unit directions for a batch, rotated by `q` from camera axes.
    virtual void directions(const Quat& q, const Lanes<double>& x, const Lanes<double>& y,
                            Vec3Lanes& out) const noexcept;
    /// Image point of a point (camera axes; any length, so a direction as well), on or off the detector. Nullopt if
    /// no ray comes from there: for a pinhole z <= 0.
    [[nodiscard]] virtual std::optional<ImagePoint> project(const Vec3& point) const noexcept = 0;
    /// Jacobian of `project`, at a point that has an image.
    [[nodiscard]] virtual ProjectionJacobian jacobian(const Vec3& point) const noexcept = 0;
    /// True if light reaches the detector there. False beyond the image circle of a lens: such pixels stay black.
    /// The region where it is true is convex.
    [[nodiscard]] virtual bool sees(const ImagePoint&) const noexcept { return true; }

    /// Image area per solid angle around a unit direction that has an image, px^2 sr^-1; its inverse is the solid
    /// angle of a pixel.
    [[nodiscard]] virtual double pixels_per_sr(const Vec3& direction) const noexcept;
    /// Along x at the principal point: its inverse is the angular width of a pixel.
    [[nodiscard]] virtual double pixels_per_radian() const noexcept = 0;
    /// A cone that contains the directions of all rays through a rectangle of the image.
    [[nodiscard]] virtual DirectionCone bounds(const ImageRect& rect) const noexcept = 0;

    /// The model of an image with the number of pixels along x and y multiplied by these factors, with the same
    /// field of view.
    [[nodiscard]] virtual std::shared_ptr<const CameraModel> scaled(double factor_x, double factor_y) const = 0;
    /// The model of the part of the image whose top-left pixel is (x, y).
    [[nodiscard]] virtual std::shared_ptr<const CameraModel> windowed(double x, double y) const = 0;

    /// True if the parameters are finite and define a projection.
    [[nodiscard]] virtual bool is_valid() const noexcept { return true; }
    /// What files state of it: projection_kind.h. By default of no kind that files name.
    [[nodiscard]] virtual ProjectionParameters parameters() const;
    /// Itself if it is a pinhole, else null.
    [[nodiscard]] virtual const Pinhole* pinhole() const noexcept { return nullptr; }
};

/// `bounds` of a model without a closed form, from directions through points of the border.
struct RectBorder {
    Lanes<double> x, y;
};
[[nodiscard]] RectBorder border_of(const ImageRect& rect) noexcept;
/// `axis`: direction through the middle; `border`: through border_of().
[[nodiscard]] DirectionCone cone_about_border(const Vec3& axis, const Vec3Lanes& border) noexcept;

}  // namespace narpa
