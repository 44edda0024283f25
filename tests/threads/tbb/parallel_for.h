/// tests/threads/tbb/parallel_for.h - oneTBB's parallel_for for builds with the thread sanitizer.
///
/// Debian's oneTBB is not instrumented: the sanitizer cannot see that tasks run after what their caller did before
/// parallel_for, and before what it does afterwards, and would report every result. Here these two orders are
/// declared, and no others: tasks that write what another one reads are still reported.
#pragma once
#include_next <tbb/parallel_for.h>

#include <sanitizer/tsan_interface.h>
#include <concepts>

namespace tbb {

struct CallerOrder {
    char begin = 0, end = 0;

    CallerOrder() { __tsan_release(&begin); }
    ~CallerOrder() { __tsan_acquire(&end); }
    CallerOrder(const CallerOrder&) = delete;
    CallerOrder& operator=(const CallerOrder&) = delete;
    void run(const auto& body, const auto& part) {
        __tsan_acquire(&begin);
        body(part);
        __tsan_release(&end);
    }
};

template <class Range, class... Partitioner>
void ordered_parallel_for(const Range& range, const auto& body, const Partitioner&... partitioner) {
    CallerOrder order;
    parallel_for(
        range, [&](const Range& part) { order.run(body, part); }, partitioner...);
}
template <std::integral Index>
void ordered_parallel_for(Index first, Index last, const auto& body) {
    CallerOrder order;
    parallel_for(first, last, [&](Index i) { order.run(body, i); });
}

}  // namespace tbb

#define parallel_for(...) ordered_parallel_for(__VA_ARGS__)
