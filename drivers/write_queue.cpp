#include "drivers/write_queue.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "base/time.h"
#include "drivers/background_thread.h"

namespace narpa {
namespace {

constexpr std::int64_t kFlushNs = 1'000'000'000;

}  // namespace

WriteQueue::WriteQueue(QueueWriter& writer, std::size_t slots, std::size_t slot_bytes, bool wait_when_full)
    : writer_(writer),
      slots_(slots),
      slot_bytes_(slot_bytes),
      wait_when_full_(wait_when_full),
      ring_(slots * slot_bytes),
      sizes_(slots) {
    wake_fd_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
    if (wake_fd_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
    sem_init(&free_slots_, 0, static_cast<unsigned>(slots));
    thread_ = start_without_signals([this] { run(); });  // a reader that leaves must not raise SIGPIPE
}

WriteQueue::~WriteQueue() {
    flush();
    ending_.store(true, std::memory_order_release);
    ::eventfd_write(wake_fd_, 1);
    thread_.join();
    sem_destroy(&free_slots_);
    ::close(wake_fd_);
}

bool WriteQueue::push(std::span<const std::uint8_t> head, std::span<const std::uint8_t> rest) noexcept {
    const bool fits = head.size() <= slot_bytes_ && rest.size() <= slot_bytes_ - head.size();
    if (!fits || (wait_when_full_ ? sem_wait(&free_slots_) : sem_trywait(&free_slots_)) != 0) {
        dropped_.fetch_add(1, std::memory_order_relaxed);
        return false;
    }
    const std::size_t slot = next_push_ % slots_;
    const auto at = ring_.begin() + static_cast<std::ptrdiff_t>(slot * slot_bytes_);
    std::ranges::copy(rest, std::ranges::copy(head, at).out);
    sizes_[slot] = head.size() + rest.size();
    pushed_.store(++next_push_, std::memory_order_release);
    ::eventfd_write(wake_fd_, 1);
    return true;
}

bool WriteQueue::crowded() noexcept {
    int free_slots = 0;
    ::sem_getvalue(&free_slots_, &free_slots);
    return !wait_when_full_ && static_cast<std::size_t>(free_slots) < slots_ / 2;
}

void WriteQueue::flush() noexcept {
    flush_deadline_ns_.store(monotonic_ns() + kFlushNs, std::memory_order_release);
    // The ring is empty when every slot is free.
    for (std::size_t held = 0; held < slots_;) held += sem_wait(&free_slots_) == 0 ? 1 : 0;
    for (std::size_t held = slots_; held > 0; --held) sem_post(&free_slots_);
    flush_deadline_ns_.store(0, std::memory_order_release);
}

int WriteQueue::time_left_ms() const noexcept {
    const std::int64_t deadline_ns = flush_deadline_ns_.load(std::memory_order_acquire);
    if (deadline_ns == 0) return -1;
    return static_cast<int>(std::max<std::int64_t>(0, (deadline_ns - monotonic_ns()) / 1'000'000));
}

void WriteQueue::run() noexcept {
    for (;;) {
        sync_if_due();
        if (next_write_ == pushed_.load(std::memory_order_acquire)) {
            if (ending_.load(std::memory_order_acquire)) return;
            wait_for_work();
            continue;
        }
        const std::size_t slot = next_write_++ % slots_;
        const std::span<const std::uint8_t> item{ring_.data() + slot * slot_bytes_, sizes_[slot]};
        if (time_left_ms() == 0) {
            writer_.abandon(item);
        } else {
            writer_.write(item, *this);
            if (sync_due_ns_ == 0) sync_due_ns_ = monotonic_ns() + kSync_ns;
        }
        sem_post(&free_slots_);
    }
}

void WriteQueue::sync_if_due() noexcept {
    if (sync_due_ns_ == 0 || monotonic_ns() < sync_due_ns_) return;
    writer_.sync();
    sync_due_ns_ = 0;
}

bool WriteQueue::wait(std::span<pollfd> fds, int timeout_ms) const noexcept {
    assert(!fds.empty());
    fds[0] = {wake_fd_, POLLIN, 0};
    eventfd_t count = 0;
    if (::poll(fds.data(), fds.size(), timeout_ms) > 0 && (fds[0].revents & POLLIN))
        ::eventfd_read(wake_fd_, &count);
    return next_write_ != pushed_.load(std::memory_order_acquire);
}

void WriteQueue::wait_for_work() noexcept {
    std::array<pollfd, 2> fds{{{}, {writer_.watched(), 0, 0}}};
    const std::int64_t left_ns = std::max<std::int64_t>(0, sync_due_ns_ - monotonic_ns());
    const int timeout_ms = sync_due_ns_ == 0 ? -1 : static_cast<int>(left_ns / 1'000'000) + 1;
    wait(fds, timeout_ms);
    if (fds[1].revents & (POLLERR | POLLHUP)) writer_.lost();
}

}  // namespace narpa
