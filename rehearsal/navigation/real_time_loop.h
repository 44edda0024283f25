/// rehearsal/navigation/real_time_loop.h - the node's loop on the emulator's clock.
///
/// The calling thread listens to the bus and runs a cycle each period, whatever else goes on. Each source has a
/// thread that empties it; one more thread looks: when the chaser's attitude at t_k has come, at the newest frame
/// of each camera and the newest turn of each LiDAR that end by t_k.
#pragma once

#include "rehearsal/navigation/loop.h"

namespace narpa::rehearsal {

/// Errors: no heartbeat, or the emulator falls silent.
Status fly_in_real_time(const Loop& loop);

}  // namespace narpa::rehearsal
