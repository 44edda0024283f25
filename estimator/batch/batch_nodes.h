/// estimator/batch/batch_nodes.h - the times at which a batch estimates the state, and where it starts.
#pragma once

#include <vector>

#include "estimator/batch/batch_solver.h"
#include "estimator/batch/sensor_geometry.h"

namespace narpa {

/// A frame or sweep with what it measures.
struct BatchObservation {
    const BatchTime* time = nullptr;
    BatchMeasure measure = BatchMeasure::points;
    std::size_t index = 0;  ///< in BatchResult::residuals
    Rigid3 T_sensor_target{};
    SensorPlace place;
    std::unique_ptr<Measurement> measurement;
    std::size_t node = 0;
};

struct BatchNode {
    const BatchTime* time = nullptr;
    RelativeState state{};
};

/// All frames and sweeps, in order of time. `are_states_when_measured`: SensorPlace::is_state_when_measured of all.
[[nodiscard]] std::vector<BatchObservation> observations_of(const BatchInput& input, bool are_states_when_measured);
/// A node for each time, with the observations' poses; velocities and rates from those of their neighbours. Sets
/// the observations' nodes.
[[nodiscard]] std::vector<BatchNode> nodes_of(std::vector<BatchObservation>& observations);

}  // namespace narpa
