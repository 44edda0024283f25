#include "tracking/sweep_tracker.h"

#include <cmath>
#include <utility>

#include "base/time.h"
#include "estimator/cloud/own_body.h"

namespace narpa {
namespace {

IcpSettings icp_settings(const World& world, const Lidar& lidar, const TrackerOptions& options) {
    IcpSettings settings{
        .noise = range_noise_of(lidar), .certain = certain_return_of(lidar, world.scene()), .model = options.model};
    if (options.range_noise_m > 0) settings.noise.range_m = options.range_noise_m;
    return settings;
}

/// Sets the time from which beams count to the mean time of the returns: at another time, an error of the motion
/// would shift the pose. Returns how much later that is, ns; `otherwise` where there are no returns.
std::int64_t centre_times(LidarSweep& sweep, std::int64_t otherwise) {
    double mean_s = 0;
    for (const RangePoint& p : sweep.points) mean_s += p.t_s / static_cast<double>(sweep.points.size());
    const std::int64_t later_ns = sweep.points.empty() ? otherwise : std::llround(1e9 * mean_s);
    const double later_s = 1e-9 * static_cast<double>(later_ns);
    for (RangePoint& p : sweep.points) p.t_s -= later_s;
    for (EmptyBeam& b : sweep.empty) b.t_s -= later_s;
    return later_ns;
}

}  // namespace

SweepTracker::SweepTracker(const World& world, const World& model, std::size_t lidar, std::size_t target,
                           const TrackerOptions& options)
    : world_(world),
      model_(model),
      lidar_(model.scene().lidars[lidar]),
      target_(target),
      reach_m_(model.tracer().bounding_radius_m(static_cast<std::uint32_t>(target))),
      tracker_(options),
      settings_(icp_settings(model, lidar_, options)),
      icp_(model.tracer(), target, settings_) {
    if (options.search) search_.emplace(model.tracer(), target, settings_);
}

Result<std::unique_ptr<SweepTracker>> SweepTracker::create(const World& world, std::size_t lidar,
                                                           const TrackerOptions& options) {
    return create(world, world, lidar, options);
}

Result<std::unique_ptr<SweepTracker>> SweepTracker::create(const World& world, const World& model,
                                                           std::size_t lidar, const TrackerOptions& options) {
    const Lidar& l = model.scene().lidars[lidar];
    const auto target = target_of(world, l.mount, l.name, options.target);
    if (!target) return target.error();
    return std::unique_ptr<SweepTracker>(new SweepTracker(world, model, lidar, *target, options));
}

Rigid3 SweepTracker::T_lidar_target_at(std::int64_t t_ns, Quat* q_frame_chaser) const {
    BodyPoses bodies(world_.scene().bodies.size());
    world_.place(t_ns, lidar_.mount, bodies);
    const Rigid3 T_world_lidar = world_.sensor_pose(lidar_.mount, lidar_.T_mount_lidar, bodies);
    if (q_frame_chaser) *q_frame_chaser = (T_world_lidar * inverse(T_chaser_lidar())).q;
    return inverse(T_world_lidar) * bodies.T_world_body[target_];
}

ApparentMotion SweepTracker::motion_about(std::int64_t t_ns, std::int64_t length_ns) const {
    return motion_between(T_lidar_target_at(t_ns - length_ns / 2), T_lidar_target_at(t_ns + length_ns / 2),
                          1e-9 * static_cast<double>(length_ns));
}

void SweepTracker::measure(const Quat& q_frame_chaser, TrackedFrame& out) {
    const auto e =
        search_ && !tracker_.started()
            ? search_->find(sweep_.points, motion_, sweep_.empty)
            : icp_.align(sweep_.points, motion_, out.guess, tracker_.search_radius_m(norm(out.truth.t), reach_m_),
                         sweep_.empty, tracker_.guess_covariance(T_chaser_lidar(), q_frame_chaser, out.guess));
    if (!e) {
        out.why = e.error().what;
        return;
    }
    out.matches = static_cast<int>(e->used);
    out.bound = e->bound;
    out.take(e->answer, e->T_lidar_target, e->covariance, e->covariance_of_model);
}

TrackedFrame SweepTracker::take(std::int64_t number, std::int64_t begin_ns, std::int64_t end_ns, LidarSweep sweep) {
    const std::int64_t start_ns = monotonic_ns();
    sweep_ = std::move(sweep);
    remove_own_body(model_.tracer(), lidar_, sweep_);
    TrackedFrame out;
    out.frame = static_cast<std::uint32_t>(number);
    out.t_ns = begin_ns + centre_times(sweep_, (end_ns - begin_ns) / 2);
    Quat q_frame_chaser;
    out.truth = T_lidar_target_at(out.t_ns, &q_frame_chaser);
    tracker_.predict(out.t_ns, q_frame_chaser);
    out.guess = tracker_.guess(T_chaser_lidar(), q_frame_chaser, out.truth);
    const bool searched = search_ && !tracker_.started();
    motion_ = motion_about(out.t_ns, end_ns - begin_ns);
    measure(q_frame_chaser, out);
    tracker_.update(T_chaser_lidar(), q_frame_chaser, !searched, out);
    out.ms = seconds_since(start_ns) * 1e3;
    return out;
}

}  // namespace narpa
