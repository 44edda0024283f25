#include "bench/estimation/pnp_methods.h"

#include <ceres/tiny_solver.h>

#include <cmath>
#include <opencv2/calib3d.hpp>

#include "estimator/pnp/pnp.h"

namespace narpa {
namespace {

constexpr std::size_t kPointsMax = 1024;

// OpenCV's methods

cv::Mat matrix_of(const Pinhole& p) {
    return (cv::Mat_<double>(3, 3) << p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1);
}

struct CvTrial {
    cv::Mat K, points, pixels;

    explicit CvTrial(const PnpTrial& t)
        : K(matrix_of(t.camera)),
          points(static_cast<int>(t.body_m.size()), 1, CV_64FC3, const_cast<Vec3*>(t.body_m.data())),
          pixels(static_cast<int>(t.pixels.size()), 1, CV_64FC2, const_cast<Pixel*>(t.pixels.data())) {}
};

PoseResult finite_pose(const cv::Mat& r, const cv::Mat& t) {
    const Rigid3 T{exp_rotation({r.at<double>(0), r.at<double>(1), r.at<double>(2)}),
                   {t.at<double>(0), t.at<double>(1), t.at<double>(2)}};
    return std::isfinite(norm(T.q)) && is_finite(T.t) ? PoseResult{T} : PoseResult{};
}

/// `solve(trial, rotation, translation)` returns whether it found a pose. None where OpenCV throws: a method that
/// does not take so few points, or this shape.
template <class Solve>
PoseResult by_opencv(const PnpTrial& trial, const Solve& solve) {
    cv::Mat r, t;
    try {
        if (!solve(CvTrial(trial), r, t)) return {};
    } catch (const cv::Exception&) {
        return {};
    }
    return finite_pose(r, t);
}

PoseResult by_opencv_ransac(const PnpTrial& trial) {
    return by_opencv(trial, [&](const CvTrial& c, cv::Mat& r, cv::Mat& t) {
        constexpr int kIterations = 100;
        constexpr double kConfidence = 0.99;
        const auto threshold_px = static_cast<float>(std::sqrt(kInlierSquaredResidual) * trial.sigma_px);
        std::vector<int> inliers;
        if (!cv::solvePnPRansac(c.points, c.pixels, c.K, cv::noArray(), r, t, false, kIterations, threshold_px,
                                kConfidence, inliers, cv::SOLVEPNP_EPNP))
            return false;
        std::vector<cv::Point3d> points;
        std::vector<cv::Point2d> pixels;
        for (const int i : inliers)
            points.push_back(c.points.at<cv::Point3d>(i)), pixels.push_back(c.pixels.at<cv::Point2d>(i));
        cv::solvePnPRefineLM(points, pixels, c.K, cv::noArray(), r, t);
        return true;
    });
}

// Ceres's TinySolver: its fastest, without the set-up of its full solver

/// d exp(r) p = left_jacobian(r) dr x exp(r) p: the left Jacobian of SO(3).
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& r) {
    const double angle = r.norm(), square = angle * angle;
    const bool small = angle < 1e-4;
    const double a = small ? 0.5 - square / 24 : (1 - std::cos(angle)) / square;
    const double b = small ? 1.0 / 6 - square / 120 : (angle - std::sin(angle)) / (angle * square);
    return Eigen::Matrix3d::Identity() + a * skew(r) + b * skew(r) * skew(r);
}

/// Residuals of all points in standard deviations. The parameters: a rotation vector from the start's attitude, and
/// the translation.
struct Residuals {
    using Scalar = double;
    enum { NUM_RESIDUALS = Eigen::Dynamic, NUM_PARAMETERS = 6 };

    const PnpTrial& trial;
    Quat start;
    const CameraModel* camera = &trial.camera;

    [[nodiscard]] int NumResiduals() const { return 2 * static_cast<int>(trial.body_m.size()); }
    [[nodiscard]] Rigid3 pose(const double* x) const {
        return {normalized(exp_rotation({x[0], x[1], x[2]}) * start), {x[3], x[4], x[5]}};
    }

