/// estimator/dense/level_solver.h - Levenberg-Marquardt on one pyramid level of one frame.
#pragma once

#include "estimator/dense/dense_alignment.h"
#include "estimator/dense/level_view.h"

namespace narpa {

/// Finite, and a rotation.
[[nodiscard]] bool is_pose(const Rigid3& T);

/// The pyramid level after one whose pixels are `factor` sensor pixels wide; 0 after the finest. Where the target
/// is large (`extent_px`, sensor pixels), a level finds the pose to so few of its pixels that the last step may be
/// to pixels a quarter as wide.
[[nodiscard]] int next_level(int factor, int finest, double extent_px);

class LevelSolver {
public:
    /// All outlive it. `camera`: of the level, each of whose pixels is `factor` x `factor` of the sensor's.
    LevelSolver(const Camera& camera, const RenderScene& render_scene, std::size_t target, int factor,
                LevelView& view, const DenseOptions& options, DenseEstimate& estimate);

    /// Iterates on this level; `first`: after a search over shifts by whole pixels, as a guess may be off by more
    /// than the Jacobian is valid for.
    DenseStatus run(bool first);
    /// One more step with many more rays, against the sampling noise of the rendered image.
    void polish();
    /// Covariance, residuals and status at the last rendered pose. Leaves another pose rendered.
    void finish();
    /// The loss at the estimate's pose again, of this view's pixels.
    void weigh();
    /// Steps from the estimate's pose end so far from the other; nothing where they do not lead there or most of
    /// the way, or where one of them is beyond the Jacobian's reach. Takes a Jacobian where the view has none of
    /// there.
    [[nodiscard]] std::optional<Vector6> miss(const Rigid3& T_camera_body);
    /// Renders with the last step's rays and linearises at the estimate's pose.
    void examine();
    struct Rise {
        double least, most;
    };
    /// After examine(): how the loss rises along the `motions` that the image holds least, over what it should,
    /// at this many standard deviations to both sides. About one where the image is linear so far.
    [[nodiscard]] Rise rise(int motions, double sigmas);
    /// DenseAlignment::bound at the estimate.
    Result<Matrix6> bound();

private:
    struct Step {
        Vector6 pose = Vector6::Zero();
        double motion_px = 0;
        double sigmas = 0;     ///< standard deviations of the pose
        double size = 0;       ///< below 1: small enough to end with
        bool trusted = false;  ///< so small that noise decides whether the cost decreases
    };

    void shift();
    DenseStatus iterate(int samples);
    void choose(const Vector6& step);
    void render(const Rigid3& T);
    /// As the next step needs it.
    void differentiate();
    void differentiate(double reach_px, int fineness);
    bool linearise();
    [[nodiscard]] Step next_step(double damping) const;
    /// Largest motion of a point of the target in the image, about.
    [[nodiscard]] double distance_px(const Vector6& step) const;
    bool try_step(const Step& step);
    [[nodiscard]] Exposure after(const Step& step) const;
    /// Without an image.
    void take(const Step& step);
    void adapt_stride(const Step& step);
    /// What the image shows of motions, as errors of the pose: the identity where the Jacobian is right. `last`:
    /// the equations at the last rendered pose.
    [[nodiscard]] Matrix6 response_to_motions(const PhotometricEquations& last);
    /// By what is not known of the model, at the last rendered pose.
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
    bool choosing_;  ///< the pixels that hold the pose are to be chosen: the target is large, and they are not yet

    Robustness robust_{};
    PhotometricCost cost_{};
    PhotometricEquations equations_{};
    Vector6 last_step_ = Vector6::Zero();
    double stride_ = 1;         ///< factor of the step length
    double examined_loss_ = 0;  ///< of examine()
};

}  // namespace narpa
