/// estimator/marks/mark_alignment.h - the pose of a cooperative target from its marks: lamps, reflectors, square
/// tags.
///
/// Tags are identified by their pattern, lamps and reflectors by their places near the guess (mark_matcher.h). The
/// pose is that of perspective-n-point from centroids of discs and from the sides of tags (mark_fit.h). No view of
/// the target is rendered; of its shape only what hides marks is used.
#pragma once

#include <string>
#include <vector>

#include "estimator/marks/mark_points.h"
#include "estimator/pnp/point_observations.h"
#include "estimator/uncertainty/answer.h"
#include "estimator/uncertainty/model_uncertainty.h"
#include "estimator/view/row_times.h"
#include "renderer/light/render_scene.h"

namespace narpa {

class MarkFit;

struct MarkEstimate {
    Rigid3 T_camera_target{};
    /// From the sensor's noise and the scatter beyond it, plus that of a second pose which cannot be told from it,
    /// plus the model's uncertainty.
    Matrix6 covariance = Matrix6::Zero();
    Matrix6 covariance_of_model = Matrix6::Zero();
    /// Cramer-Rao for the centroids and sides with the sensor's noise and the model's uncertainty alone.
    Matrix6 bound = Matrix6::Zero();
    int marks = 0;       ///< that the pose uses
    double scatter = 0;  ///< MarkFit::scatter
    Answer answer;
    PointObservations points;  ///< of the marks that the pose uses
};

/// The marks of one body in the frames of one camera.
class MarkAlignment {
public:
    /// `render_scene` outlives it. `target`: index of the body.
    MarkAlignment(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                  const ModelUncertainty& model = {});

    /// `motion`: the target's during the exposure, camera axes.
    [[nodiscard]] MarkEstimate align(const MeasuredImage& frame, const Rigid3& guess,
                                     const ApparentMotion& motion = {}) const;
    /// Exposure and gain of the frames from now on.
    void set_detector(const Detector& detector);

private:
    [[nodiscard]] MarkPoints tags_in(const MeasuredImage& frame) const;
    [[nodiscard]] Rigid3 pose_of_tags(const MarkPoints& tags, const Rigid3& guess,
                                      const ApparentMotion& motion) const;
    [[nodiscard]] std::string add_discs(const MeasuredImage& frame, Rigid3& near, MarkPoints& points) const;
    /// True if nothing of the target hides a part of the disc, or lies beside its rim.
    [[nodiscard]] bool is_clear(const Mark& mark, const DiscView& view, const Rigid3& T_camera_target) const;
    [[nodiscard]] MarkFit without_wrong_marks(MarkPoints points, const Rigid3& near,
                                              const ApparentMotion& motion) const;
    /// Empty if the fit uses most of the discs that nothing hides; else what is missing.
    [[nodiscard]] std::string too_few(const MarkFit& fitted) const;
    void state(const MarkFit& fitted, const ApparentMotion& motion, MarkEstimate& e, Fit& fit) const;

    const RenderScene& render_scene_;
    std::size_t target_;
    BodyPoses at_;  ///< the target at the origin
    Camera camera_;
    SensorModel sensor_;
    RowTimes times_;
    ModelUncertainty model_;
    std::vector<Mark> marks_;
};

}  // namespace narpa
