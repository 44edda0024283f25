// SocketCAN: a raw socket on one interface, which may go down, be removed and come back.
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "drivers/can/buses.h"
#include "drivers/datagram.h"
#include "drivers/descriptor.h"

namespace narpa {
namespace {

struct Interface {
    int index = 0;
    bool up = false, carries_fd = false;
    int send_queue = 0;  ///< frames; 0: there is none (virtual interfaces)
};
/// More frames than one burst: ledgers (10 classic frames each), states (6) and estimates (10) of two cameras.
constexpr int kBurst = 64;

/// The interface as it is now; index 0 with errno when there is none of that name.
Interface find_interface(int fd, const std::string& name) noexcept {
    Interface found;
    ifreq request{};
    name.copy(request.ifr_name, sizeof request.ifr_name - 1);
    if (::ioctl(fd, SIOCGIFINDEX, &request) != 0) return found;
    found.index = request.ifr_ifindex;
    if (::ioctl(fd, SIOCGIFMTU, &request) == 0) found.carries_fd = request.ifr_mtu >= static_cast<int>(CANFD_MTU);
    if (::ioctl(fd, SIOCGIFTXQLEN, &request) == 0) found.send_queue = request.ifr_qlen;
    if (::ioctl(fd, SIOCGIFFLAGS, &request) == 0) found.up = (request.ifr_flags & IFF_UP) != 0;
    return found;
}

/// A socket ready to be bound; invalid with errno where the kernel has no CAN.
Descriptor make_socket() noexcept {
    Descriptor fd(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
    if (!fd) return fd;
    const int on = 1;
    const can_err_mask_t all_errors = CAN_ERR_MASK;
    ::setsockopt(fd.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on);
    ::setsockopt(fd.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &all_errors, sizeof all_errors);
    prepare_for_bursts(fd.get());
    return fd;
}

bool bind_to(int fd, int index) noexcept {
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = index;
    return ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
}

CanFrame from_kernel(const canfd_frame& raw, bool fd) noexcept {
    CanFrame frame;
    frame.extended = (raw.can_id & CAN_EFF_FLAG) != 0;
    frame.remote = (raw.can_id & CAN_RTR_FLAG) != 0;
    frame.id = raw.can_id & (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK);
    frame.fd = fd;
    frame.bit_rate_switch = fd && (raw.flags & CANFD_BRS) != 0;
    frame.size = std::min<std::uint8_t>(raw.len, fd ? CANFD_MAX_DLEN : CAN_MAX_DLEN);
    std::copy_n(raw.data, frame.remote ? 0 : frame.size, frame.data.begin());
    return frame;
}

/// can_frame and canfd_frame begin alike: id, length, (flags), data from byte 8.
canfd_frame to_kernel(const CanFrame& frame) noexcept {
    canfd_frame raw{};
    raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0) | (frame.remote ? CAN_RTR_FLAG : 0);
    raw.len = frame.fd ? fd_length(frame.size) : frame.size;
    raw.flags = frame.fd && frame.bit_rate_switch ? CANFD_BRS : 0;
    if (!frame.remote) std::copy_n(frame.data.begin(), frame.size, raw.data);
    return raw;
}

class SocketCan final : public CanBus {
public:
    SocketCan(Descriptor fd, std::string interface, const Interface& found)
        : fd_(std::move(fd)),
          interface_(std::move(interface)),
          send_queue_(found.send_queue),
          carries_fd_(found.carries_fd) {}

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        // Bounded, so that a storm of error reports cannot keep the caller here.
        for (int i = 0; i < kFramesPerCall; ++i) {
            if (!bound_ && !bind_again()) return false;
            canfd_frame raw{};
            const Datagram d = receive_datagram(fd_.get(), {reinterpret_cast<std::uint8_t*>(&raw), sizeof raw});
            if (d.bytes < 0) {
                if (errno != EAGAIN) note_failure(errno);
                if (errno == EAGAIN || bound_) return false;
                continue;
            }
            down_ = false;
            counters_.receive_overflow += losses_.increase_to(d.lost);
            if (d.bytes != CAN_MTU && d.bytes != CANFD_MTU) {
                ++counters_.malformed;
            } else if ((raw.can_id & CAN_ERR_FLAG) != 0) {
                ++counters_.error_frames;
                if ((raw.can_id & CAN_ERR_BUSOFF) != 0) ++counters_.bus_off;
            } else {
                out = {from_kernel(raw, d.bytes == CANFD_MTU), d.t_received_ns};
                ++counters_.received;
                return true;
            }
        }
        return false;
    }

