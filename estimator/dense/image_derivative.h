/// estimator/dense/image_derivative.h - Jacobian of each pixel of a rendered image by the pose.
///
/// A pixel is the mean of the radiance L over its square. At a fixed image point x, L changes because the surface
/// there moves with the image velocity v(x), known exactly from the range, and because its BSDF depends on the
/// direction to the camera:
///
///   dT/dpose = - mean(v . grad L) + sum over edges of (L_near - L_far) (v_near . n) length / area + mean(dL/dview)
///
/// The first two terms are computed together, by the divergence theorem: what flows over a pixel's border. On lines
/// across the pixel, from border to border, L differs at their ends by the edges between them, which move with the
/// nearer of the two surfaces. Textures, creases, shadow edges and silhouettes are all included, none twice; what
/// lies whole within a pixel does not change it. Pixels share the points on their borders, so that twice as many
/// rays as a pixel has lines each way suffice. Where the ends are not on one surface an occluding contour is
/// between them, and bisection by rays finds its range; what changes on the nearer surface before its end moves
/// with that surface. (T.-M. Li et al., "Differentiable Monte Carlo Ray Tracing through Edge Sampling", ACM Trans.
/// Graph. 37(6), 2018, sample edges at random; here the points are evenly spaced.)
///
/// The target's illumination does not change with the pose (ModelView): shadows move with the surface, the radiance
/// of a Lambert surface is constant, and for other materials direct sunlight changes as the BSDF does with the
/// direction to the camera. Over an exposure it is the mean over parts of it, each row at its own time; vignetting
/// and the point spread of the lens act on the derivative as on the image. Not included: the same for lamps and
/// indirect light, and shadows of the body that carries the camera.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/pose/pose_estimate.h"
#include "estimator/view/measured_image.h"
#include "estimator/view/row_times.h"
#include "renderer/camera/image_optics.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// Of one pixel: DN per (rad, rad, rad, m, m, m), the error of pose_estimate.h.
using PixelDerivative = Eigen::Matrix<float, 6, 1>;

class ImageDerivative {
public:
    /// `camera` is that of the image. `render_scene` outlives it.
    ImageDerivative(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at);

    /// As ModelView::begin_frame.
    void begin_frame(const BodyPoses& at, const ApparentMotion& motion, const RowTimes& times);

    /// Jacobian of the predicted DN at this pose, without clipping. Row-major; zero in the outermost pixels, which
    /// lack neighbours. `fineness` >= 1: lines each way across a pixel. `chosen`: pixels to look at, those that are
    /// not 0; empty: all. Runs on the calling thread's TBB arena; the same on any number of threads.
    std::span<const PixelDerivative> at(const Rigid3& T_camera_target, const SensorModel& sensor,
                                        const FrameSettings& settings, int fineness,
                                        std::span<const std::uint8_t> chosen = {});

private:
    /// The camera's, with `fineness` rows for each of its own.
    [[nodiscard]] CameraPose path(const Rigid3& T_camera_target, const RowTimes& times, int fineness) const;
    /// Calls act(square, each) for squares of the image; each(derivative) adds derivative(column, row, view of the
    /// row), times `weight`, for the square's chosen pixels.
    template <class Do>
    void each_square(const Rigid3& T_camera_target, const RowTimes& times, float weight, Do&& act);
    /// Adds the first two terms for a moment of each row.
    void add(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings, int fineness,
             const RowTimes& times, float weight);
    /// Adds the third.
    void add_shading(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings,
                     const RowTimes& times, float weight);
    void apply_optics();

    const RenderScene& render_scene_;
    const Camera camera_;
    const std::size_t target_;
    BodyPoses at_;
    ApparentMotion motion_{};
    RowTimes times_{};
    bool view_dependent_ = false;  ///< any material
    ImageOptics optics_;
    RadianceImage before_optics_, after_optics_;
    std::vector<PixelDerivative> derivative_;
    std::vector<std::uint8_t> chosen_;  ///< pixels that have a derivative: not 0
};

}  // namespace narpa
