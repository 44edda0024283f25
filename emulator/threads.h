/// emulator/threads.h - the threads that trace rays: the only place where the emulator meets oneTBB.
#pragma once

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

namespace narpa {

struct TracingThreads {
    /// `count` threads in all, with the one that calls; 0: as many as the machine has.
    explicit TracingThreads(int count)
        : limit(tbb::global_control::max_allowed_parallelism,
                static_cast<std::size_t>(count > 0 ? count : tbb::info::default_concurrency())),
          arena(count > 0 ? count : tbb::task_arena::automatic) {}

    tbb::global_control limit;
    tbb::task_arena arena;
};

}  // namespace narpa
