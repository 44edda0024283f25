// DenseAlignment: errors of the model that are not told, and motions that the image does not show.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "estimator/dense/dense_alignment.h"
#include "estimator/dense/dense_tuning.h"
#include "estimator/dense/level_solver.h"
#include "estimator/uncertainty/unobserved.h"
#include "estimator/uncertainty/untold.h"

namespace narpa {
using namespace dense_tuning;

namespace {

/// The attitude of a smooth body turns with the light, and a light that moves the pose far may hide another
/// minimum: a cylinder was 11 degrees off at residuals of 0.98.
bool turns_with_light(const Suspicion& s, const Matrix6& covariance) {
    return s.suspect->prior > 0 && s.fit.sigmas > kUntold_sigmas &&
           (s.fit.rotation_response > kTurnsWithLight ||
            normalised_error_squared(s.fit.shift, covariance) > kUntoldFar_chi2);
}

bool is_solved(const Suspect& suspect, bool lacks_details) {
    return suspect.solved == Suspect::Solved::always ||
           (suspect.solved == Suspect::Solved::if_details_lack && lacks_details);
}

/// Of a blur that the image's second derivative does not describe: the camera's own should be stated. Empty: none.
std::string too_blurred(const Suspicion& s, const Camera& camera) {
    if (s.suspect->most == 0) return {};
    const double own_px = camera.optics.point_spread ? camera.optics.point_spread->sigma_px : 0;
    const double more_px2 = std::max(std::abs(s.fit.amounts[0]), std::abs(s.fit.amounts[1]));
    if (more_px2 <= s.suspect->most * (1 + own_px * own_px)) return {};
    return fmt::format("{} It is about {:.2g} px, too large to be solved: state the camera's psf",
                       s.suspect->sentence, std::sqrt(more_px2 + own_px * own_px));
}

/// Tests of the solver's linearisation, the most shown error first; `solved` are marked as such.
std::vector<Suspicion> ordered_suspicions(LevelSolver& solver, std::span<const Suspect* const> solved) {
    std::vector<Suspicion> found = solver.suspicions();
    for (Suspicion& s : found) s.solved = std::ranges::find(solved, s.suspect) != solved.end();
    std::ranges::stable_sort(found, std::greater(), [](const Suspicion& s) { return s.fit.sigmas; });
    return found;
}

/// The error that these residuals show most; null: none.
const Suspicion* shown_by(const std::vector<Suspicion>& suspicions) {
    return !suspicions.empty() && suspicions.front().fit.sigmas > kUntold_sigmas ? &suspicions.front() : nullptr;
}

/// An error of the model that the residuals show and that moves the pose refuses it. Where the model is known to
/// lack details, the shift is part of the covariance instead, up to a limit.
void refuse_or_widen(const ModelUncertainty& model, const Suspicion* shown, DenseEstimate& e, Fit& fit) {
    Matrix6 widened = e.covariance;
    for (const Suspicion& s : e.suspicions) {
        if (!refuses(s.fit.sigmas, s.fit.shift, e.covariance)) continue;
        if (model.detail > 0 && normalised_error_squared(s.fit.shift, e.covariance) < kWidenedShift_chi2) {
            widened += s.fit.shift * s.fit.shift.transpose();
        } else if (fit.failed.empty()) {
            // Errors resemble each other: the one that the residuals show most is named, whichever moves the pose.
            const Suspicion& named = shown ? *shown : e.suspicions.front();
            fit.failed = why_untold(named.suspect->sentence, named.fit.sigmas, s.fit.shift, e.covariance);
        }
    }
    e.covariance = widened;
}

}  // namespace

/// Tests for errors of the model that no uncertainty states. Those of the light are solved with the pose. Of an
/// answer that another test refuses, the error that the residuals show is named.
void DenseAlignment::test_model(const Measured& m, const DenseOptions& options, DenseEstimate& e, Fit& fit) {
    const Camera camera = coarser_camera(camera_, options.finest);
    const auto window = window_about(render_scene_.tracer(), camera, target_, e.T_camera_body);
    if (!window) return;
    LevelView& view = level(options.finest, camera, *window, m, options);
    LevelSolver solver(camera, render_scene_, target_, options.finest, view, options, e);
    solver.linearise_with_many_samples();
    if (has_independent_noise() || options.model.detail > 0) e.suspicions = ordered_suspicions(solver, {});
    const std::vector<Suspicion> before = e.suspicions;
    const Suspicion* shown = shown_by(before);
    if (!fit.failed.empty()) {
        if (shown) fit.failed += fmt::format("; {}", shown->suspect->sentence);
        return;
    }
    fit.failed = solve_shown(solver, options.model.detail > 0, e);
    if (!fit.failed.empty()) return;
    fit.residual = e.residual;
    const Vector6 left = solver.remaining_step();
    e.covariance += left * left.transpose();
    for (const Suspicion& s : e.suspicions)
        e.covariance += s.solved ? s.fit.covariance_without_prior : s.fit.covariance;
    observe(e.T_camera_body, e.covariance, fit);
    if (fit.residual > fit.residual_max) {
        fit.failed =
            fmt::format("residuals are {:.3g} times what noise explains, expected at most {:.3g}{}{}", fit.residual,
                        fit.residual_max, shown ? "; " : "", shown ? shown->suspect->sentence : "");
        return;
    }
    refuse_or_widen(options.model, shown, e, fit);
    observe(e.T_camera_body, e.covariance, fit);
}

/// As long as the error that the residuals show most can be solved: adds it to the prediction.
/// Returns why there is no pose; empty: none.
std::string DenseAlignment::solve_shown(LevelSolver& solver, bool lacks_details, DenseEstimate& e) const {
    if (std::ranges::any_of(e.suspicions, [&](const Suspicion& s) { return turns_with_light(s, e.covariance); }))
        return {};
    std::vector<const Suspect*> solved;
    for (int k = 0; k < kLightsSolved; ++k) {
        const Suspicion* worst = shown_by(e.suspicions);
        if (!worst || !is_solved(*worst->suspect, lacks_details)) return {};
        if (std::string why = too_blurred(*worst, camera_); !why.empty()) return why;
        solved.push_back(worst->suspect);
        solver.solve(*worst);
        solver.linearise_with_many_samples();
        e.suspicions = ordered_suspicions(solver, solved);
        e.residual = solver.residual();
    }
    return {};
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
