/// tracking/sweep_tracker.h - the pose of a target from a LiDAR's sweep to sweep, as a navigation computer would
/// know it, with the truth beside it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "estimator/cloud/range_points.h"
#include "estimator/search/cloud_search.h"
#include "tracking/target_tracker.h"

namespace narpa {

class SweepTracker {
public:
    /// `world` outlives it. Errors: no such target, no body to estimate. The options of cameras have no effect.
    static Result<std::unique_ptr<SweepTracker>> create(const World& world, std::size_t lidar,
                                                        const TrackerOptions& options);
    /// The same with the target's surface and the LiDAR's mount of another world, whose scene differs in these.
    static Result<std::unique_ptr<SweepTracker>> create(const World& world, const World& model, std::size_t lidar,
                                                        const TrackerOptions& options);

    [[nodiscard]] std::size_t target() const noexcept { return target_; }

    /// Takes the returns of a whole sweep between two times, for which the world has all poses; times of beams
    /// count from `begin_ns`. The pose is that at the mean time of the returns. Of the world only the chaser's own
    /// attitude, the relative motion during the sweep, and the truth for the errors are used; and that for the
    /// guess until a sweep has given a pose. (The filter's motion, which knows no thrust, is not exact enough: on a
    /// braking approach the NEES was 17 with it, and 6.1 with the true one.)
    TrackedFrame take(std::int64_t number, std::int64_t begin_ns, std::int64_t end_ns, LidarSweep sweep);
    /// Of the last sweep: returns that the chaser does not cause, with times from that of the pose on, and the
    /// target's motion, LiDAR axes.
    [[nodiscard]] const std::vector<RangePoint>& points() const noexcept { return sweep_.points; }
    [[nodiscard]] const ApparentMotion& motion() const noexcept { return motion_; }

private:
    SweepTracker(const World& world, const World& model, std::size_t lidar, std::size_t target,
                 const TrackerOptions& options);
    /// The truth. `q_frame_chaser`: if not null, receives the chaser's attitude.
    [[nodiscard]] Rigid3 T_lidar_target_at(std::int64_t t_ns, Quat* q_frame_chaser = nullptr) const;
    [[nodiscard]] ApparentMotion motion_about(std::int64_t t_ns, std::int64_t length_ns) const;
    void measure(const Quat& q_frame_chaser, TrackedFrame& out);
    /// The chaser is the body that carries the LiDAR, or the LiDAR itself.
    [[nodiscard]] Rigid3 T_chaser_lidar() const { return lidar_.mount < 0 ? Rigid3{} : lidar_.T_mount_lidar; }

    const World& world_;
    const World& model_;
    const Lidar& lidar_;
    std::size_t target_;
    double reach_m_;  ///< bounding radius of the target about its origin
    TargetTracker tracker_;
    IcpSettings settings_;
    CloudIcp icp_;
    std::optional<CloudSearch> search_;  ///< where the options ask for it
    LidarSweep sweep_;                   ///< the last
    ApparentMotion motion_{};            ///< during it
};

}  // namespace narpa
