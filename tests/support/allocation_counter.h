/// tests/support/allocation_counter.h - counts calls of the heap, to show that a loop makes none.
///
/// A test program that compiles allocation_counter.cpp has malloc, calloc, realloc, posix_memalign, aligned_alloc
/// and memalign replaced by counting ones; operator new goes through malloc. Under a sanitizer, which brings its
/// own heap, nothing is counted: `kAllocationsAreCounted` is false and such a test skips.
#pragma once

#include <cstdint>

namespace narpa::test {

inline constexpr bool kAllocationsAreCounted = !NARPA_SANITIZED;

/// Counts while it lives; one at a time. Threads that run meanwhile are counted too.
class AllocationCounter {
public:
    AllocationCounter();
    ~AllocationCounter();
    AllocationCounter(const AllocationCounter&) = delete;
    AllocationCounter& operator=(const AllocationCounter&) = delete;

    /// Calls since construction, by this thread.
    [[nodiscard]] std::uint64_t on_this_thread() const;
    /// Calls since construction, by all threads.
    [[nodiscard]] std::uint64_t on_all_threads() const;

private:
    std::uint64_t thread_before_;
};

}  // namespace narpa::test
