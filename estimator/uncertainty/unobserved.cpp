#include "estimator/uncertainty/unobserved.h"

#include "estimator/least_squares/symmetric.h"

namespace narpa {

Vector6 unobserved_part(const Observability& o, const Vector6& motion) {
    Vector6 amounts = inverse(o.motions) * motion;
    amounts.tail(6 - o.unobserved).setZero();
    return o.motions * amounts;
}

Vector6 observed_step(const Observability& o, const Matrix6& information, const Vector6& gradient) {
    Vector6 along = o.motions.transpose() * gradient;
    along.head(o.unobserved).setZero();
    return o.motions * ldlt_solve(o.along_motions(information), along);
}

Matrix6 with_guess(const Observability& o, const Matrix6& covariance, const GuessError& guess, double range_m) {
    Vector6 of_guess;
    of_guess << Eigen::Vector3d::Constant(guess.rotation_rad),
        Eigen::Vector3d::Constant(guess.part_of_range * range_m);
    const Matrix6 to_amounts = inverse(o.motions);
    const Matrix6 guessed = to_amounts * of_guess.cwiseAbs2().asDiagonal() * to_amounts.transpose();
    Matrix6 amounts = to_amounts * covariance * to_amounts.transpose();
    const int n = o.unobserved;
    amounts.topRows(n).setZero(), amounts.leftCols(n).setZero();
    amounts.topLeftCorner(n, n) = guessed.topLeftCorner(n, n);
    const Matrix6 out = o.motions * amounts * o.motions.transpose();
    return 0.5 * (out + out.transpose());
}

}  // namespace narpa
