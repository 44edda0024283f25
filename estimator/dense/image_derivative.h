/// estimator/dense/image_derivative.h - Jacobian of each pixel of a rendered image by the pose.
///
/// A pixel P is the mean of the radiance L over its square. At a fixed image point x, L changes because the surface
/// there moves with the image velocity v(x), known exactly from the range, and because its BSDF depends on the
/// direction to the camera:
///
///   dP/dpose = - mean(v . grad L) + sum over edges of (L_near - L_far) (v_near . n) length / area + mean(dL/dview)
///
/// By the divergence theorem the first two terms together are the flow over the pixel's border. On lines across the
/// pixel, from border to border, the values of L at the ends differ by the edges between them, which move with the
/// nearer of the two surfaces. Textures, creases, shadow edges and silhouettes are all included once; detail that
/// lies entirely within a pixel does not change it. Pixels share the points on their borders, so that 2 n rays per
/// pixel suffice for n lines each way. If the ends are on different surfaces, an occluding contour is between them,
/// and bisection by rays finds its range; changes on the nearer surface before its end move with that surface.
/// (T.-M. Li et al., "Differentiable Monte Carlo Ray Tracing through Edge Sampling", ACM Trans. Graph. 37(6), 2018,
/// sample edges at random; here the points are evenly spaced.)
///
/// The target's illumination does not change with the pose (ModelView): shadows move with the surface, the radiance
/// of a Lambert surface is constant, and for other materials direct sunlight changes as the BSDF does with the
/// direction to the camera. For an exposure over time the derivative is the mean over parts of it, each row at its
/// own time; vignetting and the lens's point spread act on the derivative as on the image. Not included:
/// view-dependent shading by lamps and indirect light, and shadows of the body that carries the camera.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/pose/pose_estimate.h"
#include "estimator/view/measured_image.h"
#include "estimator/view/row_times.h"
#include "renderer/frame/camera_image.h"
#include "renderer/optics/image_optics.h"

namespace narpa {

/// Derivative of one pixel: DN per (rad, rad, rad, m, m, m), the error of pose_estimate.h.
using PixelDerivative = Eigen::Matrix<float, 6, 1>;

class ImageDerivative {
public:
    /// `camera`: that of the image. `render_scene` outlives it.
    ImageDerivative(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at);

    /// Sets poses, motion and row times, as in ModelView::begin_frame.
    void begin_frame(const BodyPoses& at, const ApparentMotion& motion, const RowTimes& times);

    /// Jacobian of the predicted DN at this pose, without clipping. Row-major; zero in the outermost pixels, which
    /// lack neighbours. `fineness` >= 1: lines each way across a pixel. `chosen`: mask of the pixels to compute,
    /// not 0; empty: all. Runs on the calling thread's TBB arena; the same on any number of threads.
    std::span<const PixelDerivative> at(const Rigid3& T_camera_target, const SensorModel& sensor,
                                        const FrameSettings& settings, int fineness,
                                        std::span<const std::uint8_t> chosen = {});

private:
    /// The camera's path with `fineness` rows for each row of the camera.
    [[nodiscard]] CameraPose path(const Rigid3& T_camera_target, const RowTimes& times, int fineness) const;
    /// Calls act(square, each) for all squares of the image; each(derivative) adds weight * derivative(column, row,
    /// view of the row) to the square's chosen pixels.
    template <class Do>
    void each_square(const Rigid3& T_camera_target, const RowTimes& times, float weight, Do&& act);
    /// Adds the first two terms at one moment of each row.
    void add(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings, int fineness,
             const RowTimes& times, float weight);
    /// Adds the third term.
    void add_shading(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings,
                     const RowTimes& times, float weight);
    void apply_optics();

    const RenderScene& render_scene_;
    const Camera camera_;
    const std::size_t target_;
    BodyPoses at_;
    ApparentMotion motion_{};
    RowTimes times_{};
    bool view_dependent_ = false;  ///< true if any material is
    ImageOptics optics_;
    RadianceImage before_optics_, after_optics_;
    std::vector<PixelDerivative> derivative_;
    std::vector<std::uint8_t> chosen_;  ///< mask: not 0 for pixels that have a derivative
};

}  // namespace narpa
