#include "tests/support/allocation_counter.h"

#include <atomic>
#include <cerrno>
#include <cstddef>

namespace {

std::atomic<bool> g_counting{false};
std::atomic<std::uint64_t> g_calls{0};
thread_local std::uint64_t t_calls = 0;

[[maybe_unused]] void count() noexcept {
    if (!g_counting.load(std::memory_order_relaxed)) return;
    g_calls.fetch_add(1, std::memory_order_relaxed);
    ++t_calls;
}

}  // namespace

namespace narpa::test {

AllocationCounter::AllocationCounter() : thread_before_(t_calls) {
    g_calls.store(0);
    g_counting.store(true);
}
AllocationCounter::~AllocationCounter() {
    g_counting.store(false);
}
std::uint64_t AllocationCounter::on_this_thread() const {
    return t_calls - thread_before_;
}
std::uint64_t AllocationCounter::on_all_threads() const {
    return g_calls.load();
}

}  // namespace narpa::test

#if !NARPA_SANITIZED

// glibc's heap under its second names.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) {
    count();
    return __libc_malloc(size);
}
void* calloc(std::size_t n, std::size_t size) {
    count();
    return __libc_calloc(n, size);
}
void* realloc(void* block, std::size_t size) {
    count();
    return __libc_realloc(block, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
    count();
    return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
    count();
    return __libc_memalign(alignment, size);
}
int posix_memalign(void** out, std::size_t alignment, std::size_t size) {
    count();
    void* block = __libc_memalign(alignment, size);
    if (block == nullptr) return ENOMEM;
    *out = block;
    return 0;
}
}

#endif
