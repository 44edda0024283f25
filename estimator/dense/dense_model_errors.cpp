// DenseAlignment: errors of the model that are not told, and motions that the image does not show.
#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "estimator/dense/dense_alignment.h"
#include "estimator/dense/dense_tuning.h"
#include "estimator/dense/level_solver.h"
#include "estimator/uncertainty/unobserved.h"
#include "estimator/uncertainty/untold.h"

namespace narpa {
using namespace dense_tuning;

/// Tests for errors of the model that no uncertainty states. Those of the light are solved with the pose.
void DenseAlignment::test_model(const Measured& m, const DenseOptions& options, DenseEstimate& e, Fit& fit) {
    const Camera camera = coarser_camera(camera_, options.finest);
    const auto window = window_about(render_scene_.tracer(), camera, target_, e.T_camera_body);
    LevelView& view = level(options.finest, camera, *window, m, options);
    LevelSolver solver(camera, render_scene_, target_, options.finest, view, options, e);
    solver.linearise_with_many_samples();
    std::vector<const Suspect*> solved;
    const auto test = [&] {
        std::vector<Suspicion> found = solver.suspicions();
        for (Suspicion& s : found) s.solved = std::ranges::find(solved, s.suspect) != solved.end();
        std::ranges::stable_sort(found, std::greater(), [](const Suspicion& s) { return s.fit.sigmas; });
        return found;
    };
    if (has_independent_noise()) e.suspicions = test();
    const std::vector<Suspicion> before = e.suspicions;
    // The attitude of a smooth body turns with the light, and a light that moves the pose far may hide another
    // minimum: a cylinder was 11 degrees off at residuals of 0.98.
    const bool turns = std::ranges::any_of(before, [&](const Suspicion& s) {
        return s.suspect->prior > 0 && s.fit.sigmas > kUntold_sigmas &&
               (s.fit.rotation_response > kTurnsWithLight ||
                normalised_error_squared(s.fit.shift, e.covariance) > kUntoldFar_chi2);
    });
    for (int k = 0; k < kLightsSolved && !e.suspicions.empty() && !turns; ++k) {
        const Suspicion& worst = e.suspicions.front();
        if (!worst.suspect->is_light || !(worst.fit.sigmas > kUntold_sigmas)) break;
        solved.push_back(worst.suspect);
        solver.solve(worst);
        solver.linearise_with_many_samples();
        e.suspicions = test();
        e.residual = fit.residual = solver.residual();
    }
    const Vector6 left = solver.remaining_step();
    e.covariance += left * left.transpose();
    for (const Suspicion& s : e.suspicions)
        e.covariance += s.solved ? s.fit.covariance_without_prior : s.fit.covariance;
    observe(e.T_camera_body, e.covariance, fit);
    if (fit.residual > fit.residual_max) {
        fit.failed = fmt::format("residuals are {:.3g} times what noise explains, expected at most {:.3g}",
                                 fit.residual, fit.residual_max);
        if (!before.empty() && before.front().fit.sigmas > kUntold_sigmas)
            fit.failed += fmt::format("; {}", before.front().suspect->sentence);
    }
    for (const Suspicion& s : e.suspicions)
        if (fit.failed.empty())
            fit.failed = why_untold(s.suspect->sentence, s.fit.sigmas, s.fit.shift, e.covariance);
}

/// Steps along the observed motions follow, as these are not independent of the others over the guess's error.
void DenseAlignment::keep_guess_where_unobserved(const Measured& m, const Rigid3& guess,
                                                 const DenseOptions& options, DenseEstimate& e, Fit& fit) {
    const Observability o = fit.observability;
    e.T_camera_body = displaced(e.T_camera_body, unobserved_part(o, error_between(e.T_camera_body, guess)));
    const Camera camera = coarser_camera(camera_, options.finest);
    const auto window = window_about(render_scene_.tracer(), camera, target_, e.T_camera_body);
    if (!window) return;
    LevelView& view = level(options.finest, camera, *window, m, options);
    LevelSolver(camera, render_scene_, target_, options.finest, view, options, e).step_along_observed(o);
    e.covariance = with_guess(o, e.covariance_of_image(), options.guess_error, norm(e.T_camera_body.t)) +
                   e.covariance_of_model;
    observe(e.T_camera_body, e.covariance, fit);
}

}  // namespace narpa
