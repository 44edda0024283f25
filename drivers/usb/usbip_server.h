/// drivers/usb/usbip_server.h - serves one USB device in software to a Linux machine over TCP (USB/IP).
///
/// The machine needs no kernel module of narpa: after `usbip attach -r HOST -b 1-1` its own drivers see a device as
/// on a cable. One host at a time has the device; others are told that it is busy. All is bounded: kConnections,
/// kTransfers under way, a MiB each, and kTimeout_ns for a connection that has not imported the device.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "base/result.h"
#include "drivers/descriptor.h"
#include "drivers/tcp_listener.h"
#include "drivers/usb/usb_device.h"
#include "protocols/usb/usbip.h"

namespace narpa {

/// Since the start.
struct UsbIpCounters {
    std::uint64_t plugged = 0;    ///< times that a host took the device
    std::uint64_t transfers = 0;  ///< answered
    std::uint64_t unlinked = 0;   ///< cancelled by the host
    std::uint64_t refused = 0;    ///< connections closed because of invalid data
};

class UsbIpServer {
public:
    static constexpr std::size_t kConnections = 8, kTransfers = 1024;
    static constexpr std::int64_t kTimeout_ns = 5'000'000'000;
    static constexpr std::string_view kBusId = "1-1";

    /// Listens at an IPv4 address; port 0: one that is free. `device` must outlive the server, and its descriptors
    /// stay as they are. Errors: not an address; in use; not permitted; invalid descriptors.
    static Result<std::unique_ptr<UsbIpServer>> start(const std::string& address, std::uint16_t port,
                                                      UsbDevice& device);
    /// Unplugs the device.
    ~UsbIpServer();
    UsbIpServer(const UsbIpServer&) = delete;
    UsbIpServer& operator=(const UsbIpServer&) = delete;

    [[nodiscard]] std::uint16_t port() const noexcept { return port_; }
    /// Transfers that were pending may go on now. From any thread; neither waits nor allocates.
    void wake() noexcept;
    [[nodiscard]] UsbIpCounters counters() const noexcept;

private:
    class Connection;

    UsbIpServer(Descriptor listening, Descriptor signal, std::uint16_t port, UsbIpDevice identity,
                UsbDevice& device);
    void run() noexcept;
    void accept_one();
    void drop(std::size_t connection) noexcept;

    Descriptor listening_, signal_;
    std::uint16_t port_;
    UsbIpDevice identity_;
    UsbDevice& device_;
    std::vector<std::unique_ptr<Connection>> connections_;
    std::atomic<bool> ending_{false};
    std::atomic<std::uint64_t> plugged_{0}, transfers_{0}, unlinked_{0}, refused_{0};
    std::thread thread_;
};

}  // namespace narpa
