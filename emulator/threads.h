/// emulator/threads.h - the tracing threads: the emulator uses oneTBB only here and in loop.cpp.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <tbb/task_scheduler_observer.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "emulator/realtime.h"

namespace narpa {

struct TracingThreads {
    /// `count` threads including the caller; 0: one for each of `cpus`, or one per core. `cpus`: processors that
    /// the threads are bound to in turn; empty: not bound.
    explicit TracingThreads(int count, std::vector<int> cpus = {})
        : limit(tbb::global_control::max_allowed_parallelism,
                static_cast<std::size_t>(wanted(count, cpus) > 0 ? wanted(count, cpus)
                                                                 : tbb::info::default_concurrency())),
          arena(wanted(count, cpus) > 0 ? wanted(count, cpus) : tbb::task_arena::automatic),
          real_time(arena, std::move(cpus)) {}

    /// From now on, a thread that enters the arena is bound to its processor, and a worker gets this SCHED_FIFO
    /// priority.
    void make_real_time(int priority) {
        real_time.priority = priority;
        real_time.observe(true);
    }
    [[nodiscard]] bool refused() const noexcept { return real_time.refused; }

    /// Waits until all threads are in the arena at once, so that each has its stack, heap and priority; at most
    /// `patience`, because the kernel may not run them all. Called by the thread that will trace.
    void gather(std::chrono::seconds patience = std::chrono::seconds(1)) {
        using namespace std::chrono_literals;
        const int wanted_here = arena.max_concurrency();
        const auto until = std::chrono::steady_clock::now() + patience;
        std::atomic<int> here{0};
        arena.execute([&] {
            tbb::parallel_for(
                tbb::blocked_range<int>(0, wanted_here, 1),
                [&](const tbb::blocked_range<int>&) {
                    ++here;
                    while (here < wanted_here && std::chrono::steady_clock::now() < until)
                        std::this_thread::sleep_for(100us);
                },
                tbb::simple_partitioner());
        });
    }

    struct RealTime final : tbb::task_scheduler_observer {
        RealTime(tbb::task_arena& a, std::vector<int> processors)
            : tbb::task_scheduler_observer(a), cpus(std::move(processors)) {}
        ~RealTime() override { observe(false); }
        void on_scheduler_entry(bool is_worker) override {
            static thread_local std::uint64_t granted_by = 0;
            static thread_local int cpu = -1;
            if (!cpus.empty()) {
                const int index = tbb::this_task_arena::current_thread_index();
                const int mine = cpus[static_cast<std::size_t>(index) % cpus.size()];
                if (mine != cpu && !run_on_cpu(mine)) refused = true;
                cpu = mine;
            }
            if (granted_by == number) return;
            granted_by = number;
            touch_stack();
            if (is_worker && !take_fifo_priority(priority)) refused = true;
        }
        /// Serial number of this object, from 1, because its address may be reused.
        static inline std::atomic<std::uint64_t> made{0};
        const std::uint64_t number = ++made;
        std::vector<int> cpus;
        int priority = 1;
        std::atomic<bool> refused{false};
    };

    tbb::global_control limit;
    tbb::task_arena arena;
    RealTime real_time;

private:
    static int wanted(int count, const std::vector<int>& cpus) {
        return count > 0 ? count : static_cast<int>(cpus.size());
    }
};

}  // namespace narpa
