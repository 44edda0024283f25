/// estimator/dense/level_solver.h - Levenberg-Marquardt on one pyramid level of one frame.
///
/// Its steps are those of levenberg_marquardt.h, but not its loop: each cost is that of a new render with sampling
/// noise, so short steps are accepted without a test, and pixels are chosen and Jacobians replaced between steps.
#pragma once

#include "estimator/dense/dense_alignment.h"
#include "estimator/dense/level_view.h"
#include "estimator/dense/model_suspects.h"

namespace narpa {

/// Finite, and a rotation.
[[nodiscard]] bool is_pose(const Rigid3& T);

/// Factor of the pyramid level after one whose pixels are `factor` sensor pixels wide; 0 after the finest. With a
/// large target (`extent_px`, sensor pixels) a level determines the pose to a small part of its pixels, so that the
/// next, last level may have pixels a quarter as wide.
[[nodiscard]] int next_level(int factor, int finest, double extent_px);

class LevelSolver {
public:
    /// All references outlive it. `camera`: of the level; each of its pixels covers `factor` x `factor` sensor
    /// pixels.
    LevelSolver(const Camera& camera, const RenderScene& render_scene, std::size_t target, int factor,
                LevelView& view, const DenseOptions& options, DenseEstimate& estimate);

    /// Iterates on this level. `first`: first searches over shifts by whole pixels, as a guess may be off by more
    /// than the Jacobian is valid for.
    DenseStatus run(bool first);
    /// One more step with many more rays, against the sampling noise of the rendered image.
    void refine_with_many_samples();
    /// Covariance, residuals and status at the last rendered pose. Leaves another pose rendered.
    void finish();
    /// Evaluates the loss at the estimate's pose again, over this view's pixels.
    void evaluate_loss();
    /// True if a pose this far from the estimate's may belong to one minimum with it.
    [[nodiscard]] bool may_be_same_minimum(const Vector6& way) const;
    /// Remaining distance to the other pose after steps from the estimate's; empty if they do not lead there or
    /// most of the way, or if the distance exceeds the Jacobian's validity. Computes a Jacobian if the view has
    /// none there.
    [[nodiscard]] std::optional<Vector6> distance_after_steps_to(const Rigid3& T_camera_body);
    /// Renders with as many samples as the last step and linearises at the estimate's pose.
    void linearise_with_many_samples();
    /// After linearise_with_many_samples(): tests for errors of the model (model_suspects.h).
    [[nodiscard]] std::vector<Suspicion> suspicions();
    /// Adds a light that a test found to the prediction, and takes the step that goes with it.
    void solve(const Suspicion& s);
    /// RMS residual over that expected from noise (DenseEstimate::residual).
    [[nodiscard]] double residual() const;
    /// After linearise_with_many_samples(): the step that is left.
    [[nodiscard]] Vector6 remaining_step() const;
    /// A few steps from the estimate's pose, none along the unobserved motions.
    void step_along_observed(const Observability& o);
    struct Rise {
        double min, max;
    };
    /// After linearise_with_many_samples(): smallest and largest rise of the loss along the `motions` least
    /// observed motions, at this many standard deviations to both sides, over that of a linear image. About one if
    /// the image is linear so far. Motions that count as unobserved are left out.
    [[nodiscard]] Rise rise(int motions, double sigmas);
    /// The bound of DenseAlignment::bound, at the estimate.
    Result<Matrix6> bound();

private:
    struct Step {
        Vector6 pose = Vector6::Zero();
        double motion_px = 0;
        double sigmas = 0;     ///< standard deviations of the pose
        double size = 0;       ///< below 1: small enough to end with
        bool trusted = false;  ///< so small that noise decides whether the cost decreases
    };

    /// Images with which suspects' columns are made: few samples are enough for differences.
    [[nodiscard]] FrameSettings settings_of_suspects() const;
    /// Of the view, with the sampling noise's size as estimated.
    [[nodiscard]] PhotometricImages images() const;
    /// Estimates that size if the frame's own noise is not known.
    void measure_noise();
    void shift();
    DenseStatus iterate(int samples);
    void choose(const Vector6& step);
    void render(const Rigid3& T);
    /// With the reach and fineness that the next step needs.
    void differentiate();
    void differentiate(double reach_px, int fineness);
    bool linearise();
    [[nodiscard]] Step next_step(double damping) const;
    /// Approximate largest motion of a point of the target in the image.
    [[nodiscard]] double distance_px(const Vector6& step) const;
    bool try_step(const Step& step);
    [[nodiscard]] Exposure after(const Step& step) const;
    /// Applies the step without rendering.
    void take(const Step& step);
    void adapt_stride(const Step& step);
    /// Response of the image to motions, as errors of the pose: the identity if the Jacobian is exact. `last`: the
    /// equations at the last rendered pose.
    [[nodiscard]] Matrix6 response_to_motions(const PhotometricEquations& last);
    /// Covariance from the model's uncertainty, at the last rendered pose.
    [[nodiscard]] Matrix6 covariance_of_model(const PhotometricEquations& equations);

    const Camera& camera_;
    const double pixels_per_radian_;
    const RenderScene& render_scene_;
    const std::size_t target_;
    LevelView& view_;
    const DenseOptions& o_;
    DenseEstimate& e_;
    const bool coarse_;
    const double converged_px_;
    FrameSettings settings_{};
    bool choosing_;  ///< informative pixels of a large target are still to be chosen

    Robustness robust_{};
    PhotometricCost cost_{};
    PhotometricEquations equations_{};
    Vector6 last_step_ = Vector6::Zero();
    double stride_ = 1;                ///< factor of the step length
    double loss_when_linearised_ = 0;  ///< of linearise_with_many_samples()
};

}  // namespace narpa
