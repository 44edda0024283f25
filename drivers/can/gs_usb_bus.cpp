// A USB-CAN adapter with candleLight firmware (gs_usb) as a bus, through libusb: no kernel driver takes part.
//
// libusb allocates for every transfer and takes locks, and opening an adapter again blocks. So libusb has a thread
// of its own; two ring buffers connect it to the loop.
#include "drivers/can/buses.h"
#include "drivers/can/usb_adapters.h"
#include "drivers/can/usb_spec.h"

#ifdef NARPA_WITH_USB

#include <sys/eventfd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <thread>

#include "drivers/background_thread.h"
#include "drivers/can/gs_usb_link.h"

namespace narpa {
namespace {

class UsbCanBus final : public CanBus {
public:
    /// `first`: an open link.
    UsbCanBus(UsbCanSpec spec, std::unique_ptr<GsUsbShared> shared, std::unique_ptr<GsUsbLink> first)
        : spec_(std::move(spec)), shared_(std::move(shared)) {
        spec_.adapter = first->name();  // the same one when it is plugged in again
        shared_->carries_fd = first->carries_fd();
        shared_->connected = true;
        link_ = std::move(first);
        thread_ = start_without_signals([this] { run(); });
    }
    ~UsbCanBus() override {
        shared_->ending.store(true, std::memory_order_release);
        ::eventfd_write(shared_->wanted.get(), 1);
        thread_.join();
    }

    [[nodiscard]] bool receive(ReceivedFrame& out) noexcept override {
        const bool any = shared_->received.pop(out);
        if (any) ++counters_.received;
        account();
        return any;
    }

    bool send(const CanFrame& frame) noexcept override {
        const bool taken = sendable(frame) && (!frame.fd || carries_fd()) &&
                           shared_->connected.load(std::memory_order_acquire) && shared_->to_send.push(frame);
        if (taken) ::eventfd_write(shared_->wanted.get(), 1);
        ++(taken ? taken_ : refused_);
        account();
        return taken;
    }

    void wait(std::int64_t timeout_ns) noexcept override {
        std::array<pollfd, 2> fds{{{shared_->arrived.get(), POLLIN, 0}, {wake_fd_, POLLIN, 0}}};
        wait_ready(fds, timeout_ns);
        eventfd_t count = 0;
        ::eventfd_read(shared_->arrived.get(), &count);
        account();
    }

    [[nodiscard]] bool carries_fd() const noexcept override {
        return shared_->carries_fd.load(std::memory_order_relaxed);
    }
    [[nodiscard]] std::string description() const override {
        std::string text = "gs_usb: adapter " + spec_.adapter + ", channel " + std::to_string(spec_.channel) +
                           ", " + std::to_string(spec_.bit_rate) + " bit/s";
        return text + (carries_fd() ? " (CAN FD, data " + std::to_string(spec_.data_bit_rate) + " bit/s)"
                                    : " (classic CAN)");
    }

private:
    static constexpr std::int64_t kPollPeriod_ns = 100'000'000;

    /// Copies the counts of the thread. `sent`: frames that the bus has taken or may still take.
    void account() noexcept {
        const GsUsbShared& s = *shared_;
        const std::uint64_t lost = s.lost.load(std::memory_order_relaxed);
        counters_.sent = taken_ - lost;
        counters_.send_drops = refused_ + lost;
        counters_.receive_overflow = s.overflow.load(std::memory_order_relaxed);
        counters_.malformed = s.malformed.load(std::memory_order_relaxed);
        counters_.error_frames = s.error_frames.load(std::memory_order_relaxed);
        counters_.bus_off = s.bus_off.load(std::memory_order_relaxed);
        counters_.interface_down = s.down.load(std::memory_order_relaxed);
    }

    // --- The thread ---

    void run() noexcept {
        RetryTimer retry;
        while (!shared_->ending.load(std::memory_order_acquire)) {
            try {
                if (link_) {
                    if (!link_->turn(kPollPeriod_ns)) lose();
                } else {
                    wait_without_adapter(retry);
                }
            } catch (const std::exception&) {  // out of memory: retried
                lose();
            }
        }
        link_.reset();
    }

    void lose() noexcept {
        shared_->connected.store(false, std::memory_order_release);
        link_.reset();
        ++shared_->down;
    }

    void wait_without_adapter(RetryTimer& retry) {
        for (CanFrame dropped; shared_->to_send.pop(dropped);) ++shared_->lost;
        std::array<pollfd, 1> fds{{{shared_->wanted.get(), POLLIN, 0}}};
        wait_ready(fds, retry.limit(kPollPeriod_ns));
        eventfd_t count = 0;
        ::eventfd_read(shared_->wanted.get(), &count);
        if (!retry.due()) return;
        auto link = GsUsbLink::open(spec_, *shared_);
        if (!link) return;
        link_ = *std::move(link);
        shared_->carries_fd = link_->carries_fd();
        shared_->connected.store(true, std::memory_order_release);
    }

    UsbCanSpec spec_;
    std::unique_ptr<GsUsbShared> shared_;
    std::unique_ptr<GsUsbLink> link_;  // used by the thread only
    std::uint64_t taken_ = 0, refused_ = 0;
    std::thread thread_;
};

}  // namespace

CanBusResult open_gs_usb(const std::string& text, CanRole /*role*/) {
    auto spec = parse_usb_can(text);
    if (!spec) return spec.error();
    auto shared = std::make_unique<GsUsbShared>();
    shared->arrived = Descriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    shared->wanted = Descriptor(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK));
    if (!shared->arrived || !shared->wanted)
        return Error{.what = std::string("usb: no descriptor is left: ") + std::strerror(errno),
                     .kind = ErrorKind::missing};
    auto link = GsUsbLink::open(*spec, *shared);
    if (!link) {
        Error e = link.error();
        e.what = "usb:" + text + ": " + e.what;
        return e;
    }
    return CanBusResult(std::make_unique<UsbCanBus>(*std::move(spec), std::move(shared), *std::move(link)));
}

Result<std::vector<PluggedUsbDevice>> find_usb_adapters() {
    return list_usb_devices(gs_usb_kind().ids);
}

}  // namespace narpa

#else

namespace narpa {

CanBusResult open_gs_usb(const std::string& text, CanRole /*role*/) {
    if (auto spec = parse_usb_can(text); !spec) return spec.error();
    return built_without_usb();
}
Result<std::vector<PluggedUsbDevice>> find_usb_adapters() {
    return built_without_usb();
}

}  // namespace narpa

#endif
