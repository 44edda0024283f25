// A CAN bus within one process: two sides that share a ring for each direction. For a program that has the emulator
// within itself and drives its clock, as the Python package does.
#include <sys/eventfd.h>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include "base/spsc_ring.h"
#include "base/time.h"
#include "drivers/can/buses.h"
#include "drivers/descriptor.h"

namespace narpa {
namespace {

/// What one side has sent and the other has not read yet.
struct MemoryQueue {
    static constexpr std::size_t kFrames = 4096;

    SpscRing<ReceivedFrame, kFrames> frames;
    Descriptor arrived{::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)};  ///< readable: there may be a frame
};

struct MemoryChannel {
    MemoryQueue to_hub, to_client;
    bool has_hub = false;
};

/// The channels that a client has opened, by name.
class MemoryChannels {
public:
    static std::shared_ptr<MemoryChannel> make(const std::string& name) {
        const std::scoped_lock lock(mutex());
        std::weak_ptr<MemoryChannel>& slot = by_name()[name];
        if (!slot.expired()) return nullptr;
        auto made = std::make_shared<MemoryChannel>();
        slot = made;
        return made;
    }
    /// Null: no client has opened it, or it has a hub already.
    static std::shared_ptr<MemoryChannel> join(const std::string& name) {
        const std::scoped_lock lock(mutex());
        const auto found = by_name().find(name);
        auto channel = found == by_name().end() ? nullptr : found->second.lock();
        if (!channel || std::exchange(channel->has_hub, true)) return nullptr;
        by_name().erase(found);
        return channel;
    }

private:
    static std::mutex& mutex() {
        static std::mutex mutex;
        return mutex;
    }
    static std::map<std::string, std::weak_ptr<MemoryChannel>>& by_name() {
        static std::map<std::string, std::weak_ptr<MemoryChannel>> channels;
        return channels;
    }
};

class MemoryBus final : public CanBus {
public:
    MemoryBus(std::shared_ptr<MemoryChannel> channel, std::string name, CanRole role)
        : channel_(std::move(channel)),
          in_(role == CanRole::hub ? channel_->to_hub : channel_->to_client),
          out_(role == CanRole::hub ? channel_->to_client : channel_->to_hub),
          name_(std::move(name)) {}

    bool receive(ReceivedFrame& out) noexcept override {
        if (!in_.frames.pop(out)) {
            eventfd_t arrived = 0;
            (void)::eventfd_read(in_.arrived.get(), &arrived);
            if (!in_.frames.pop(out)) return false;
        }
        ++counters_.received;
        return true;
    }
    bool send(const CanFrame& frame) noexcept override {
        ReceivedFrame sending{frame, monotonic_ns()};
        if (frame.fd) sending.frame.size = fd_length(frame.size);
        const bool sent = sendable(frame) && out_.frames.push(sending);
        ++(sent ? counters_.sent : counters_.send_drops);
        if (sent) (void)::eventfd_write(out_.arrived.get(), 1);
        return sent;
    }
    void wait(std::int64_t timeout_ns) noexcept override {
        std::array<pollfd, 2> fds{{{in_.arrived.get(), POLLIN, 0}, {wake_fd_, POLLIN, 0}}};
        wait_ready(fds, timeout_ns);
    }
    bool carries_fd() const noexcept override { return true; }
    std::string description() const override { return "memory: " + name_ + " (within this process)"; }

private:
    std::shared_ptr<MemoryChannel> channel_;
    MemoryQueue &in_, &out_;
    std::string name_;
};

}  // namespace

CanBusResult open_memory_bus(const std::string& name, CanRole role) {
    auto channel = role == CanRole::client ? MemoryChannels::make(name) : MemoryChannels::join(name);
    if (channel) return std::unique_ptr<CanBus>(new MemoryBus(std::move(channel), name, role));
    const char* const why = role == CanRole::client
                                ? "is open already, expected another name"
                                : "no program has opened it within this process, expected a bus between processes, "
                                  "like slcan:29537 (memory: is for programs that link the emulator)";
    return Error{"CAN bus \"memory:" + name + "\": " + why};
}

}  // namespace narpa
