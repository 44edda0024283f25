/// drivers/usb/faulty_device.h - wraps a USB device and injects faults after a number of transfers, or gives it
/// invalid descriptors, to test how hosts handle them.
#pragma once

#include <cstdint>
#include <vector>

#include "drivers/usb/usb_device.h"

namespace narpa {

enum class UsbFault : std::uint8_t {
    none,
    stall,        ///< every tenth transfer towards the host stalls
    shorten,      ///< every tenth transfer towards the host ends early
    babble,       ///< every tenth transfer towards the host has too many bytes
    hang,         ///< no transfer of a bulk endpoint is ever answered again
    answers,      ///< every answer to a vendor's control request is cut to half its length
    stall_out,    ///< every tenth transfer from the host stalls, and all that follow until the host clears the halt
    shorten_out,  ///< of every tenth transfer from the host only half is taken
    descriptors,  ///< the configuration descriptor is wrong_configuration of kind `after`
};

/// Corrupts a configuration of one interface with two bulk endpoints; each `kind` from 1 to kWrongConfigurations
/// corrupts it in its own way.
inline constexpr std::uint64_t kWrongConfigurations = 10;
[[nodiscard]] std::vector<std::uint8_t> wrong_configuration(std::vector<std::uint8_t> good, std::uint64_t kind);

class FaultyDevice final : public UsbDevice {
public:
    /// `device` must outlive it. `after`: number of good bulk transfers before the fault begins; for `answers`, of
    /// vendor requests; for `descriptors`, the kind.
    FaultyDevice(UsbDevice& device, UsbFault fault, std::uint64_t after)
        : device_(device), fault_(fault), after_(after), wrong_(device.descriptors()) {
        if (fault == UsbFault::descriptors) wrong_.configuration = wrong_configuration(wrong_.configuration, after);
    }

    /// Wrong ones only while plugged in, because the server refuses to start with descriptors that it cannot
    /// decode.
    [[nodiscard]] const UsbDescriptors& descriptors() const noexcept override {
        return plugged_ ? wrong_ : device_.descriptors();
    }
    void plugged(bool in) noexcept override {
        plugged_ = in;
        halted_ = false;
        device_.plugged(in);
    }
    [[nodiscard]] int control(const UsbSetup& setup, std::span<std::uint8_t> data) noexcept override {
        if (setup.kind() == 0 && setup.request == UsbRequest::kClearFeature) halted_ = false;
        const int n = device_.control(setup, data);
        if (fault_ != UsbFault::answers || setup.kind() != 2 || !setup.to_host() || n < 0) return n;
        return ++requests_ > after_ ? n / 2 : n;
    }
    [[nodiscard]] int take(int endpoint, std::span<const std::uint8_t> data) noexcept override {
        if (hangs()) return UsbAnswer::kPending;
        const bool acts = (fault_ == UsbFault::stall_out || fault_ == UsbFault::shorten_out) &&
                          transfers_ + 1 > after_ && (transfers_ + 1) % 10 == 0;
        if (fault_ == UsbFault::stall_out && acts) ++transfers_, halted_ = true;
        if (halted_) return UsbAnswer::kStall;
        const int n = device_.take(endpoint, acts ? data.first(data.size() / 2) : data);
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
            case UsbFault::answers:
            case UsbFault::stall_out:
            case UsbFault::shorten_out:
            case UsbFault::descriptors: break;
        }
        return n;
    }

private:
    [[nodiscard]] bool hangs() const noexcept { return fault_ == UsbFault::hang && transfers_ >= after_; }

    UsbDevice& device_;
    UsbFault fault_;
    std::uint64_t after_, transfers_ = 0, requests_ = 0;
    UsbDescriptors wrong_;  ///< unchanged for other faults
    bool plugged_ = false, halted_ = false;
};

}  // namespace narpa
