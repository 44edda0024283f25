/// apps/commands/remade.h - the frames and sweeps of a logged run, made again one after another.
#pragma once

#include <cstddef>
#include <functional>

#include "apps/commands/estimate_run.h"
#include "base/result.h"
#include "emulator/replay/replay.h"
#include "emulator/replay/sweep_replay.h"

namespace narpa::cli {

/// Makes frame i again. An Error where it is not the run's.
[[nodiscard]] Status make_again(const RunEstimate& o, Replay& run, std::size_t i);

/// Makes every `o.every`-th frame again that was sent, and calls `take` with its index in run.frames(). `pass`, if
/// any: called for the others. Ends at the first Error: a frame that is not the run's, or one of `take`.
[[nodiscard]] Status each_frame(const RunEstimate& o, Replay& run, const std::function<Status(std::size_t)>& take,
                                const std::function<void(std::size_t)>& pass = {});

/// Makes every `o.every`-th sweep again. Errors: one that is not that of a run in lockstep; a warning counts those
/// of a run in real time.
[[nodiscard]] Status each_sweep(const RunEstimate& o, SweepReplay& run,
                                const std::function<void(const ReplayedSweep&)>& take);

}  // namespace narpa::cli
