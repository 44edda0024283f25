/// estimator/features/model_matches.h - points of the model with their images in a frame, and statistics of their
/// scatter.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "estimator/pnp/point_observations.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/projection/camera_model.h"

namespace narpa {

/// Correspondences of one view.
struct ModelMatches {
    std::vector<Vec3> body_m;
    std::vector<Pixel> in_view, pixels;  ///< image points in the view and in the frame
    std::vector<Eigen::Matrix2d> noise;  ///< covariance of `pixels` by the sensor's noise alone

    [[nodiscard]] std::size_t size() const { return body_m.size(); }
    void keep(const std::vector<std::uint8_t>& wanted);

    /// Covariance of a match, if all scatter by `floor_px` beyond the sensor's noise.
    [[nodiscard]] Eigen::Matrix2d match_covariance(std::size_t i, double floor_px) const;
    [[nodiscard]] std::vector<PixelCovariance> covariances(double floor_px) const;

    /// With the scatter in px^2.
    [[nodiscard]] PointObservations observations() const;

    [[nodiscard]] std::vector<Matrix26> jacobians(const CameraModel& camera, const Rigid3& T) const;
    [[nodiscard]] std::vector<double> residuals_px(const CameraModel& camera, const Rigid3& T) const;
    /// RMS distance between the points' images at two poses.
    [[nodiscard]] double moved_px(const CameraModel& camera, const Rigid3& from, const Rigid3& to) const;

    /// Sums over the matches' Jacobians w in units of their errors: w w', and overlap_ij w_i w_j' over all pairs
    /// whose windows overlap, which share that part of their errors.
    struct Sums {
        Matrix6 information = Matrix6::Zero(), shared = Matrix6::Zero();
    };
    [[nodiscard]] Sums sums(const CameraModel& camera, const Rigid3& T, double floor_px) const;
    /// Expected chi^2 of the residuals. As matches share errors, the pose absorbs more than six degrees of freedom.
    [[nodiscard]] double freedom(const CameraModel& camera, const Rigid3& T, double floor_px) const;
    /// Factor, at least 1, by which the variance of the pose's error may exceed `covariance`: from the scatter of
    /// the score vectors of parts of the target, whose matches share errors of model and light (clustered
    /// residuals: K.-Y. Liang, S. Zeger, Biometrika 73, 1986). C: the inverse of the matches' information.
    [[nodiscard]] double inflation(const CameraModel& camera, const Rigid3& T, const Matrix6& C,
                                   const Matrix6& covariance, double floor_px) const;
    /// The excess error of a match beyond the sensor's noise that makes chi^2 equal to its degrees of freedom; 0
    /// where the noise suffices.
    [[nodiscard]] double floor_px(const CameraModel& camera, const Rigid3& T, double freedom) const;
};

/// Part of the windows about two pixels that both have, which share the errors of this part.
[[nodiscard]] double overlap(const Pixel& a, const Pixel& b);
[[nodiscard]] double root_mean_square(const std::vector<double>& lengths);
/// Standard deviation of residuals in u and in v, from the median of their lengths.
[[nodiscard]] double scale_of(std::vector<double> lengths);

}  // namespace narpa
