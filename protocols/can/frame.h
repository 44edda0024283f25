/// protocols/can/frame.h - one CAN frame, classic or FD, as every bus here carries it.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace narpa {

struct CanFrame {
    std::uint32_t id = 0;          ///< 11 bits, or 29 with `extended`; no flag bits inside
    bool extended = false;         ///< 29-bit identifier
    bool remote = false;           ///< remote transmission request: no data
    bool error = false;            ///< error report of a controller, not a frame of the bus
    bool fd = false;               ///< CAN FD
    bool bit_rate_switch = false;  ///< CAN FD only
    std::uint8_t size = 0;         ///< bytes of data: 0..8 classic, 0..64 FD
    std::array<std::uint8_t, 64> data{};

    [[nodiscard]] std::span<const std::uint8_t> payload() const { return {data.data(), size}; }
};

}  // namespace narpa
