/// drivers/usb/vhci_port.h - plugs a USB device that a USB/IP server of this machine serves into this machine,
/// through the kernel's vhci_hcd: what `usbip attach` does, without its package. Needs root.
#pragma once

#include <cstdint>
#include <memory>

#include "base/result.h"

namespace narpa {

class VhciPort {
public:
    /// `tcp_port`: of the server, on the loopback. Returns once the kernel has taken the connection; the device is
    /// found a moment later. Errors: no vhci_hcd, no permission, a server that refuses, no free port.
    static Result<std::unique_ptr<VhciPort>> attach(std::uint16_t tcp_port);
    /// Pulls the device out, and waits until the kernel has let go of it.
    ~VhciPort();
    VhciPort(const VhciPort&) = delete;
    VhciPort& operator=(const VhciPort&) = delete;

private:
    explicit VhciPort(unsigned number) : number_(number) {}

    unsigned number_;
};

}  // namespace narpa
