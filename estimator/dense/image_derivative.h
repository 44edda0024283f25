/// estimator/dense/image_derivative.h - how each pixel of a rendered image changes with the pose.
///
/// A pixel is the mean of the light L over its square. With the point x of the image fixed, L changes as what is
/// seen there moves by with the velocity v(x), known exactly from the depth, and as what is seen shines differently
/// towards a camera that stands elsewhere:
///
///   dT/dpose = - mean(v . grad L) + sum over edges of (L_near - L_far) (v_near . n) length / area + mean(dL/dview)
///
/// The first two are one: L is taken on a grid of rays in each pixel, finer where it changes much, and each side
/// between two neighbours is an edge across which L jumps and which moves with the nearer of the two surfaces. So
/// textures, creases, shadows' edges and silhouettes are all counted, none twice; the sums over a staircase of
/// sides are those over the edge itself, as n length sums to the same. Where the sides lie in depth beside each
/// other but not on one surface, the edge is an occluding contour: rays find its place between the two, and so the
/// pixel that it belongs to, and the depth of the nearer surface at the contour, where a round body's rim stands.
/// (T.-M. Li et al., "Differentiable Monte Carlo Ray Tracing through Edge Sampling", ACM Trans. Graph. 37(6), 2018,
/// choose points of the edges at random; here they are on a grid.)
///
/// The light falls on the target as the world has it and does not change with the pose (ModelView): shadows lie
/// still on the surface and move with it, a Lambert surface's shine is constant, and of the others the Sun's direct
/// light changes as the BSDF does with the direction to the camera. Not counted: the same for lamps and for light
/// that comes by other surfaces, and shadows of the body that carries the camera.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "estimator/pose/pose_estimate.h"
#include "estimator/view/measured_image.h"
#include "renderer/film/camera_image.h"

namespace narpa {

/// Of one pixel: DN per (rad, rad, rad, m, m, m), the error of pose_estimate.h.
using PixelDerivative = Eigen::Matrix<float, 6, 1>;

class ImageDerivative {
public:
    /// `camera` is that of the image. `render_scene` outlives it.
    ImageDerivative(const RenderScene& render_scene, const Camera& camera, std::size_t target, const BodyPoses& at);

    /// As ModelView has it.
    void place_bodies(const BodyPoses& at) { at_ = at; }

    /// Of the expected DN, but for clipping, at this pose. Row-major; the outermost pixels, beside which nothing is
    /// known, are zero. `fineness` >= 1: rays each way in a pixel where the light changes much. Runs on the calling
    /// thread's TBB arena; the same on any number of threads.
    std::span<const PixelDerivative> at(const Rigid3& T_camera_target, const SensorModel& sensor,
                                        const FrameSettings& settings, int fineness);

private:
    const RenderScene& render_scene_;
    const Camera camera_;
    const std::size_t target_;
    BodyPoses at_;
    bool view_dependent_ = false;  ///< any material
    std::vector<PixelDerivative> derivative_;
};

}  // namespace narpa
