/// rehearsal/navigation/lockstep_loop.h - the node's loop where nothing depends on wall time.
#pragma once

#include "rehearsal/navigation/loop.h"

namespace narpa::rehearsal {

/// Errors: the bus falls silent, or a video source will never give a frame.
Status fly_in_lockstep(const Loop& loop);

}  // namespace narpa::rehearsal
