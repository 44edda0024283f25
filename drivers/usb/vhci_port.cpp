#include "drivers/usb/vhci_port.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <sys/time.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "base/time.h"
#include "drivers/descriptor.h"
#include "drivers/usb/usbip_server.h"
#include "protocols/big_endian.h"
#include "protocols/usb/usbip.h"

namespace narpa {
namespace {

const std::string kVhci = "/sys/devices/platform/vhci_hcd.0/";
constexpr unsigned kFree = 4;  // VDEV_ST_NULL of the kernel's usbip_common.h
constexpr std::int64_t kDetachTimeout_ns = 10 * kSecond_ns;

struct VhciStatus {
    bool is_super_speed = false;
    unsigned number = 0, state = 0;
};

/// The ports of "status": hub, port, state, speed, device, descriptor, place.
std::vector<VhciStatus> vhci_ports() {
    std::vector<VhciStatus> ports;
    std::ifstream file(kVhci + "status");
    std::string line;
    std::getline(file, line);  // the names of the columns
    while (std::getline(file, line)) {
        std::istringstream words(line);
        std::string hub;
        VhciStatus p;
        if (words >> hub >> p.number >> p.state) p.is_super_speed = hub == "ss", ports.push_back(p);
    }
    return ports;
}

Error cannot_attach(const std::string& what) {
    return {.what = "cannot attach a USB/IP device: " + what,
            .kind = ErrorKind::missing,
            .remedy = "sudo modprobe vhci-hcd, as root"};
}

bool send_all(int fd, std::span<const std::uint8_t> bytes) {
    return ::send(fd, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
}
bool receive_all(int fd, std::span<std::uint8_t> bytes) {
    return ::recv(fd, bytes.data(), bytes.size(), MSG_WAITALL) == static_cast<ssize_t>(bytes.size());
}

struct ImportedDevice {
    Descriptor fd;
    std::uint32_t id = 0;  // bus and number at the server
    UsbSpeed speed{};
};

Result<ImportedDevice> import_device(std::uint16_t tcp_port) {
    ImportedDevice d{Descriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0))};
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_port = htons(tcp_port);
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const timeval patience{10, 0};
    const int on = 1;
    ::setsockopt(d.fd.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    ::setsockopt(d.fd.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    if (::connect(d.fd.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0)
        return cannot_attach(std::string("its server: ") + std::strerror(errno));
    std::array<std::uint8_t, kUsbIpBusIdBytes> bus_id{};
    std::ranges::copy(UsbIpServer::kBusId, bus_id.begin());
    std::array<std::uint8_t, kUsbIpOpBytes> reply{};
    std::array<std::uint8_t, kUsbIpDeviceBytes> device{};
    if (!send_all(d.fd.get(), encode_usbip_op({UsbIpOp::import_request, 0})) || !send_all(d.fd.get(), bus_id) ||
        !receive_all(d.fd.get(), reply) || get_be<std::uint32_t>(&reply[4]) != 0 ||
        !receive_all(d.fd.get(), device))
        return cannot_attach("the server refuses it: another host may have it");
    // After path (256 bytes) and bus id (32): bus, device, speed.
    d.id = get_be<std::uint32_t>(&device[288]) << 16 | get_be<std::uint32_t>(&device[292]);
    d.speed = static_cast<UsbSpeed>(get_be<std::uint32_t>(&device[296]));
    const timeval none{};
    ::setsockopt(d.fd.get(), SOL_SOCKET, SO_RCVTIMEO, &none, sizeof none);  // from here on it is the kernel's
    return d;
}

bool write_line(const std::string& path, const std::string& text) {
    std::ofstream file(path);
    file << text << std::flush;
    return file.good();
}

}  // namespace

Result<std::unique_ptr<VhciPort>> VhciPort::attach(std::uint16_t tcp_port) {
    const auto ports = vhci_ports();
    if (ports.empty()) return cannot_attach("the kernel has no vhci_hcd");
    auto device = import_device(tcp_port);
    if (!device) return device.error();
    for (const VhciStatus& p : ports) {
        if (p.state != kFree || p.is_super_speed != (device->speed == UsbSpeed::super)) continue;
        std::ostringstream text;
        text << p.number << ' ' << device->fd.get() << ' ' << device->id << ' '
             << static_cast<unsigned>(device->speed);
        if (!write_line(kVhci + "attach", text.str()))
            return cannot_attach(std::string("vhci_hcd does not take it: ") + std::strerror(errno));
        return std::unique_ptr<VhciPort>(new VhciPort(p.number));
    }
    return cannot_attach("no port of vhci_hcd is free");
}

VhciPort::~VhciPort() {
    if (!write_line(kVhci + "detach", std::to_string(number_))) return;
    const auto is_free = [&] {
        for (const VhciStatus& p : vhci_ports())
            if (p.number == number_) return p.state == kFree;
        return true;
    };
    for (const std::int64_t until_ns = monotonic_ns() + kDetachTimeout_ns; !is_free() && monotonic_ns() < until_ns;)
        wait_ready({}, 10'000'000);
}

}  // namespace narpa
