/// drivers/usb/usb_link.h - a vendor-specific interface with bulk endpoints, claimed through libusb: control
/// requests and asynchronous transfers.
///
/// libusb allocates with every transfer and takes locks, so a link is used by one thread, which is not the loop's.
/// If the kernel has a driver for the interface, the link detaches it and reattaches it at its end.
#pragma once

#include <poll.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "drivers/usb/usb_devices.h"

namespace narpa {

class UsbLink;

/// How a transfer ended.
enum class UsbEnd : std::uint8_t {
    whole,
    partial,  ///< to the device: it has taken fewer bytes than were sent
    stalled,
    cancelled,
    gone,    ///< the device has been pulled out
    failed,  ///< babble (more bytes than requested), or a bus error
};

/// A transfer and its memory, which the link keeps until libusb has let go of it.
struct UsbTransfer {
    UsbLink* link = nullptr;
    LibusbOwned<libusb_transfer> transfer{};
    bool under_way = false;
    std::vector<std::uint8_t> bytes{};
    std::size_t moved = 0;  ///< bytes, once it has ended
};

class UsbLink {
public:
    /// Called for each transfer that has ended, on the thread that calls `serve` or destroys the link. During
    /// destruction, only UsbTransfer::link leads to the link.
    class Client {
    public:
        virtual void received(UsbTransfer& transfer, UsbEnd end) noexcept = 0;
        virtual void sent(UsbTransfer& transfer, UsbEnd end) noexcept = 0;

    protected:
        ~Client() = default;
    };
    struct Pool {
        std::size_t transfers = 0, bytes = 0;  ///< bytes of each; no transfers: the endpoint is not needed
    };

    /// Claims the interface. `wake_fd`: `serve` also wakes when it can be read.
    static Result<std::unique_ptr<UsbLink>> open(const UsbKind& kind, std::string_view wanted, Client& client,
                                                 Pool in, Pool out, int wake_fd);
    /// Cancels pending transfers, waits at most 2 s for their end, and releases the interface.
    ~UsbLink();
    UsbLink(const UsbLink&) = delete;
    UsbLink& operator=(const UsbLink&) = delete;

    [[nodiscard]] const std::string& name() const noexcept { return device_.what.name(); }
    [[nodiscard]] bool gone() const noexcept { return gone_; }
    /// Marks the device as gone: it is not used any more.
    void give_up() noexcept { gone_ = true; }

    // --- Vendor requests to the interface; they wait at most a second ---
    Status put(std::uint8_t request, std::uint16_t value, std::span<const std::uint8_t> data);
    /// Returns the number of bytes.
    Result<std::size_t> get(std::uint8_t request, std::uint16_t value, std::span<std::uint8_t> room);

    // --- Transfers ---
    [[nodiscard]] std::span<UsbTransfer> ins() noexcept { return in_; }
    [[nodiscard]] std::span<UsbTransfer> outs() noexcept { return out_; }
    /// Submit a transfer that is not under way: reads as much as it has room for, or sends its first `length`
    /// bytes. False: the device counts as gone.
    bool receive(UsbTransfer& transfer) noexcept;
    bool send(UsbTransfer& transfer, std::size_t length) noexcept;
    /// Waits for events, at most timeout_ns, and reports them to the client.
    void serve(std::int64_t timeout_ns) noexcept;
    /// Cancels all pending transfers to the device; `serve` reports their end.
    void cancel_outs() noexcept;
    /// Clear a stall of the endpoint towards the host, or of the one to the device. False: not possible.
    [[nodiscard]] bool clear_halt_in() noexcept { return clear_halt(in_endpoint_.address); }
    [[nodiscard]] bool clear_halt_out() noexcept { return clear_halt(out_endpoint_.address); }
    /// Packet size of the endpoint to the device. After a multiple of it, only an empty transfer ends the message.
    [[nodiscard]] std::size_t out_packet_bytes() const noexcept { return out_endpoint_.packet_bytes; }

private:
    struct Endpoint {
        std::uint8_t address = 0;  ///< 0: none
        std::size_t packet_bytes = 0;
    };

    UsbLink(OpenUsbDevice device, Client& client) : device_(std::move(device)), client_(client) {}
    Status start(Pool in, Pool out, int wake_fd);
    Status find_endpoints(bool wants_in, bool wants_out);
    [[nodiscard]] bool clear_halt(std::uint8_t endpoint) noexcept;
    bool submit(UsbTransfer& transfer, std::uint8_t endpoint, std::size_t length) noexcept;
    static void on_end(libusb_transfer* transfer);
    void handle_events(std::int64_t timeout_ns) noexcept;
    [[nodiscard]] bool any_under_way() const noexcept;

    OpenUsbDevice device_;
    Client& client_;
    std::vector<UsbTransfer> in_, out_;
    std::vector<pollfd> fds_;
    int interface_ = 0;
    Endpoint in_endpoint_, out_endpoint_;
    bool claimed_ = false, gone_ = false, closing_ = false;
};

}  // namespace narpa
