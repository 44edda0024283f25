/// rehearsal/navigation/estimation/velocimeter.h - velocities along the beams of a Doppler LiDAR, and over ground
/// their ranges, as received over CAN.
#pragma once

#include <optional>
#include <vector>

#include "protocols/lidar_beam.h"
#include "rehearsal/navigation/estimation/scene_model.h"
#include "rehearsal/navigation/estimation/state_estimator.h"

namespace narpa::rehearsal {

class Velocimeter {
public:
    /// `model` outlives it. `lidar`: index in the scene.
    Velocimeter(const SceneModel& model, std::size_t lidar, const Navigation& map = {});

    [[nodiscard]] const Lidar& lidar() const noexcept { return lidar_; }
    [[nodiscard]] std::size_t index() const noexcept { return index_; }
    /// The velocity with its beam; none if the shot has none, or if it ends outside the sphere around the target at
    /// `T_chaser_target` (predicted, body axes).
    [[nodiscard]] std::optional<TargetVelocity> measure(const LidarBeamReport& report,
                                                        const Rigid3& T_chaser_target) const;
    /// The range, with the plane of the model's surface at the beam's expected hit. The surface's deviation from a
    /// plane within `position_sigma_m`, the uncertainty of the pose, is part of the standard deviation. None if
    /// there is no range or no surface, or if the beam meets nearly the same place as at its last measurement,
    /// where the map's error is the same.
    [[nodiscard]] std::optional<TargetRange> measure_range(const LidarBeamReport& report,
                                                           const Rigid3& T_chaser_target, double position_sigma_m);

private:
    [[nodiscard]] std::optional<double> range_in_model(const Vec3& origin_m, const Vec3& direction) const;

    const SceneModel& model_;
    Lidar lidar_;
    std::size_t index_;
    std::vector<LidarShot> beams_;  ///< by beam number
    double map_sigma_m_, map_correlation_m_;
    std::vector<std::optional<Vec3>> measured_m_;  ///< last measured point of each beam, target's axes
    Vec3 target_centre_m_;
    double target_radius_m_;
};

}  // namespace narpa::rehearsal
