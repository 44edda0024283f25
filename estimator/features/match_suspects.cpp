#include "estimator/features/match_suspects.h"

#include <Eigen/Cholesky>
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
    const Eigen::LDLT<MatrixOfRows> solver(information);
    const MotionOfRows step = solver.solve(gradient);
    const MatrixOfRows inverse = solver.solve(MatrixOfRows::Identity());
    // As matches share errors, the unknowns absorb more of the scatter than their number.
    const double freedom = 2 * static_cast<double>(all.size()) - kRowUnknowns - (inverse * shared).trace();
    if (!(freedom > kRowUnknowns)) return {};
    double chi2 = 0;
    for (const Whitened& w : all) chi2 += (w.residual - w.design * step).squaredNorm();
    const MatrixOfRows covariance = chi2 / freedom * (inverse + inverse * shared * inverse);
    const Vector6 amount = step.tail<6>();
    const Matrix6 of_amount = covariance.bottomRightCorner<6, 6>();
    MatchSuspicion out;
    out.sigmas = as_normal(amount.dot(of_amount.ldlt().solve(amount)), 6);
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
