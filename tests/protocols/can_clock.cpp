// The clock report there and back, and CANopen's TIME.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "protocols/can/messages.h"

namespace narpa {
namespace {

TEST(CanClock, ComesBackAsItWasSent) {
    std::mt19937_64 random(5);
    for (int i = 0; i < 1000; ++i) {
        const ClockReport sent{.zero_utc_s = static_cast<std::uint32_t>(random()),
                               .zero_utc_fraction_s = 1e-9 * static_cast<double>(random() % 1'000'000'000),
                               .state = random() % 2 == 0 ? UtcState::synchronised : UtcState::not_synchronised,
                               .leap_second_today = random() % 2 == 0,
                               .steps = static_cast<std::uint8_t>(random()),
                               .tai_less_utc_s = static_cast<std::int16_t>(random() % 100 - 50),
                               .error_s = 1e-6 * static_cast<double>(random() % 8'000'000),
                               .frequency_ppm = 1e-3 * (static_cast<double>(random() % 1'000'001) - 500'000),
                               .counter = static_cast<std::uint8_t>(random())};
        for (const bool fd : {false, true}) {
            MessageDecoder<ClockReport> decoder;
            ClockReport got;
            DecodeStatus status = DecodeStatus::not_mine;
            for (const CanFrame& frame : encode(sent, fd)) status = decoder.accept(frame, 0, got);
            ASSERT_EQ(status, DecodeStatus::complete);
            EXPECT_NEAR(got.zero_utc_fraction_s, sent.zero_utc_fraction_s, 1e-12);
            EXPECT_NEAR(got.error_s, sent.error_s, 1e-12);
            EXPECT_NEAR(got.frequency_ppm, sent.frequency_ppm, 1e-9);
            got.zero_utc_fraction_s = sent.zero_utc_fraction_s, got.error_s = sent.error_s;
            got.frequency_ppm = sent.frequency_ppm;
            EXPECT_EQ(got, sent);
        }
    }
}

TEST(CanClock, AnErrorThatIsNotKnownIsNotAvailable) {
    MessageDecoder<ClockReport> decoder;
    ClockReport got;
    DecodeStatus status = DecodeStatus::not_mine;
    for (const CanFrame& frame : encode(ClockReport{.error_s = std::nan("")}, false))
        status = decoder.accept(frame, 0, got);
    EXPECT_EQ(status, DecodeStatus::complete);
    EXPECT_TRUE(std::isnan(got.error_s));
}

// CiA 301, TIME_OF_DAY: 2026-11-28T13:14:15.678Z is 47,655,678 ms after midnight, 15,672 days after 1984-01-01.
TEST(CanClock, TimeCountsMillisecondsOfTheDayAndDaysSince1984) {
    const CanFrame frame = canopen_time(0x100, 1'795'871'655'678'999'999);
    EXPECT_EQ(frame.id, 0x100u);
    ASSERT_EQ(frame.size, 6);
    const std::uint32_t ms = frame.data[0] | frame.data[1] << 8 | frame.data[2] << 16 | frame.data[3] << 24;
    EXPECT_EQ(ms, 47'655'678u);
    EXPECT_EQ(frame.data[4] | frame.data[5] << 8, 15'672);
}

}  // namespace
}  // namespace narpa
