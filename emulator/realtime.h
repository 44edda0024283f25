/// emulator/realtime.h - what a real-time run needs from the kernel: locked memory, real-time priority, CPU
/// affinity, and no page faults once it runs.
#pragma once

#include <cstdint>
#include <vector>

#include "base/fifo_priority.h"
#include "base/result.h"

namespace narpa {

/// Makes the heap keep its memory: no block is a mapping of its own, and nothing returns to the kernel, so that
/// pages touched in the warm-up stay mapped. Call it before large buffers are allocated.
void keep_heap() noexcept;
/// Locks all memory of the process, now and later. False: not permitted (RLIMIT_MEMLOCK, CAP_IPC_LOCK).
bool lock_memory() noexcept;
/// Touches the pages of the calling thread's stack that a frame may need.
void touch_stack() noexcept;
/// Binds the calling thread to one processor. False: not permitted.
bool run_on_cpu(int cpu) noexcept;
/// "0,2-3" -> {0, 2, 3}; an Error if the process may not use one of them.
Result<std::vector<int>> parse_cpus(const std::string& text);
/// The name in ps and gdb; at most 15 characters.
void name_thread(const char* name) noexcept;

/// Page faults of the whole process since its start.
struct PageFaults {
    std::int64_t minor = 0, major = 0;
};
[[nodiscard]] PageFaults page_faults() noexcept;

}  // namespace narpa