    bool send(const CanFrame& frame) noexcept override {
        const canfd_frame raw = to_kernel(frame);
        const std::size_t bytes = frame.fd ? CANFD_MTU : CAN_MTU;
        bool sent = false;
        if (sendable(frame) && (bound_ || bind_again())) {
            sent = ::send(fd_.get(), &raw, bytes, MSG_DONTWAIT) == static_cast<ssize_t>(bytes);
            if (sent)
                down_ = false;
            else if (errno == ENETDOWN || errno == ENODEV || errno == ENXIO)
                note_failure(errno);
        }
        ++(sent ? counters_.sent : counters_.send_drops);
        return sent;
    }

    void wait(std::int64_t timeout_ns) noexcept override {
        std::array<pollfd, 2> fds{{{bound_ ? fd_.get() : -1, POLLIN, 0}, {wake_fd_, POLLIN, 0}}};
        wait_ready(fds, bound_ ? timeout_ns : retry_.limit(timeout_ns));
        if (!bound_) (void)bind_again();
    }

    [[nodiscard]] bool carries_fd() const noexcept override { return carries_fd_; }
    [[nodiscard]] std::string description() const override {
        std::string out = "SocketCAN: " + interface_ + (carries_fd_ ? " (CAN FD)" : " (classic CAN)");
        if (send_queue_ > 0 && send_queue_ < kBurst)
            out += ", drops what its queue of " + std::to_string(send_queue_) +
                   " frames cannot hold; try: sudo ip link set " + interface_ + " txqueuelen 1000";
        return out;
    }

private:
    static constexpr int kFramesPerCall = 64;

    void note_failure(int reason) noexcept {
        if (!down_) ++counters_.interface_down;
        down_ = true;
        // ENETDOWN: down; the socket works again when the interface is up. ENODEV, ENXIO: removed.
        if (reason == ENODEV || reason == ENXIO) bound_ = false;
    }

    /// The interface was removed: an interface of the same name may have been made since.
    bool bind_again() noexcept {
        if (!retry_.due()) return false;
        const Interface found = find_interface(fd_.get(), interface_);
        if (found.index == 0 || !found.up) return false;
        Descriptor fresh = make_socket();
        if (!fresh || !bind_to(fresh.get(), found.index)) return false;
        fd_ = std::move(fresh);
        carries_fd_ = found.carries_fd;
        losses_ = {};
        return bound_ = true;
    }

    Descriptor fd_;
    std::string interface_;
    int send_queue_;
    bool carries_fd_, bound_ = true, down_ = false;
    LossCount losses_;
    RetryTimer retry_{};
};

Error no_interface(const std::string& name) {
    Error error{.what = name + ": no such network interface", .kind = ErrorKind::missing};
    error.remedy = name.starts_with("vcan")
                       ? "sudo ip link add dev " + name + " type vcan && sudo ip link set " + name + " mtu 72 up"
                       : "ip -br link show type can   (the CAN interfaces of this machine)";
    return error;
}

Error interface_down(const std::string& name) {
    Error error{.what = name + ": the interface is down", .kind = ErrorKind::missing};
    error.remedy = name.starts_with("vcan") ? "sudo ip link set " + name + " mtu 72 up"
                                            : "sudo ip link set " + name + " up type can bitrate 1000000";
    return error;
}

}  // namespace

CanBusResult open_socketcan(const std::string& interface, CanRole /*role*/) {
    Descriptor fd = make_socket();
    if (!fd) {
        const int reason = errno;
        return Error{.what = interface + ": this kernel has no CAN (" + std::strerror(reason) + ")",
                     .kind = ErrorKind::missing,
                     .remedy = "sudo modprobe can_raw, or a bus that needs no kernel support: slcan:29537"};
    }
    const Interface found = find_interface(fd.get(), interface);
    if (found.index == 0) return no_interface(interface);
    if (!found.up) return interface_down(interface);
    if (!bind_to(fd.get(), found.index))
        return Error{.what = interface + ": not a CAN interface (" + std::strerror(errno) + ")",
                     .kind = ErrorKind::missing,
                     .remedy = "ip -br link show type can   (the CAN interfaces of this machine)"};
    return CanBusResult(std::make_unique<SocketCan>(std::move(fd), interface, found));
}

}  // namespace narpa
