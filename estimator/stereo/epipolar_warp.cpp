#include "estimator/stereo/epipolar_warp.h"

#include "estimator/pose/pose_estimate.h"

namespace narpa {

EpipolarWarp::EpipolarWarp(const Pinhole& from, const Pinhole& to, const Rigid3& T_to_from)
    : t_(to_eigen(T_to_from.t)), to_(to) {
    const auto [origin, per_x, per_y] = from.rays(T_to_from.q);
    origin_ = to_eigen(origin), across_ = to_eigen(per_x), down_ = to_eigen(per_y);
}

}  // namespace narpa
