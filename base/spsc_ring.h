/// base/spsc_ring.h - a lock-free ring buffer of fixed size with one producer and one consumer; neither side waits
/// or allocates.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>

namespace narpa {

template <class T, std::size_t N>
class SpscRing {
public:
    /// False: the ring is full and the value is dropped; the caller counts drops.
    bool push(const T& value) noexcept {
        const std::size_t head = head_.load(std::memory_order_relaxed);
        if (head - tail_.load(std::memory_order_acquire) == N) return false;
        slots_[head % N] = value;
        head_.store(head + 1, std::memory_order_release);
        return true;
    }
    bool pop(T& value) noexcept {
        const std::size_t tail = tail_.load(std::memory_order_relaxed);
        if (tail == head_.load(std::memory_order_acquire)) return false;
        value = slots_[tail % N];
        tail_.store(tail + 1, std::memory_order_release);
        return true;
    }

private:
    std::array<T, N> slots_{};
    std::atomic<std::size_t> head_{0}, tail_{0};
};

}  // namespace narpa
