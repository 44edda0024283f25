/// drivers/usb/faulty_device.h - another USB device that, after a number of its transfers, behaves badly: to try
/// how hosts take it.
#pragma once

#include <cstdint>

#include "base/result.h"
#include "drivers/usb/usb_device.h"

namespace narpa {

enum class UsbFault : std::uint8_t {
    none,
    stall,    ///< every tenth transfer towards the host stalls
    shorten,  ///< every tenth transfer towards the host ends early
    babble,   ///< every tenth transfer towards the host has too many bytes
    hang,     ///< no transfer of a bulk endpoint is ever answered again
    answers,  ///< every answer to a vendor's control request ends in its middle
};

class FaultyDevice final : public UsbDevice {
public:
    /// `device` must outlive it. `after`: transfers of bulk endpoints that are as they should be; for `answers`,
    /// requests.
    FaultyDevice(UsbDevice& device, UsbFault fault, std::uint64_t after)
        : device_(device), fault_(fault), after_(after) {}

    [[nodiscard]] const UsbDescriptors& descriptors() const noexcept override { return device_.descriptors(); }
    void plugged(bool in) noexcept override { device_.plugged(in); }
    [[nodiscard]] int control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept override {
        const int n = device_.control(setup, data);
        if (fault_ != UsbFault::answers || setup.kind() != 2 || !setup.to_host() || n < 0) return n;
        return ++requests_ > after_ ? n / 2 : n;
    }
    [[nodiscard]] int take(int endpoint, std::span<const std::uint8_t> data) noexcept override {
        if (hangs()) return UsbAnswer::kPending;
        const int n = device_.take(endpoint, data);
        if (n >= 0) ++transfers_;
        return n;
    }
    [[nodiscard]] int give(int endpoint, std::span<std::uint8_t> room) noexcept override {
        if (hangs()) return UsbAnswer::kPending;
        const int n = device_.give(endpoint, room);
        if (n < 0) return n;
        const bool acts = ++transfers_ > after_ && transfers_ % 10 == 0;
        if (!acts) return n;
        switch (fault_) {
            case UsbFault::stall: return UsbAnswer::kStall;
            case UsbFault::shorten: return n / 2;
            case UsbFault::babble: return UsbAnswer::kBabble;
            case UsbFault::none:
            case UsbFault::hang:
            case UsbFault::answers: break;
        }
        return n;
    }

private:
    [[nodiscard]] bool hangs() const noexcept { return fault_ == UsbFault::hang && transfers_ >= after_; }

    UsbDevice& device_;
    UsbFault fault_;
    std::uint64_t after_, transfers_ = 0, requests_ = 0;
};

}  // namespace narpa
