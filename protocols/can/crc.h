/// protocols/can/crc.h - the two checksums of the wire.
#pragma once

#include <cstdint>
#include <span>

namespace narpa {

/// CRC-8/SAE-J1850: polynomial 0x1D, start 0xFF, final xor 0xFF, not reflected; "123456789" gives 0x4B.
/// Source: SAE J1850; AUTOSAR SWS CRC Library 7.2.1.1. `crc` continues an earlier run (its return value).
[[nodiscard]] std::uint8_t crc8_j1850(std::span<const std::uint8_t> bytes, std::uint8_t crc = 0) noexcept;

/// CRC-16/IBM-3740 ("CCITT-FALSE"): polynomial 0x1021, start 0xFFFF, no final xor, not reflected; "123456789" gives
/// 0x29B1. Source: AUTOSAR SWS CRC Library 7.2.2.1. `crc` continues an earlier run.
[[nodiscard]] std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes,
                                              std::uint16_t crc = 0xFFFF) noexcept;

}  // namespace narpa
