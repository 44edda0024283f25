#include "estimator/stereo/epipolar_warp.h"

#include "estimator/pose/pose_estimate.h"

namespace narpa {

EpipolarWarp::EpipolarWarp(const Camera& from, const Camera& to, const Rigid3& T_to_from)
    : origin_(to_eigen(T_to_from.q * Vec3{-from.cx / from.fx, -from.cy / from.fy, 1})),
      across_(to_eigen(T_to_from.q * Vec3{1 / from.fx, 0, 0})),
      down_(to_eigen(T_to_from.q * Vec3{0, 1 / from.fy, 0})),
      t_(to_eigen(T_to_from.t)),
      focal_px_(to.fx, to.fy),
      centre_px_(to.cx, to.cy) {}

}  // namespace narpa
