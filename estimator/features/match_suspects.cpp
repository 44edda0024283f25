#include "estimator/features/match_suspects.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

#include "estimator/uncertainty/unobserved.h"
#include "estimator/uncertainty/untold.h"

namespace narpa {
namespace {

constexpr int kRowUnknowns = 12;
using MotionOfRows = Eigen::Matrix<double, kRowUnknowns, 1>;
using MatrixOfRows = Eigen::Matrix<double, kRowUnknowns, kRowUnknowns>;

/// A match in units of its error.
struct Whitened {
    Eigen::Matrix<double, 2, kRowUnknowns> design;
    Eigen::Vector2d residual;
};

std::vector<Whitened> whitened(const ModelMatches& m, const CameraModel& camera, const Rigid3& T, double floor_px) {
    double top = 1e300, bottom = -1e300;
    for (const Pixel& p : m.pixels) top = std::min(top, p.v), bottom = std::max(bottom, p.v);
    const double height = std::max(bottom - top, 1.0);
    const std::vector<Matrix26> jacobians = m.jacobians(camera, T);
    std::vector<Whitened> out;
    for (std::size_t i = 0; i < m.size(); ++i) {
        const auto image = camera.project(T * m.body_m[i]);
        if (!image) continue;
        const auto L = m.match_covariance(i, floor_px).llt();
        const double row = (m.pixels[i].v - 0.5 * (top + bottom)) / height;
        Eigen::Matrix<double, 2, kRowUnknowns> design;
        design << jacobians[i], row * jacobians[i];
        out.push_back({L.matrixL().solve(design),
                       L.matrixL().solve(Eigen::Vector2d(m.pixels[i].u - image->x, m.pixels[i].v - image->y))});
    }
    return out;
}

/// The combinations of motions with the row of which the pose leaves at least this part of the square: of matches
/// on a plane it explains some nearly.
constexpr double kLeastOfRowsLeft = 0.02;

using Combinations = Eigen::Matrix<double, kRowUnknowns, Eigen::Dynamic, 0, kRowUnknowns, kRowUnknowns>;

/// Columns: the pose's six unknowns, then these combinations.
Combinations determined(const MatrixOfRows& information) {
    const Matrix6 of_pose = information.topLeftCorner<6, 6>(), mixed = information.topRightCorner<6, 6>(),
                  own = information.bottomRightCorner<6, 6>();
    Vector6 unit = own.diagonal();  // in which the image of each unknown has a square of one
    for (double& u : unit) u = u > 0 ? 1 / std::sqrt(u) : 0;
    const Eigen::MatrixXd left =
        unit.asDiagonal() * (own - mixed.transpose() * of_pose.ldlt().solve(mixed)) * unit.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(left);
    const auto kept = (eigen.eigenvalues().array() > kLeastOfRowsLeft).count();
    Combinations out = Combinations::Zero(kRowUnknowns, 6 + kept);
    out.topLeftCorner<6, 6>().setIdentity();
    out.bottomRightCorner(6, kept) = unit.asDiagonal() * eigen.eigenvectors().rightCols(kept);
    return out;
}

}  // namespace

MatchSuspicion progressive_rows(const ModelMatches& m, const CameraModel& camera, const Rigid3& T,
                                double floor_px) {
    const std::vector<Whitened> all = whitened(m, camera, T, floor_px);
    if (2 * all.size() <= kRowUnknowns || all.size() != m.size()) return {};
    MatrixOfRows information = MatrixOfRows::Zero(), shared = MatrixOfRows::Zero();
    MotionOfRows gradient = MotionOfRows::Zero();
    for (std::size_t i = 0; i < all.size(); ++i) {
        information += all[i].design.transpose() * all[i].design;
        gradient += all[i].design.transpose() * all[i].residual;
        for (std::size_t j = 0; j < i; ++j) {
            const double part = overlap(m.pixels[i], m.pixels[j]);
            if (part <= 0) continue;
            const MatrixOfRows pair = part * all[i].design.transpose() * all[j].design;
            shared += pair + pair.transpose();
        }
    }
    const Combinations to = determined(information);
    const Eigen::Index rows = to.cols() - 6;
    if (rows == 0) return {};
    const Eigen::MatrixXd reduced = to.transpose() * information * to;
    const Eigen::MatrixXd inverse = reduced.ldlt().solve(Eigen::MatrixXd::Identity(to.cols(), to.cols()));
    const Eigen::MatrixXd of_shared = inverse * (to.transpose() * shared * to);
    const Eigen::VectorXd step = inverse * (to.transpose() * gradient);
    // As matches share errors, the unknowns absorb more of the scatter than their number.
    const auto unknowns = static_cast<double>(to.cols());
    const double freedom = 2 * static_cast<double>(all.size()) - unknowns - of_shared.trace();
    if (!(freedom > unknowns)) return {};
    double chi2 = 0;
    for (const Whitened& w : all) chi2 += (w.residual - w.design * (to * step)).squaredNorm();
    const Eigen::MatrixXd covariance = chi2 / freedom * (inverse + of_shared * inverse);
    const Eigen::VectorXd amount = step.tail(rows);
    const Eigen::MatrixXd of_amount = covariance.bottomRightCorner(rows, rows);
    MatchSuspicion out;
    out.sigmas = as_normal(amount.dot(of_amount.ldlt().solve(amount)), static_cast<double>(rows));
    const Matrix6 of_pose = information.topLeftCorner<6, 6>();
    const Vector6 without = of_pose.ldlt().solve(gradient.head<6>());
    out.shift = step.head<6>() - without;
    return out;
}

Rigid3 with_guess_where_unobserved(const ModelMatches& m, const CameraModel& camera, const Observability& o,
                                   const Rigid3& T_camera_target, const Rigid3& guess, double floor_px) {
    constexpr int kSteps = 3;
    Rigid3 T = displaced(T_camera_target, unobserved_part(o, error_between(T_camera_target, guess)));
    for (int k = 0; k < kSteps; ++k) {
        Matrix6 information = Matrix6::Zero();
        Vector6 gradient = Vector6::Zero();
        for (const Whitened& w : whitened(m, camera, T, floor_px)) {
            const Eigen::Matrix<double, 2, 6> J = w.design.leftCols<6>();
            information += J.transpose() * J;
            gradient += J.transpose() * w.residual;
        }
        T = displaced(T, observed_step(o, information, gradient));
    }
    return T;
}

}  // namespace narpa
