#include "protocols/can/crc.h"

#include <gtest/gtest.h>

#include <array>

namespace narpa {
namespace {

constexpr std::array<std::uint8_t, 9> kCheck{'1', '2', '3', '4', '5', '6', '7', '8', '9'};

// Published check values: catalogue of parametrised CRC algorithms, CRC-8/SAE-J1850 and CRC-16/IBM-3740.
TEST(CanCrc, Crc8CheckValue) {
    EXPECT_EQ(crc8_j1850(kCheck), 0x4B);
}
TEST(CanCrc, Crc16CheckValue) {
    EXPECT_EQ(crc16_ccitt_false(kCheck), 0x29B1);
}

// AUTOSAR SWS CRC Library, tables of examples for CRC8 (J1850) and CRC16: 00 00 00 00 and F2 01 83.
TEST(CanCrc, AutosarExamples) {
    const std::array<std::uint8_t, 4> zeros{};
    const std::array<std::uint8_t, 3> bytes{0xF2, 0x01, 0x83};
    EXPECT_EQ(crc8_j1850(zeros), 0x59);
    EXPECT_EQ(crc8_j1850(bytes), 0x37);
    EXPECT_EQ(crc16_ccitt_false(zeros), 0x84C0);
    EXPECT_EQ(crc16_ccitt_false(bytes), 0xD374);
}

TEST(CanCrc, ContinuesWhereItStopped) {
    const std::span<const std::uint8_t> all(kCheck);
    for (std::size_t i = 0; i <= all.size(); ++i) {
        EXPECT_EQ(crc8_j1850(all.subspan(i), crc8_j1850(all.first(i))), 0x4B);
        EXPECT_EQ(crc16_ccitt_false(all.subspan(i), crc16_ccitt_false(all.first(i))), 0x29B1);
    }
}

}  // namespace
}  // namespace narpa
