#include "emulator/realtime.h"

#include <fmt/format.h>
#include <malloc.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>

#include <array>
#include <charconv>
#include <climits>

namespace narpa {

namespace {

constexpr std::size_t kStackBytes = 1024 * 1024;  // twice what a tile of paths and its callers use

bool may_use(int cpu) noexcept {
    cpu_set_t allowed;
    CPU_ZERO(&allowed);
    return cpu >= 0 && cpu < CPU_SETSIZE && ::sched_getaffinity(0, sizeof allowed, &allowed) == 0 &&
           CPU_ISSET(static_cast<std::size_t>(cpu), &allowed);
}

}  // namespace

void keep_heap() noexcept {
    ::mallopt(M_MMAP_MAX, 0);
    ::mallopt(M_ARENA_MAX, 1);  // no heap per thread, which would be new pages
    ::mallopt(M_TRIM_THRESHOLD, INT_MAX);
}

void touch_stack() noexcept {
    std::array<unsigned char, kStackBytes> below;
    below.fill(0);
    asm volatile("" : : "r"(below.data()) : "memory");  // keeps the compiler from removing the writes
}

bool lock_memory() noexcept {
    return ::mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

bool run_on_cpu(int cpu) noexcept {
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(static_cast<std::size_t>(cpu), &one);
    return ::pthread_setaffinity_np(::pthread_self(), sizeof one, &one) == 0;
}

Result<std::vector<int>> parse_cpus(const std::string& text) {
    std::vector<int> cpus;
    const char* at = text.data();
    const char* const end = at + text.size();
    const auto number = [&](int& value) {
        const auto [next, error] = std::from_chars(at, end, value);
        at = next;
        return error == std::errc{};
    };
    for (;;) {
        int first = 0, last = 0;
        bool good = number(first);
        last = first;
        if (good && at != end && *at == '-') good = (++at, number(last));
        if (!good || last < first || (at != end && *at != ','))
            return Error{fmt::format("--cpus {}, expected processors as 0,1 or 2-3", text)};
        for (int cpu = first; cpu <= last; ++cpu) {
            if (!may_use(cpu))
                return Error{
                    fmt::format("--cpus {}: processor {} is not there, or not for this process", text, cpu)};
            cpus.push_back(cpu);
        }
        if (at == end) return cpus;
        ++at;
    }
}

PageFaults page_faults() noexcept {
    rusage usage{};
    ::getrusage(RUSAGE_SELF, &usage);
    return {usage.ru_minflt, usage.ru_majflt};
}

void name_thread(const char* name) noexcept {
    ::pthread_setname_np(::pthread_self(), name);
}

}  // namespace narpa
