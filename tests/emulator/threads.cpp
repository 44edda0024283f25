// The threads that trace, and the processors that they are given.
#include "emulator/threads.h"

#include <gtest/gtest.h>
#include <sched.h>

#include <chrono>
#include <mutex>
#include <optional>
#include <set>

namespace narpa::test {
namespace {

std::vector<int> own_cpus() {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    ::sched_getaffinity(0, sizeof allowed, &allowed);
    std::vector<int> cpus;
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu)
        if (CPU_ISSET(static_cast<std::size_t>(cpu), &allowed)) cpus.push_back(cpu);
    return cpus;
}

TEST(Cpus, AreReadAsListsAndRanges) {
    const int first = own_cpus().front();
    const std::string one = std::to_string(first);
    EXPECT_EQ(*parse_cpus(one), std::vector<int>{first});
    EXPECT_EQ(*parse_cpus(one + "-" + one), std::vector<int>{first});
    EXPECT_EQ(*parse_cpus(one + "," + one), (std::vector<int>{first, first}));
    for (const std::string& bad : {std::string(), std::string("x"), one + ",", one + "-", "," + one, one + "-x",
                                   one + " ", std::string("5-2")}) {
        const auto cpus = parse_cpus(bad);
        ASSERT_FALSE(cpus) << bad;
        EXPECT_NE(cpus.error().what.find("expected processors as 0,1 or 2-3"), std::string::npos) << bad;
    }
    EXPECT_NE(parse_cpus("1023").error().what.find("is not there, or not for this process"), std::string::npos);
}

/// Which threads come into an arena.
struct Visitors final : tbb::task_scheduler_observer {
    explicit Visitors(tbb::task_arena& arena) : tbb::task_scheduler_observer(arena) { observe(true); }
    ~Visitors() override { observe(false); }
    void on_scheduler_entry(bool) override {
        const std::lock_guard lock(mutex);
        threads.insert(std::this_thread::get_id());
    }
    std::mutex mutex;
    std::set<std::thread::id> threads;
};

TEST(TracingThreads, AreAllThereOnceTheyAreGathered) {
    TracingThreads threads(3);
    Visitors visitors(threads.arena);
    threads.gather(std::chrono::minutes(1));  // however busy the machine is
    EXPECT_EQ(visitors.threads.size(), 3U);
    EXPECT_TRUE(visitors.threads.contains(std::this_thread::get_id()));
}

/// Threads that served another object at the same place are set up anew.
TEST(TracingThreads, AreSetUpForEachObject) {
    bool granted = false;
    std::thread([&] { granted = take_fifo_priority(1); }).join();
    std::optional<TracingThreads> threads;
    for (const int priority : {1, 2}) {
        threads.emplace(3);
        threads->make_real_time(priority);
        threads->gather();
        EXPECT_EQ(threads->refused(), !granted);
        const std::thread::id caller = std::this_thread::get_id();
        threads->arena.execute([&] {
            tbb::parallel_for(0, 1000, [&](int) {
                sched_param now{};
                ::sched_getparam(0, &now);
                if (granted && std::this_thread::get_id() != caller) {
                    EXPECT_EQ(now.sched_priority, priority);
                }
            });
        });
    }
}

TEST(TracingThreads, EachHasAProcessorOfItsOwn) {
    const std::vector<int> cpus = own_cpus();
    std::mutex mutex;
    std::set<int> bound_to;
    std::thread caller([&] {  // is bound as well
        TracingThreads threads(0, cpus);
        threads.make_real_time(1);
        threads.gather();
        EXPECT_EQ(threads.arena.max_concurrency(), static_cast<int>(cpus.size()));
        threads.arena.execute([&] {
            tbb::parallel_for(0, 1000, [&](int) {
                cpu_set_t allowed;
                CPU_ZERO(&allowed);
                ::sched_getaffinity(0, sizeof allowed, &allowed);
                EXPECT_EQ(CPU_COUNT(&allowed), 1);
                const int index = tbb::this_task_arena::current_thread_index();
                EXPECT_TRUE(CPU_ISSET(static_cast<std::size_t>(cpus[static_cast<std::size_t>(index)]), &allowed));
                const std::lock_guard lock(mutex);
                bound_to.insert(::sched_getcpu());
            });
        });
    });
    caller.join();
    EXPECT_TRUE(std::ranges::includes(cpus, bound_to));
    EXPECT_EQ(own_cpus(), cpus);  // the caller's own thread was left alone
}

}  // namespace
}  // namespace narpa::test
