#include "estimator/batch/batch_nodes.h"

#include <algorithm>

namespace narpa {
namespace {

/// Measurements closer in time have one state.
constexpr std::int64_t kSameTime_ns = 1000;

/// The state of a target that rests there.
RelativeState state_at(const BatchObservation& o) {
    const Rigid3 T_chaser_target = o.place.T_chaser_sensor * o.T_sensor_target;
    RelativeState state;
    state.position_m = o.place.q_frame_chaser * T_chaser_target.t;
    state.q_frame_target = normalized(o.place.q_frame_chaser * T_chaser_target.q);
    return state;
}

void set_rates(std::vector<BatchNode>& nodes) {
    const std::vector<BatchNode> poses = nodes;
    for (std::size_t k = 0; k < nodes.size(); ++k) {
        const BatchNode &before = poses[k > 0 ? k - 1 : 0], &after = poses[std::min(k + 1, nodes.size() - 1)];
        const double dt_s = 1e-9 * static_cast<double>(after.time->t_ns - before.time->t_ns);
        if (!(dt_s > 0)) continue;
        nodes[k].state.velocity_m_s = (after.state.position_m - before.state.position_m) / dt_s;
        nodes[k].state.rate_rad_s =
            rotation_vector(conjugate(before.state.q_frame_target) * after.state.q_frame_target) / dt_s;
    }
}

}  // namespace

std::vector<BatchObservation> observations_of(const BatchInput& input, bool are_states_when_measured) {
    std::vector<BatchObservation> all;
    const auto add = [&](const BatchTime& time, BatchMeasure measure, const Rigid3& T,
                         std::unique_ptr<Measurement> measurement) {
        const bool is_sweep = measure == BatchMeasure::sweep;
        SensorPlace place{is_sweep ? input.T_chaser_lidar : input.T_chaser_camera,
                          time.q_frame_chaser,
                          time.chaser_rate_rad_s,
                          is_sweep ? BatchUnknown::lidar_rx : BatchUnknown::camera_rx,
                          is_sweep ? BatchUnknown::lidar_x : BatchUnknown::camera_x,
                          is_sweep || input.sweeps.empty(),
                          are_states_when_measured};
        all.push_back({&time, measure, all.size(), T, place, std::move(measurement)});
    };
    for (const BatchFrame& f : input.frames)
        add(f.time, BatchMeasure::points, f.T_camera_target, measurement_of(input.camera, f.points));
    for (const BatchSweep& s : input.sweeps)
        add(s.time, BatchMeasure::sweep, s.T_lidar_target,
            measurement_of(*input.tracer, input.target, input.noise, s.returns));
    for (const BatchFrame& f : input.frames)
        if (!f.brightness.blocks.empty())
            add(f.time, BatchMeasure::brightness, f.T_camera_target, measurement_of(f.brightness));
    std::ranges::stable_sort(all, {}, [](const BatchObservation& o) { return o.time->t_ns; });
    return all;
}

std::vector<BatchNode> nodes_of(std::vector<BatchObservation>& observations) {
    std::vector<BatchNode> nodes;
    for (BatchObservation& o : observations) {
        if (nodes.empty() || o.time->t_ns - nodes.back().time->t_ns > kSameTime_ns)
            nodes.push_back({o.time, state_at(o)});
        o.node = nodes.size() - 1;
    }
    set_rates(nodes);
    return nodes;
}

}  // namespace narpa
