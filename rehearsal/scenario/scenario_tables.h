/// rehearsal/scenario/scenario_tables.h - the tables of scenario files: their keys, and the functions that read
/// them.
#pragma once

#include "rehearsal/scenario/scenario.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/scene/scene.h"

namespace narpa::rehearsal {

inline constexpr double kLongest_s = 1e6;

extern const TableKeys kOrbitKeys, kTargetKeys, kChaserKeys, kAttractorKeys, kStartKeys;
extern const TableKeys kThrustersKeys, kEngineKeys, kLandingGearKeys, kAttitudeSensorKeys;
extern const TableKeys kLegKeys, kNavigationKeys, kModelErrorKeys, kControlKeys;
extern const TableKeys kFaultKeys, kGatesKeys;

/// Reads [orbit], [target], [chaser], [attractor] and [start].
void read_bodies(TableReader& root, Scenario& s, const Scene& scene);
/// Reads [thrusters], [engine], [landing_gear] and [attitude_sensor].
void read_equipment(TableReader& root, Scenario& s);
/// Reads [[leg]], [navigation], [model_error] and [control].
void read_flight(TableReader& root, Scenario& s, const Scene& scene);
void read_faults(TableReader& root, Scenario& s);
/// Reads [gates] of a scenario that has legs.
void read_gates(TableReader& root, Scenario& s);

}  // namespace narpa::rehearsal