    bool operator()(const double* x, double* residuals, double* jacobian) const {
        const Rigid3 T = pose(x);
        const Eigen::Matrix3d turning = left_jacobian({x[0], x[1], x[2]});
        Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6>> J(jacobian, NumResiduals(), 6);
        for (std::size_t i = 0; i < trial.body_m.size(); ++i) {
            const auto image = camera->project(T * trial.body_m[i]);
            if (!image) return false;
            residuals[2 * i] = (image->x - trial.pixels[i].u) / trial.sigma_px;
            residuals[2 * i + 1] = (image->y - trial.pixels[i].v) / trial.sigma_px;
            if (jacobian == nullptr) continue;
            auto rows = J.middleRows<2>(2 * static_cast<Eigen::Index>(i));
            rows = reprojection_jacobian(*camera, T, trial.body_m[i]) / trial.sigma_px;
            rows.leftCols<3>() *= turning;
        }
        return true;
    }
};

/// The minimum of least cost that is reached from these starts. The time includes its covariance.
PoseResult by_ceres(const PnpTrial& trial, std::span<const Rigid3> starts) {
    PoseResult best;
    double least = std::numeric_limits<double>::infinity();
    for (const Rigid3& start : starts) {
        const Residuals residuals{trial, normalized(start.q)};
        ceres::TinySolver<Residuals> solver;
        Eigen::Matrix<double, 6, 1> x;
        x << 0, 0, 0, to_eigen(start.t);
        const double cost = solver.Solve(residuals, &x).final_cost;
        const Rigid3 T = residuals.pose(x.data());
        if (cost < least && pnp_bound(trial.input(), T)) least = cost, best.T_camera_body = T;
    }
    return best;
}

/// From all poses of SQPNP and, for planes, of IPPE.
PoseResult by_opencv_and_ceres(const PnpTrial& trial, bool flat) {
    const CvTrial c(trial);
    std::vector<Rigid3> starts;
    for (const auto method : {cv::SOLVEPNP_SQPNP, cv::SOLVEPNP_IPPE}) {
        if (method == cv::SOLVEPNP_IPPE && !flat) continue;
        std::vector<cv::Mat> rotations, translations;
        try {
            cv::solvePnPGeneric(c.points, c.pixels, c.K, cv::noArray(), rotations, translations, false, method);
        } catch (const cv::Exception&) {
            continue;
        }
        for (std::size_t i = 0; i < rotations.size(); ++i)
            if (const PoseResult found = finite_pose(rotations[i], translations[i]); found.T_camera_body)
                starts.push_back(*found.T_camera_body);
    }
    return by_ceres(trial, starts);
}

}  // namespace

std::vector<PnpMethod> pnp_methods(const PnpSetting& setting) {
    const bool outliers = setting.outliers > 0;
    const bool flat = setting.scene == PnpScene::plane || setting.scene == PnpScene::plane_facing;
    std::vector<PnpMethod> all;
    all.push_back(
        {kPnpCold, [solver = std::make_shared<PnpSolver>(kPointsMax), outliers](const auto& t, const auto&) {
             const PnpSolution& s = solver->solve(t.input(), outliers);
             if (!s.ok() && s.status != PnpStatus::no_convergence) return PoseResult{};
             return PoseResult{s.fit.T_camera_body, s.ambiguous() || s.imprecise};
         }});
    all.push_back({kPnpWarm, [refiner = std::make_shared<PnpRefiner>(kPointsMax), outliers](const auto& t,
                                                                                            const auto& start) {
                       RefineOptions options;
                       if (outliers) options.loss = {Loss::cauchy, 2};
                       const PnpFit& fit = refiner->refine(t.input(), start, options);
                       if (!fit.ok() && fit.status != PnpStatus::no_convergence) return PoseResult{};
                       return PoseResult{fit.T_camera_body};
                   }});
    if (outliers) {
        all.push_back({kPnpPeerOutliers, [](const auto& t, const auto&) { return by_opencv_ransac(t); }});
        return all;
    }
    all.push_back({kPnpPeerWarm, [](const auto& t, const auto& start) { return by_ceres(t, {&start, 1}); }});
    all.push_back({kPnpPeerCold, [flat](const auto& t, const auto&) { return by_opencv_and_ceres(t, flat); }});
    for (const auto& [name, method] : {std::pair{"ITERATIVE", cv::SOLVEPNP_ITERATIVE},
                                       {"EPNP", cv::SOLVEPNP_EPNP},
                                       {"SQPNP", cv::SOLVEPNP_SQPNP},
                                       {"IPPE", cv::SOLVEPNP_IPPE}}) {
        if (method == cv::SOLVEPNP_IPPE && !flat) continue;
        all.push_back({name, [m = method](const auto& trial, const auto&) {
                           return by_opencv(trial, [m](const CvTrial& c, cv::Mat& r, cv::Mat& t) {
                               return cv::solvePnP(c.points, c.pixels, c.K, cv::noArray(), r, t, false, m);
                           });
                       }});
    }
    return all;
}

}  // namespace narpa
