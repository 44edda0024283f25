#ifdef NARPA_WITH_USB

#include "drivers/usb/usb_link.h"

#include <libusb-1.0/libusb.h>

#include <algorithm>

#include "base/time.h"
#include "drivers/descriptor.h"

namespace narpa {
namespace {

constexpr unsigned kControlPatience_ms = 1000;
constexpr std::int64_t kCloseTimeout_ns = 2 * kSecond_ns;

UsbEnd end_of(const libusb_transfer& t) noexcept {
    switch (t.status) {
        case LIBUSB_TRANSFER_COMPLETED:
            return (t.endpoint & LIBUSB_ENDPOINT_IN) != 0 || t.actual_length == t.length ? UsbEnd::whole
                                                                                         : UsbEnd::partial;
        case LIBUSB_TRANSFER_CANCELLED: return UsbEnd::cancelled;
        case LIBUSB_TRANSFER_NO_DEVICE: return UsbEnd::gone;
        case LIBUSB_TRANSFER_STALL: return UsbEnd::stalled;
        default: return UsbEnd::failed;
    }
}

Status allocate(std::vector<UsbTransfer>& transfers, UsbLink::Pool pool, UsbLink* link) {
    transfers = std::vector<UsbTransfer>(pool.transfers);
    for (UsbTransfer& t : transfers) {
        t.link = link;
        t.bytes.resize(pool.bytes);
        t.transfer.reset(libusb_alloc_transfer(0));
        if (!t.transfer) return Error{.what = "no memory", .kind = ErrorKind::failed};
    }
    return Ok{};
}

void cancel(std::vector<UsbTransfer>& transfers) noexcept {
    for (UsbTransfer& t : transfers)
        if (t.under_way) libusb_cancel_transfer(t.transfer.get());
}

}  // namespace

Result<std::unique_ptr<UsbLink>> UsbLink::open(const UsbKind& kind, std::string_view wanted, Client& client,
                                               Pool in, Pool out, int wake_fd) {
    auto device = open_usb_device(kind, wanted);
    if (!device) return device.error();
    auto link = std::unique_ptr<UsbLink>(new UsbLink(*std::move(device), client));
    if (auto started = link->start(in, out, wake_fd); !started) {
        Error e = started.error();
        e.what = std::string(kind.name) + " " + link->name() + ": " + e.what;
        return e;
    }
    return link;
}

Status UsbLink::start(Pool in, Pool out, int wake_fd) {
    if (auto found = find_endpoints(in.transfers > 0, out.transfers > 0); !found) return found.error();
    libusb_set_auto_detach_kernel_driver(device_.handle.get(), 1);
    if (const int code = libusb_claim_interface(device_.handle.get(), interface_); code != 0)
        return usb_error("cannot be claimed", code);
    claimed_ = true;
    if (auto good = allocate(in_, in, this); !good) return good.error();
    if (auto good = allocate(out_, out, this); !good) return good.error();
    const libusb_pollfd** fds = libusb_get_pollfds(device_.context.get());
    for (const libusb_pollfd** fd = fds; fds && *fd; ++fd) fds_.push_back({(*fd)->fd, (*fd)->events, 0});
    libusb_free_pollfds(fds);
    fds_.push_back({wake_fd, POLLIN, 0});
    return Ok{};
}

/// Takes the endpoints of the first interface that has the wanted ones. The descriptors of a device may be wrong.
Status UsbLink::find_endpoints(bool wants_in, bool wants_out) {
    libusb_config_descriptor* raw = nullptr;
    if (const int code = libusb_get_active_config_descriptor(libusb_get_device(device_.handle.get()), &raw);
        code != 0)
        return usb_error("has no configuration that can be read", code);
    const LibusbOwned<libusb_config_descriptor> config(raw);
    for (int i = 0; i < config->bNumInterfaces; ++i) {
        if (config->interface[i].num_altsetting < 1) continue;
        const libusb_interface_descriptor& d = config->interface[i].altsetting[0];
        if (d.bInterfaceClass != LIBUSB_CLASS_VENDOR_SPEC) continue;
        in_endpoint_ = out_endpoint_ = {};
        for (int e = 0; e < d.bNumEndpoints; ++e) {
            const libusb_endpoint_descriptor& endpoint = d.endpoint[e];
            const std::size_t packet_bytes = endpoint.wMaxPacketSize & 0x7ff;
            if ((endpoint.bmAttributes & 3) != LIBUSB_TRANSFER_TYPE_BULK || packet_bytes == 0) continue;
            const bool is_in = (endpoint.bEndpointAddress & LIBUSB_ENDPOINT_IN) != 0;
            Endpoint& mine = is_in ? in_endpoint_ : out_endpoint_;
            if (mine.address == 0) mine = {endpoint.bEndpointAddress, packet_bytes};
        }
        interface_ = d.bInterfaceNumber;
        if ((!wants_in || in_endpoint_.address != 0) && (!wants_out || out_endpoint_.address != 0)) return Ok{};
    }
    const char* wanted = wants_in && wants_out ? "a bulk endpoint each way"
                         : wants_in            ? "a bulk endpoint towards the host"
                                               : "a bulk endpoint from the host";
    return Error{.what = std::string("has no vendor-specific interface with ") + wanted,
                 .kind = ErrorKind::missing};
}

UsbLink::~UsbLink() {
    closing_ = true;
    cancel(in_), cancel(out_);
    for (const std::int64_t until_ns = monotonic_ns() + kCloseTimeout_ns;
         any_under_way() && monotonic_ns() < until_ns;)
        handle_events(10'000'000);
    if (claimed_) libusb_release_interface(device_.handle.get(), interface_);  // reattaches the kernel's driver
    if (!any_under_way()) return;
    // libusb still uses some transfers: leaks their memory, which must outlive this object.
    for (auto* transfers : {&in_, &out_})
        for (UsbTransfer& t : *transfers) (void)t.transfer.release();
    (void)device_.handle.release(), (void)device_.context.release();
    (void)new auto(std::move(in_)), (void)new auto(std::move(out_));
}

Status UsbLink::put(std::uint8_t request, std::uint16_t value, std::span<const std::uint8_t> data) {
    const int n =
        libusb_control_transfer(device_.handle.get(), 0x41, request, value, static_cast<std::uint16_t>(interface_),
                                const_cast<std::uint8_t*>(data.data()),  // it is only read
                                static_cast<std::uint16_t>(data.size()), kControlPatience_ms);
    if (n == static_cast<int>(data.size())) return Ok{};
    return usb_error("refuses request " + std::to_string(request), n < 0 ? n : LIBUSB_ERROR_IO);
}

Result<std::size_t> UsbLink::get(std::uint8_t request, std::uint16_t value, std::span<std::uint8_t> room) {
    const int n =
        libusb_control_transfer(device_.handle.get(), 0xC1, request, value, static_cast<std::uint16_t>(interface_),
                                room.data(), static_cast<std::uint16_t>(room.size()), kControlPatience_ms);
    if (n >= 0) return static_cast<std::size_t>(n);
    return usb_error("refuses request " + std::to_string(request), n);
}

bool UsbLink::receive(UsbTransfer& t) noexcept {
    return submit(t, in_endpoint_.address, t.bytes.size());
}

bool UsbLink::send(UsbTransfer& t, std::size_t length) noexcept {
    return submit(t, out_endpoint_.address, length);
}

bool UsbLink::submit(UsbTransfer& t, std::uint8_t endpoint, std::size_t length) noexcept {
    if (gone_ || closing_) return false;
    libusb_fill_bulk_transfer(t.transfer.get(), device_.handle.get(), endpoint, t.bytes.data(),
                              static_cast<int>(length), on_end, &t, 0);
    t.under_way = libusb_submit_transfer(t.transfer.get()) == 0;
    if (!t.under_way) gone_ = true;
    return t.under_way;
}

void UsbLink::on_end(libusb_transfer* transfer) {
    UsbTransfer& t = *static_cast<UsbTransfer*>(transfer->user_data);
    UsbLink& link = *t.link;
    const UsbEnd end = end_of(*transfer);
    t.under_way = false;
    t.moved = static_cast<std::size_t>(transfer->actual_length);
    if (end == UsbEnd::gone) link.gone_ = true;
    if ((transfer->endpoint & LIBUSB_ENDPOINT_IN) != 0)
        link.client_.received(t, end);
    else
        link.client_.sent(t, end);
}

void UsbLink::serve(std::int64_t timeout_ns) noexcept {
    wait_ready(fds_, timeout_ns);
    handle_events(0);
}

void UsbLink::handle_events(std::int64_t timeout_ns) noexcept {
    timeval timeout{0, static_cast<suseconds_t>(timeout_ns / 1000)};
    if (libusb_handle_events_timeout_completed(device_.context.get(), &timeout, nullptr) == LIBUSB_ERROR_NO_DEVICE)
        gone_ = true;
}

void UsbLink::cancel_outs() noexcept {
    cancel(out_);
}

bool UsbLink::clear_halt(std::uint8_t endpoint) noexcept {
    return libusb_clear_halt(device_.handle.get(), endpoint) == 0;
}

bool UsbLink::any_under_way() const noexcept {
    const auto flies = [](const UsbTransfer& t) { return t.under_way; };
    return std::ranges::any_of(in_, flies) || std::ranges::any_of(out_, flies);
}

}  // namespace narpa

#endif
