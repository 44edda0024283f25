/// emulator/realtime.h - what the kernel may grant a real-time run: locked memory, a real-time priority, processors
/// of its own; and a process that asks for no page once it runs.
#pragma once

#include <cstdint>
#include <vector>

#include "base/result.h"

namespace narpa {

/// Makes the heap keep what it has: no block is a mapping of its own, nothing goes back to the kernel. Memory that
/// was touched once (in a warm-up) is there for good. Call it before large buffers are made.
void keep_heap() noexcept;
/// Locks all memory of the process, now and later. False: not permitted (RLIMIT_MEMLOCK, CAP_IPC_LOCK).
bool lock_memory() noexcept;
/// Touches the calling thread's stack as deep as a frame may need it.
void touch_stack() noexcept;
/// Gives the calling thread SCHED_FIFO at this priority (1..99). False: not permitted (RLIMIT_RTPRIO,
/// CAP_SYS_NICE).
bool take_fifo_priority(int priority) noexcept;
/// Binds the calling thread to one processor. False: not permitted.
bool run_on_cpu(int cpu) noexcept;
/// "0,2-3" -> {0, 2, 3}; an Error where one is not a processor that this process may use.
Result<std::vector<int>> parse_cpus(const std::string& text);
/// Shows up in ps and gdb; at most 15 characters.
void name_thread(const char* name) noexcept;

/// Of the whole process since it began.
struct PageFaults {
    std::int64_t minor = 0, major = 0;
};
[[nodiscard]] PageFaults page_faults() noexcept;

}  // namespace narpa
