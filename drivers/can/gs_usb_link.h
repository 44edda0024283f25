/// drivers/can/gs_usb_link.h - one channel of a USB-CAN adapter (gs_usb) from plug-in to unplug: bit timing, frames
/// and their echoes, bus-off. Wire: protocols/usb/gs_usb.h.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>

#include "base/spsc_ring.h"
#include "drivers/can/can_bus.h"
#include "drivers/can/usb_spec.h"
#include "drivers/descriptor.h"
#include "drivers/usb/usb_link.h"
#include "protocols/usb/gs_usb.h"

namespace narpa {

/// The USB-CAN adapters that Linux' gs_usb driver knows.
[[nodiscard]] const UsbKind& gs_usb_kind() noexcept;

/// What the loop and the thread of the adapter share.
struct GsUsbShared {
    SpscRing<ReceivedFrame, 8192> received;
    SpscRing<CanFrame, 1024> to_send;
    Descriptor arrived, wanted;  ///< eventfds: for the loop, for the thread
    std::atomic<bool> connected{false}, carries_fd{false}, ending{false};
    std::atomic<std::uint64_t> overflow{0}, malformed{0}, error_frames{0}, bus_off{0}, down{0};
    std::atomic<std::uint64_t> lost{0};  ///< taken by send(), never confirmed
};

/// Converts the adapter's time stamps, microseconds that wrap, to CLOCK_MONOTONIC. The smallest delay seen so far
/// counts as zero; it may grow by 100 ppm, for clocks that drift apart.
class GsUsbClock {
public:
    [[nodiscard]] std::int64_t to_monotonic(std::uint32_t time_us, std::int64_t t_now_ns) noexcept;

private:
    bool started_ = false;
    std::uint32_t last_us_ = 0;
    std::int64_t t_ns_ = 0, offset_ns_ = 0, seen_ns_ = 0;
};

class GsUsbLink final : UsbLink::Client {
public:
    /// Opens the adapter and starts its channel.
    static Result<std::unique_ptr<GsUsbLink>> open(const UsbCanSpec& spec, GsUsbShared& shared);
    /// Stops the channel; frames that were not confirmed count as lost.
    ~GsUsbLink();
    GsUsbLink(const GsUsbLink&) = delete;
    GsUsbLink& operator=(const GsUsbLink&) = delete;

    [[nodiscard]] const std::string& name() const noexcept { return usb_->name(); }
    [[nodiscard]] bool carries_fd() const noexcept { return fd_; }
    /// Waits for events, at most timeout_ns, and serves them. False: the adapter has gone.
    bool turn(std::int64_t timeout_ns) noexcept;

private:
    static constexpr std::size_t kIns = 32, kOuts = 10;  // Linux' driver has 30 and 10

    GsUsbLink(const UsbCanSpec& spec, GsUsbShared& shared) : spec_(spec), shared_(shared) {}

    Status start();
    Status set_up();
    Status set_bit_rates(const GsUsbLimits& limits);
    Status put(GsUsbRequest request, std::span<const std::uint8_t> data, std::uint16_t value);
    Result<std::size_t> get(GsUsbRequest request, std::span<std::uint8_t> room, std::uint16_t value);

    void received(UsbTransfer& transfer, UsbEnd end) noexcept override;
    void sent(UsbTransfer& transfer, UsbEnd end) noexcept override;
    void take_frame(std::span<const std::uint8_t> bytes) noexcept;
    bool send_next() noexcept;
    void confirm(std::uint32_t echo) noexcept;
    void give_up_old_echoes() noexcept;
    void recover() noexcept;
    void restart() noexcept;

    UsbCanSpec spec_;
    GsUsbShared& shared_;
    std::unique_ptr<UsbLink> usb_;
    /// The state of the frame in one outgoing transfer until its echo arrives.
    struct Place {
        bool unconfirmed = false;
        std::uint32_t generation = 0;  ///< +1 when an echo times out, so that a late one is recognised
        std::int64_t t_sent_ns = 0;
    };
    std::array<Place, kOuts> places_{};
    std::uint32_t wanted_features_ = 0;
    bool fd_ = false, with_time_ = false, stalled_ = false;
    int errors_in_a_row_ = 0;
    std::int64_t restart_ns_ = 0;  // 0: none is due
    GsUsbClock clock_;
};

}  // namespace narpa
