/// protocols/can/crc.h - the two checksums of the wire.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace narpa {

/// For each byte: its remainder after division by the polynomial.
template <class Word>
[[nodiscard]] constexpr std::array<Word, 256> crc_table(Word polynomial) {
    constexpr int kBits = 8 * sizeof(Word);
    std::array<Word, 256> table{};
    for (unsigned i = 0; i < 256; ++i) {
        Word r = static_cast<Word>(i << (kBits - 8));
        for (int bit = 0; bit < 8; ++bit)
            r = static_cast<Word>((r << 1) ^ ((r >> (kBits - 1)) & 1 ? polynomial : 0));
        table[i] = r;
    }
    return table;
}

/// CRC-8/SAE-J1850: polynomial 0x1D, start 0xFF, final xor 0xFF, not reflected; "123456789" gives 0x4B.
/// Source: SAE J1850; AUTOSAR SWS CRC Library 7.2.1.1. `crc` continues an earlier run (its return value).
[[nodiscard]] inline std::uint8_t crc8_j1850(std::span<const std::uint8_t> bytes, std::uint8_t crc = 0) noexcept {
    static constexpr auto kTable = crc_table<std::uint8_t>(0x1D);
    crc = static_cast<std::uint8_t>(~crc);
    for (const std::uint8_t b : bytes) crc = kTable[crc ^ b];
    return static_cast<std::uint8_t>(~crc);
}

/// CRC-16/IBM-3740 ("CCITT-FALSE"): polynomial 0x1021, start 0xFFFF, no final xor, not reflected; "123456789" gives
/// 0x29B1. Source: AUTOSAR SWS CRC Library 7.2.2.1. `crc` continues an earlier run.
[[nodiscard]] inline std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes,
                                                     std::uint16_t crc = 0xFFFF) noexcept {
    static constexpr auto kTable = crc_table<std::uint16_t>(0x1021);
    for (const std::uint8_t b : bytes) crc = static_cast<std::uint16_t>((crc << 8) ^ kTable[(crc >> 8) ^ b]);
    return crc;
}

}  // namespace narpa
