/// drivers/write_queue.h - a ring of preallocated slots and the thread that writes them, so that no disk, reader or
/// device blocks the loop.
///
/// One thread pushes, one thread (the queue's own) writes. After construction neither side allocates or takes a
/// lock: the slots are handed over by two atomic counts; a POSIX semaphore counts the free slots (libstdc++ 12's
/// std::counting_semaphore can miss a wake-up, GCC bug 104928), and an eventfd wakes the writer, which can poll its
/// reader's descriptor at the same time. Ring buffers of libraries do not offer that poll.
#pragma once

#include <poll.h>
#include <semaphore.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <thread>
#include <vector>

namespace narpa {

class WriteQueue;

/// The sink's part, called on the queue's thread.
class QueueWriter {
public:
    virtual ~QueueWriter() = default;
    /// Writes one item, or counts why not. May block while `queue.time_left_ms()` is not 0.
    virtual void write(std::span<const std::uint8_t> item, const WriteQueue& queue) noexcept = 0;
    /// The item is dropped unwritten: a flush ran out of time.
    virtual void abandon(std::span<const std::uint8_t> item) noexcept = 0;
    /// Hands written data to the operating system. Called within about kSync_ns of each write.
    virtual void sync() noexcept {}
    /// Descriptor that is polled for hang-up and errors while the ring is empty; `lost` is then called. -1: none.
    [[nodiscard]] virtual int watched() const noexcept { return -1; }
    virtual void lost() noexcept {}
};

class WriteQueue {
public:
    /// `writer` must outlive the queue. `wait_when_full`: push waits for a slot instead of dropping.
    WriteQueue(QueueWriter& writer, std::size_t slots, std::size_t slot_bytes, bool wait_when_full);
    /// Flushes.
    ~WriteQueue();
    WriteQueue(const WriteQueue&) = delete;
    WriteQueue& operator=(const WriteQueue&) = delete;

    /// Copies the item into the ring. False: dropped and counted, because it is larger than a slot, the ring is
    /// full, or a signal handler (installed without SA_RESTART) interrupted the wait for a slot.
    bool push(std::span<const std::uint8_t> item) noexcept { return push(item, {}); }
    /// An item in two pieces.
    bool push(std::span<const std::uint8_t> head, std::span<const std::uint8_t> rest) noexcept;
    /// Gives the writer one second for what is still in the ring, drops the rest. Called by the pushing thread.
    void flush() noexcept;
    /// Less than half of the slots are free, and a push would not wait: the caller should leave out less important
    /// items.
    [[nodiscard]] bool crowded() noexcept;
    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

    static constexpr std::int64_t kSync_ns = 1'000'000'000;

    /// For the writer: how long it may still block. -1: without limit; then it should call this repeatedly.
    [[nodiscard]] int time_left_ms() const noexcept;
    /// For the writer: waits as poll() does, also for the next item; fds[0] is the queue's. True: there is a next
    /// item.
    bool wait(std::span<pollfd> fds, int timeout_ms) const noexcept;

private:
    void run() noexcept;
    void sync_if_due() noexcept;
    void wait_for_work() noexcept;

    QueueWriter& writer_;
    const std::size_t slots_, slot_bytes_;
    const bool wait_when_full_;
    std::vector<std::uint8_t> ring_;
    std::vector<std::size_t> sizes_;
    std::uint64_t next_push_ = 0;   // touched by the pusher only
    std::uint64_t next_write_ = 0;  // touched by the queue's thread only
    std::int64_t sync_due_ns_ = 0;  // CLOCK_MONOTONIC; 0: nothing written since the last; the queue's thread only
    std::atomic<std::uint64_t> pushed_{0}, dropped_{0};
    std::atomic<std::int64_t> flush_deadline_ns_{0};  // CLOCK_MONOTONIC; 0: not flushing
    std::atomic<bool> ending_{false};
    sem_t free_slots_{};
    int wake_fd_ = -1;
    std::thread thread_;
};

}  // namespace narpa
