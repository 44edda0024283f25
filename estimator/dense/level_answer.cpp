// LevelSolver: covariance and status of the pose that its steps lead to.
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "estimator/dense/dense_tuning.h"
#include "estimator/dense/level_solver.h"
#include "estimator/least_squares/symmetric.h"
#include "estimator/uncertainty/response.h"

namespace narpa {
using namespace dense_tuning;

void LevelSolver::finish() {
    const PhotometricImages images = this->images();
    const PhotometricEquations last = equations(images, e_.exposure, robust_);
    // The remaining step is part of the error.
    const Vector6 remaining_step = ldlt_solve(last.pose_information(), last.pose_gradient());
    const Matrix6 of_noise = last.pose_covariance();
    e_.covariance_of_model = covariance_of_model(last);
    const PhotometricCost now = cost(images, e_.exposure, robust_);
    e_.pixels = now.pixels;
    e_.chosen = images.chosen.empty()
                    ? e_.pixels
                    : static_cast<std::size_t>(std::ranges::count_if(images.chosen, [](auto c) { return c != 0; }));
    const PhotometricCost loss = cost(images, e_.exposure, {});
    e_.window = view_.window();
    if (o_.model.detail > 0) e_.overconfidence = last.overconfidence();
    e_.excess_loss = loss.excess() / e_.overconfidence;
    e_.misfit = loss.excess() / static_cast<double>(std::max<std::size_t>(loss.pixels, 1));
    e_.residual = residual();
    const double off = std::abs(e_.exposure.gain - 1);
    if (off > kPriorSigmas * images.prior.gain_sigma)
        e_.status = DenseStatus::does_not_fit;
    else
        e_.covariance = covariance_by_response(of_noise, response_to_motions(last), kResponseMax) +
                        e_.covariance_of_model + remaining_step * remaining_step.transpose();
}

double LevelSolver::residual() const {
    const PhotometricImages now = images();
    if ((now.measured_variance.empty() && o_.model == ModelUncertainty{}) || o_.model.detail > 0)
        return equations(now, e_.exposure, {1, kResidualCauchy, 0}).residual() / kResidualOfNormal;
    const double of_information =
        equations(now, e_.exposure, {1, std::numeric_limits<double>::infinity(), 0}).residual();
    const PhotometricCost all = cost(now, e_.exposure, {});
    return std::max(of_information,
                    std::sqrt(all.chi2 / static_cast<double>(std::max<std::size_t>(all.pixels, 1))));
}

/// Measures the response by central differences of renders with equal samples.
Matrix6 LevelSolver::response_to_motions(const PhotometricEquations& last) {
    const std::vector<float> signal(view_.images().signal.begin(), view_.images().signal.end()),
        variance(view_.images().signal_variance.begin(), view_.images().signal_variance.end());
    PhotometricImages here = images();
    here.signal = signal, here.signal_variance = variance;
    const Observability o = observability_of(last.pose_covariance(), norm(e_.T_camera_body.t));
    settings_.spp = std::max(2, o_.samples_per_pixel);
    std::vector<float> change(signal.size());
    return response_to_weakest(o, [&](int i, const Vector6& motion) {
        const double sigmas = std::min(kRendered_sigmas, kRenderedLimits * std::sqrt(o.eigenvalues[i]));
        render(displaced(e_.T_camera_body, sigmas * motion));
        std::ranges::copy(view_.images().signal, change.begin());
        render(displaced(e_.T_camera_body, -sigmas * motion));
        e_.renders += 2;
        for (std::size_t p = 0; p < change.size(); ++p)
            change[p] = (change[p] - view_.images().signal[p]) / static_cast<float>(2 * sigmas);
        return last.pose_step(response(here, e_.exposure, robust_, change));
    });
}

LevelSolver::Rise LevelSolver::rise(int motions, double sigmas) {
    const Observability o = observability_of(e_.covariance_of_image(), norm(e_.T_camera_body.t));
    Rise rise{std::numeric_limits<double>::infinity(), 0};
    for (int i = o.unobserved; i < motions; ++i)
        for (const double side : {-sigmas, sigmas}) {
            const Vector6 motion = side / std::sqrt(o.eigenvalues[i]) * o.motions.col(i);
            const Eigen::Vector2d step = equations_.exposure_step(motion);
            const Exposure exposure{e_.exposure.gain + step[0], e_.exposure.offset_dn + step[1]};
            render(displaced(e_.T_camera_body, motion));
            const double rises = (cost(images(), exposure, {}).robust - loss_when_linearised_) /
                                 (e_.overconfidence * sigmas * sigmas);
            rise = {std::min(rise.min, rises), std::max(rise.max, rises)};
        }
    return rise;
}

Result<Matrix6> LevelSolver::bound() {
    view_.choose_all();
    render(e_.T_camera_body);
    view_.differentiate(e_.T_camera_body, settings_, o_.fineness);
    PhotometricImages images = view_.images();
    images.signal_variance = {};
    images.measured = {};
    const auto all = equations(images, {}, {1, std::numeric_limits<double>::infinity(), 0});
    if (!all.observes_pose()) return Error{"too few pixels show the target to determine its pose"};
    return Matrix6(inverse(all.pose_information()) + covariance_of_model(all));
}

Matrix6 LevelSolver::covariance_of_model(const PhotometricEquations& equations) {
    PoseShifts shifts = image_shifts(o_.model, e_.T_camera_body, o_.motion);
    if (o_.model.light_rad > 0) {
        render(e_.T_camera_body);  // with the same sampling noise as the image it is compared with
        PoseShifts by_light(6, 3);
        const PhotometricImages images = this->images();
        for (int axis = 0; axis < 3; ++axis) {
            Vec3 turn{};
            turn[axis] = o_.model.light_rad;
            const auto change = view_.change_with_light(e_.T_camera_body, settings_, turn);
            by_light.col(axis) = equations.pose_step(response(images, e_.exposure, robust_, change));
        }
        shifts = joined(shifts, by_light);
    }
    return covariance_by(shifts);
}

}  // namespace narpa
