/// drivers/outbox.h - a ring of preallocated slots and the thread that empties it, so that no disk, reader or
/// device holds the loop up.
///
/// One thread pushes, one thread (the outbox's own) writes. After construction neither side allocates or takes a
/// lock: the slots are handed over by two atomic counts; a POSIX semaphore counts the free slots (libstdc++ 12's
/// std::counting_semaphore can sleep for ever, GCC bug 104928) and an eventfd wakes the writer, which can then
/// watch its reader in the same poll.
#pragma once

#include <semaphore.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <thread>
#include <vector>

namespace narpa {

class Outbox;

/// What a sink does on the outbox's thread.
class OutboxWriter {
public:
    virtual ~OutboxWriter() = default;
    /// Writes one item, or counts why not. May block while `outbox.time_left_ms()` is not 0.
    virtual void write(std::span<const std::uint8_t> item, const Outbox& outbox) noexcept = 0;
    /// The item is not tried: a flush ran out of time.
    virtual void abandon(std::span<const std::uint8_t> item) noexcept = 0;
    /// Descriptor whose hang-up or error `lost` wants to hear of while there is nothing to write; -1: none.
    [[nodiscard]] virtual int watched() const noexcept { return -1; }
    virtual void lost() noexcept {}
};

class Outbox {
public:
    /// `writer` must outlive the outbox. `wait_when_full`: push waits for a slot instead of dropping.
    Outbox(OutboxWriter& writer, std::size_t slots, std::size_t slot_bytes, bool wait_when_full);
    /// Flushes.
    ~Outbox();
    Outbox(const Outbox&) = delete;
    Outbox& operator=(const Outbox&) = delete;

    /// Copies the item into the ring. False: dropped and counted, because it is larger than a slot, the ring is
    /// full, or a signal handler (installed without SA_RESTART) interrupted the wait for a slot.
    bool push(std::span<const std::uint8_t> item) noexcept;
    /// Gives the writer one second for what is still in the ring, abandons the rest. Called by the pushing thread.
    void flush() noexcept;
    [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_.load(std::memory_order_relaxed); }

    /// For the writer: how long it may still block. -1: as long as it likes, but it should ask again now and then.
    [[nodiscard]] int time_left_ms() const noexcept;

private:
    void run() noexcept;
    void wait_for_work() noexcept;

    OutboxWriter& writer_;
    const std::size_t slots_, slot_bytes_;
    const bool wait_when_full_;
    std::vector<std::uint8_t> ring_;
    std::vector<std::size_t> sizes_;
    std::uint64_t next_push_ = 0;  // touched by the pusher only
    std::atomic<std::uint64_t> pushed_{0}, dropped_{0};
    std::atomic<std::int64_t> flush_deadline_ns_{0};  // CLOCK_MONOTONIC; 0: not flushing
    std::atomic<bool> ending_{false};
    sem_t free_slots_{};
    int wake_fd_ = -1;
    std::thread thread_;
};

}  // namespace narpa
