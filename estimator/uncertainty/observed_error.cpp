#include "estimator/uncertainty/observed_error.h"

#include <cmath>

#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

/// T after the motion (rotation rad, velocity of the origin at the begin) with constant axis: the exponential of
/// SE(3).
Rigid3 screwed(const Rigid3& T, const Vector6& motion) {
    const Eigen::Vector3d w = motion.head<3>(), v = motion.tail<3>();
    const double angle = w.norm(), angle2 = angle * angle;
    const bool small = angle < 1e-4;  // series, 1e-10 off
    const double a = small ? 0.5 - angle2 / 24 : (1 - std::cos(angle)) / angle2;
    const double b = small ? 1.0 / 6 - angle2 / 120 : (angle - std::sin(angle)) / (angle2 * angle);
    const Eigen::Vector3d across = skew(w) * v, shift = v + a * across + b * (skew(w) * across);
    return {normalized(exp_rotation(to_vec3(w)) * T.q), T.t + to_vec3(shift)};
}

/// The same error of a pose whose origin is at `to` in place of `from`.
Vector6 about_origin(Vector6 error, const Vec3& from, const Vec3& to) {
    const Eigen::Vector3d w = error.head<3>();
    error.tail<3>() += skew(w) * to_eigen(to - from);
    return error;
}

}  // namespace

Rigid3 nearest_equivalent(const Rigid3& T, const Observability& o, const Rigid3& to) {
    constexpr int kIterations = 10;  // quadratic convergence
    if (o.unobserved == 0) return T;
    const Matrix6 along = inverse(o.motions);
    Vector6 parts = Vector6::Zero();  // along the unobserved motions
    Rigid3 nearest = T;
    for (int i = 0; i < kIterations; ++i) {
        const Vector6 left = along * about_origin(error_between(nearest, to), nearest.t, T.t);
        for (int k = 0; k < o.unobserved; ++k) parts[k] += left[k];
        nearest = screwed(T, o.motions * parts);
    }
    return nearest;
}

ObservedError observed_error(const Rigid3& estimate, const Matrix6& covariance, const Answer& answer,
                             const Rigid3& truth) {
    if (answer.kind != AnswerKind::unobservable)
        return {normalised_error_squared(error_between(estimate, truth), covariance), 6};
    const Rigid3 nearest = nearest_equivalent(estimate, answer.observability, truth);
    const Vector6 error = about_origin(error_between(nearest, truth), nearest.t, estimate.t);
    return {(answer.root_information * error).squaredNorm(), 6 - answer.observability.unobserved};
}

}  // namespace narpa
