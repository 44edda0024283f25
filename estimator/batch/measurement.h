/// estimator/batch/measurement.h - what one frame or sweep measures, as residuals of pose and shared unknowns.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "estimator/batch/batch_unknowns.h"
#include "estimator/batch/brightness.h"
#include "estimator/cloud/beam_association.h"
#include "estimator/pnp/point_observations.h"

namespace narpa {

/// N numbers, in groups of `dimension` (the u and v of a point; one distance), measured minus predicted.
struct Residuals {
    Eigen::VectorXd value;
    /// Columns: the pose's error (pose_estimate.h), then the unknowns of Measurement::unknowns().
    Eigen::MatrixXd jacobian;
};

class Measurement {
public:
    virtual ~Measurement() = default;

    [[nodiscard]] virtual int dimension() const noexcept = 0;
    /// The unknowns, beside mount and clock, that change what is measured at a given pose.
    [[nodiscard]] virtual std::span<const BatchUnknown> unknowns() const noexcept = 0;
    /// Finds correspondences that depend on the pose. Before the first evaluate().
    virtual void associate(const Rigid3& T_sensor_target, const BatchValues& unknowns) = 0;
    /// False if a point has no image.
    [[nodiscard]] virtual bool evaluate(const Rigid3& T_sensor_target, const BatchValues& unknowns,
                                        Residuals& out) const = 0;
    /// True if its own pose follows from its residuals; false: only its unknowns do.
    [[nodiscard]] virtual bool has_pose() const noexcept { return true; }
    /// Covariance of group i: that of the sensor's noise, and that for a scatter of one beyond it.
    [[nodiscard]] virtual Eigen::Matrix2d noise(std::size_t i) const = 0;
    [[nodiscard]] virtual Eigen::Matrix2d beyond(std::size_t i) const = 0;
    /// Part of the errors, 0 to 1, that two groups share.
    [[nodiscard]] virtual double shared(std::size_t, std::size_t) const { return 0; }
    /// Standard deviation of an error in each dimension that all groups have in common.
    [[nodiscard]] virtual double common(std::size_t) const { return 0; }
    [[nodiscard]] virtual bool has_shared() const noexcept { return false; }
    /// Which part of the target a group belongs to, if errors of model and light are common to parts; from 0 on and
    /// below parts(). 0 parts: they are not.
    [[nodiscard]] virtual std::size_t parts() const noexcept { return 0; }
    [[nodiscard]] virtual std::size_t part(std::size_t) const { return 0; }
    [[nodiscard]] virtual double scatter_min() const noexcept { return 0; }
    /// On the covariance of what is estimated.
    [[nodiscard]] virtual double inflation() const noexcept { return 1; }
    /// Numbers that group i measures: `dimension`, or fewer where a direction carries no information.
    [[nodiscard]] virtual int numbers(std::size_t) const { return dimension(); }
};

/// Points of a frame. `camera`: by the model.
[[nodiscard]] std::unique_ptr<Measurement> measurement_of(std::shared_ptr<const CameraModel> camera,
                                                          const PointObservations& points);

[[nodiscard]] std::unique_ptr<Measurement> measurement_of(const BrightnessObservations& brightness);

/// A LiDAR's returns of one sweep, as distances from the model's tangent planes.
struct SweepObservations {
    std::vector<RangePoint> points;  ///< times from that of the pose on
    ApparentMotion motion{};         ///< the target's during the sweep, LiDAR axes
};
/// `tracer` and `sweep` outlive it. `target`: index of the body.
[[nodiscard]] std::unique_ptr<Measurement> measurement_of(const Tracer& tracer, std::size_t target,
                                                          const RangeNoise& noise, const SweepObservations& sweep);

}  // namespace narpa
