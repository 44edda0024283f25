#include "drivers/usb/usb_devices.h"

#include <algorithm>

#ifdef NARPA_WITH_USB

#include <libusb-1.0/libusb.h>

#include <array>

namespace narpa {
namespace {

/// A device that is plugged in, opened if permitted.
struct FoundUsbDevice {
    PluggedUsbDevice what;
    int code = 0;  // of libusb_open
    LibusbOwned<libusb_device_handle> handle;
};

Result<LibusbOwned<libusb_context>> usb_context() {
    libusb_context* context = nullptr;
    if (const int code = libusb_init(&context); code != 0) return usb_error("USB cannot be reached here", code);
    return LibusbOwned<libusb_context>(context);
}

/// Port path, as in Linux: bus number and port numbers.
std::string place_of(libusb_device* device) {
    std::array<std::uint8_t, 8> ports{};
    const int n = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
    std::string place = std::to_string(libusb_get_bus_number(device));
    for (int i = 0; i < n; ++i) place += (i == 0 ? "-" : ".") + std::to_string(ports[static_cast<std::size_t>(i)]);
    return place;
}

std::string serial_of(libusb_device_handle* handle, std::uint8_t string) {
    std::array<unsigned char, 128> text{};
    const int n = string == 0 ? 0 : libusb_get_string_descriptor_ascii(handle, string, text.data(), text.size());
    return {reinterpret_cast<const char*>(text.data()), static_cast<std::size_t>(std::max(n, 0))};
}

std::vector<FoundUsbDevice> find_devices(libusb_context* context, std::span<const UsbId> ids) {
    std::vector<FoundUsbDevice> found;
    libusb_device** devices = nullptr;
    const ssize_t n = libusb_get_device_list(context, &devices);
    for (ssize_t i = 0; i < n; ++i) {
        libusb_device_descriptor d{};
        if (libusb_get_device_descriptor(devices[i], &d) != 0) continue;
        if (std::ranges::none_of(ids,
                                 [&](UsbId id) { return id.vendor == d.idVendor && id.product == d.idProduct; }))
            continue;
        FoundUsbDevice a{{place_of(devices[i])}, 0, nullptr};
        libusb_device_handle* handle = nullptr;
        a.code = libusb_open(devices[i], &handle);
        a.handle.reset(handle);
        if (handle)
            a.what.serial = serial_of(handle, d.iSerialNumber);
        else
            a.what.trouble = libusb_strerror(static_cast<libusb_error>(a.code));
        found.push_back(std::move(a));
    }
    if (n >= 0) libusb_free_device_list(devices, 1);
    return found;
}

std::string names_of(const UsbKind& kind, const std::vector<FoundUsbDevice>& devices) {
    std::string text;
    for (const FoundUsbDevice& d : devices)
        text += (text.empty() ? "" : ", ") + std::string(kind.prefix) + d.what.name();
    return text;
}

/// The device that `wanted` names, open.
Result<FoundUsbDevice> choose(const UsbKind& kind, std::vector<FoundUsbDevice> devices, std::string_view wanted) {
    const std::string a_kind(kind.name);
    if (devices.empty())
        return Error{.what = "no " + a_kind + " is plugged in",
                     .kind = ErrorKind::missing,
                     .remedy = std::string(kind.remedy)};
    const auto meant = [&](const FoundUsbDevice& d) {
        return wanted.empty() || d.what.serial == wanted || d.what.place == wanted;
    };
    const auto count = std::ranges::count_if(devices, meant);
    if (count > 1)
        return Error{std::to_string(count) + " " + a_kind + "s are plugged in: expected one of " +
                     names_of(kind, devices)};
    const auto it = std::ranges::find_if(devices, meant);
    if (it == devices.end()) {
        const auto shut = std::ranges::find_if(devices, [](const FoundUsbDevice& d) { return !d.handle; });
        if (shut != devices.end()) return usb_error(a_kind + " " + shut->what.place, shut->code);
        return Error{.what = "no " + a_kind + " \"" + std::string(wanted) + "\" is plugged in; there is " +
                             names_of(kind, devices),
                     .kind = ErrorKind::missing};
    }
    if (!it->handle) return usb_error(a_kind + " " + it->what.place, it->code);
    return std::move(*it);
}

}  // namespace

void LibusbRelease::operator()(libusb_context* c) const noexcept {
    libusb_exit(c);
}
void LibusbRelease::operator()(libusb_device_handle* h) const noexcept {
    libusb_close(h);
}
void LibusbRelease::operator()(libusb_transfer* t) const noexcept {
    libusb_free_transfer(t);
}
void LibusbRelease::operator()(libusb_config_descriptor* c) const noexcept {
    libusb_free_config_descriptor(c);
}

Result<std::vector<PluggedUsbDevice>> list_usb_devices(std::span<const UsbId> ids) {
    auto context = usb_context();
    if (!context) return context.error();
    std::vector<PluggedUsbDevice> out;
    for (FoundUsbDevice& d : find_devices(context->get(), ids)) out.push_back(std::move(d.what));
    return out;
}

Result<OpenUsbDevice> open_usb_device(const UsbKind& kind, std::string_view wanted) {
    auto context = usb_context();
    if (!context) return context.error();
    auto chosen = choose(kind, find_devices(context->get(), kind.ids), wanted);
    if (!chosen) return chosen.error();
    return OpenUsbDevice{*std::move(context), std::move(chosen->handle), std::move(chosen->what)};
}

Error usb_error(const std::string& what, int code) {
    Error e{.what = what + ": " + libusb_strerror(static_cast<libusb_error>(code)), .kind = ErrorKind::missing};
    if (code == LIBUSB_ERROR_ACCESS) e.remedy = usb_permission_remedy();
    if (code == LIBUSB_ERROR_BUSY) e.remedy = "close the other program that uses it";
    return e;
}

}  // namespace narpa

#endif

namespace narpa {

std::string usb_permission_remedy() {
    return "sudo cp drivers/usb/udev/70-narpa-usb.rules /etc/udev/rules.d/ && sudo udevadm control --reload && "
           "sudo udevadm trigger   (from the sources or from share/narpa; then plug the device in again)";
}

bool is_usb_name(std::string_view text) noexcept {
    constexpr std::size_t kLongest = 126;  // of a string descriptor
    return text.size() <= kLongest &&
           std::ranges::all_of(text, [](char c) { return c > ' ' && c < 0x7f && c != '"'; });
}

Error built_without_usb() {
    return {.what = "this narpa was built without USB",
            .kind = ErrorKind::missing,
            .remedy = "cmake -DNARPA_WITH_USB=ON ... (needs libusb-1.0-0-dev), and build again"};
}

}  // namespace narpa
