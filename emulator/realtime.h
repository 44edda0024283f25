/// emulator/realtime.h - what the kernel may grant a real-time run: locked memory and a real-time priority.
#pragma once

namespace narpa {

/// Locks all memory of the process, now and later. False: not permitted (RLIMIT_MEMLOCK, CAP_IPC_LOCK).
bool lock_memory() noexcept;
/// Gives the calling thread SCHED_FIFO at this priority (1..99). False: not permitted (RLIMIT_RTPRIO,
/// CAP_SYS_NICE).
bool take_fifo_priority(int priority) noexcept;
/// Shows up in ps and gdb; at most 15 characters.
void name_thread(const char* name) noexcept;
/// SIGINT and SIGTERM set the flag once; a second one ends the program at once.
void stop_on_signals() noexcept;

}  // namespace narpa
