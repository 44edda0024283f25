#include "protocols/can/crc.h"

#include <array>

namespace narpa {
namespace {

template <class Word>
constexpr std::array<Word, 256> make_table(Word polynomial) {
    constexpr int kBits = 8 * sizeof(Word);
    std::array<Word, 256> table{};
    for (unsigned i = 0; i < 256; ++i) {
        Word r = static_cast<Word>(i << (kBits - 8));
        for (int bit = 0; bit < 8; ++bit) {
            const bool carry = (r >> (kBits - 1)) & 1;
            r = static_cast<Word>(r << 1);
            if (carry) r = static_cast<Word>(r ^ polynomial);
        }
        table[i] = r;
    }
    return table;
}

constexpr auto kTable8 = make_table<std::uint8_t>(0x1D);
constexpr auto kTable16 = make_table<std::uint16_t>(0x1021);

}  // namespace

std::uint8_t crc8_j1850(std::span<const std::uint8_t> bytes, std::uint8_t crc) noexcept {
    std::uint8_t r = static_cast<std::uint8_t>(crc ^ 0xFF);
    for (const std::uint8_t b : bytes) r = kTable8[r ^ b];
    return static_cast<std::uint8_t>(r ^ 0xFF);
}

std::uint16_t crc16_ccitt_false(std::span<const std::uint8_t> bytes, std::uint16_t crc) noexcept {
    for (const std::uint8_t b : bytes) crc = static_cast<std::uint16_t>((crc << 8) ^ kTable16[(crc >> 8) ^ b]);
    return crc;
}

}  // namespace narpa
