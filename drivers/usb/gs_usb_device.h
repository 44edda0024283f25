/// drivers/usb/gs_usb_device.h - a USB-CAN adapter in software: what a candleLight does, with any CanBus as the bus
/// behind it.
///
/// The server's thread and one CAN thread use it. Between them are two rings, so that neither waits for the other.
/// A frame of the host is sent back (its echo) once the bus has taken it, as the firmware does.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

#include "base/spsc_ring.h"
#include "drivers/can/can_bus.h"
#include "drivers/usb/usb_device.h"
#include "protocols/usb/gs_usb.h"

namespace narpa {

/// Since the start. Each frame of the bus is in one of `to_host`, `overflow`, `missed` or still under way.
struct GsUsbDeviceCounters {
    std::uint64_t from_host = 0;  ///< frames that the bus has taken
    std::uint64_t abandoned = 0;  ///< frames of the host that were under way when it reset the channel or left
    std::uint64_t to_host = 0;    ///< frames of the bus that the host has read
    std::uint64_t overflow = 0;   ///< frames of the bus for which there was no room
    std::uint64_t missed = 0;     ///< frames of the bus while no host listened
    std::uint64_t malformed = 0;  ///< transfers of the host that are no frame
    std::uint64_t bus_off = 0;
};

class GsUsbDevice final : public UsbDevice {
public:
    static constexpr std::uint16_t kVendor = 0x1d50, kProduct = 0x606f;  ///< of candleLight; the kernel knows it
    static constexpr int kIn = 1, kOut = 2;                              ///< endpoints
    static constexpr std::size_t kToHost = 16384, kFromHost = 64;        ///< frames that the rings hold
    static constexpr std::size_t kReserve = 256;  ///< of kToHost, for echoes and reports: those are never lost

    /// `fd`: the bus behind carries CAN FD. Throws std::system_error where no descriptor is left.
    GsUsbDevice(std::string serial, bool fd);
    ~GsUsbDevice() override;

    // --- From the server's thread ---
    [[nodiscard]] const UsbDescriptors& descriptors() const noexcept override { return descriptors_; }
    void plugged(bool in) noexcept override;
    [[nodiscard]] int control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept override;
    [[nodiscard]] int take(int endpoint, std::span<const std::uint8_t> data) noexcept override;
    [[nodiscard]] int give(int endpoint, std::span<std::uint8_t> room) noexcept override;

    // --- From the CAN thread ---
    /// Serves the bus once: waits at most timeout_ns, then carries frames both ways. True: the caller is to call
    /// UsbIpServer::wake.
    bool turn(CanBus& bus, std::int64_t timeout_ns) noexcept;
    /// The controller goes bus-off after this many more frames of the host; the host has to start the channel
    /// again.
    void bus_off_after(std::uint64_t frames) noexcept { bus_off_after_ = frames; }
    /// After this many frames of the host, every second one has no echo.
    void lose_echoes_after(std::uint64_t frames) noexcept { lose_echoes_after_ = frames; }

    /// From any thread.
    [[nodiscard]] bool started() const noexcept { return started_.load(std::memory_order_acquire); }
    [[nodiscard]] GsUsbDeviceCounters counters() const noexcept;

private:
    struct Entry {
        GsUsbFrame frame{};
        std::uint32_t session = 0;
    };

    int control_out(const UsbSetup& setup, std::span<const std::uint8_t> data) noexcept;
    int control_in(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept;
    void reset() noexcept;
    bool from_bus(CanBus& bus) noexcept;
    bool to_bus(CanBus& bus) noexcept;
    bool mirror_errors(const CanBus& bus) noexcept;
    bool push(const GsUsbFrame& frame, std::size_t reserve = 0) noexcept;
    bool pop(Entry& entry) noexcept;
    void report_bus_off() noexcept;

    const bool fd_;
    UsbDescriptors descriptors_;
    GsUsbLimits limits_;
    int wake_fd_ = -1;
    /// Counts resets: entries of the rings from an earlier session are dropped when they are read.
    std::atomic<std::uint32_t> session_{0};
    std::atomic<bool> started_{false}, with_time_{false}, overflowed_{false}, is_bus_off_{false};
    SpscRing<Entry, kToHost> to_host_;
    std::atomic<std::size_t> in_to_host_{0};
    SpscRing<Entry, kFromHost> from_host_;
    std::optional<Entry> sending_;  ///< the CAN thread's: a frame that the bus has not taken yet
    std::uint64_t bus_off_after_ = UINT64_MAX, lose_echoes_after_ = UINT64_MAX, bus_off_seen_ = 0, errors_seen_ = 0;
    std::atomic<std::uint64_t> frames_from_host_{0}, abandoned_{0}, frames_to_host_{0}, overflow_{0}, missed_{0},
        malformed_{0}, bus_off_{0};
};

}  // namespace narpa
