/// estimator/marks/mark_fit.h - the pose that fits measured marks best, and how far its residuals exceed the noise.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "estimator/marks/mark_points.h"
#include "estimator/pnp/pnp.h"
#include "estimator/pnp/point_observations.h"
#include "estimator/view/row_times.h"

namespace narpa {

class MarkFit {
public:
    /// Least squares, weighted by the sensor's noise and a scatter beyond it that explains the residuals. `near`: a
    /// pose, for the correction by the rows' times.
    MarkFit(const Camera& camera, const RowTimes& times, const ApparentMotion& motion, MarkPoints marks,
            const Rigid3& near);

    [[nodiscard]] const PnpSolution& solution() const noexcept { return solution_; }
    [[nodiscard]] const MarkPoints& marks() const noexcept { return marks_; }
    [[nodiscard]] int freedom() const noexcept { return freedom_; }
    /// Variance of the residuals beyond the sensor's noise, over that of images with one random sample a pixel.
    [[nodiscard]] double scatter() const noexcept { return scatter_; }
    /// Of the solution, at a scatter of one.
    [[nodiscard]] double chi2() const noexcept { return chi2_; }
    /// False where even a scatter of one does not explain the residuals.
    [[nodiscard]] bool fits() const noexcept { return fits_the_noise(chi2_, freedom_); }

    /// Of the solution's pose: by noise and scatter, and by a shift that all discs have in common.
    [[nodiscard]] Matrix6 covariance() const;
    [[nodiscard]] PointObservations observations() const;
    /// The points as the solver saw them. The input refers to the fit.
    [[nodiscard]] PnpInput input(std::span<const PixelCovariance> covariances) const;
    [[nodiscard]] std::span<const PixelCovariance> covariances() const noexcept { return covariances_; }

private:
    [[nodiscard]] double chi2_at(const Rigid3& T, double scatter) const;
    [[nodiscard]] double scatter_at(const Rigid3& T) const;

    std::shared_ptr<const CameraModel> camera_;
    MarkPoints marks_;
    std::vector<Vec3> body_m_;  ///< as seen in mid-exposure
    std::vector<Pixel> seen_;
    std::vector<PixelCovariance> covariances_;
    PnpSolution solution_;
    int freedom_;
    double scatter_ = 1, chi2_ = 0;
};

}  // namespace narpa
