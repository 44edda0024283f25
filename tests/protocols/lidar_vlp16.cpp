#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "protocols/lidar/vlp16.h"

namespace narpa::vlp16 {
namespace {

using Bytes = std::array<std::uint8_t, kDataPacketBytes>;
constexpr double kDeg = std::numbers::pi / 180;
constexpr std::int64_t kEpoch = 1'767'225'600'000'000'000;  // 2026-01-01T00:00:00Z

struct Returns {
    std::array<double, kShots> range_m{};
    std::array<float, kShots> reflectivity{};
};

Bytes encoded(std::int64_t packet, double hz, const Returns& r, std::int64_t epoch = kEpoch) {
    Bytes bytes;
    bytes.fill(0xAA);  // whatever stood there before must be overwritten
    encode(packet, hz, epoch, r.range_m, r.reflectivity, bytes);
    return bytes;
}

Returns random_returns(std::mt19937_64& random) {
    std::uniform_real_distribution<double> range(0.002, 131.0);
    std::uniform_real_distribution<float> reflectivity(0, 1);
    Returns r;
    for (int i = 0; i < kShots; ++i) r.range_m[i] = random() % 5 == 0 ? 0.0 : range(random);
    for (float& x : r.reflectivity) x = reflectivity(random);
    return r;
}

double turn_difference(double a_rad, double b_rad) {
    return std::remainder(a_rad - b_rad, 2 * std::numbers::pi);
}

// VLP-16 User Manual 63-9243 Rev. D: 754 packets a second (8.2.1), 55.296 us a sequence (9.4).
TEST(Vlp16, TimingIsTheManuals) {
    EXPECT_EQ(kSequencePeriodNs, 55'296);
    EXPECT_EQ(kBlockPeriodNs, 110'592);
    EXPECT_EQ(kPacketPeriodNs, 1'327'104);
    EXPECT_EQ(shot_offset_ns(0), 0);
    EXPECT_EQ(shot_offset_ns(15), 34'560);
    EXPECT_EQ(shot_offset_ns(16), 55'296);
    EXPECT_EQ(shot_offset_ns(383), 23 * 55'296 + 15 * 2'304);
    EXPECT_EQ(packet_start_ns(1000), 1'327'104'000);
}

// Offsets of figure 9-2 and tables 9-1, 9-2 of the manual, whose counts include 42 bytes of Ethernet, IP and UDP
// header: factory bytes at 0x04DE, 0x04DF, so 1204 and 1205 here.
TEST(Vlp16, PacketHasTheManualsBytes) {
    static_assert(kDataPacketBytes + 42 == 1248);
    Returns r;
    r.range_m[0] = 2.0;      // 1000 units
    r.range_m[33] = 131.07;  // block 1, second return: 65535 units
    r.reflectivity[0] = 0.5F;
    r.reflectivity[33] = 1.0F;
    // Packet 753 starts at 0.999309312 s; with 5 turns a second its azimuth there is 358.7567616 deg.
    const Bytes b = encoded(753, 5.0, r);
    const std::array<std::uint8_t, 7> head{0xFF, 0xEE, 0x24, 0x8C, 0xE8, 0x03, 50};  // 35876 = 0x8C24
    EXPECT_TRUE(std::equal(head.begin(), head.end(), b.begin()));
    const std::array<std::uint8_t, 10> block1{0xFF, 0xEE, 0x38, 0x8C, 0, 0, 0, 0xFF, 0xFF, 100};  // 358.9558272 deg
    EXPECT_TRUE(std::equal(block1.begin(), block1.end(), b.begin() + 100));
    const std::array<std::uint8_t, 6> tail{0x8D, 0x3F, 0x0F, 0x00, 0x37, 0x22};  // 999309 us = 0x0F3F8D
    EXPECT_TRUE(std::equal(tail.begin(), tail.end(), b.begin() + 1200));
}

TEST(Vlp16, TimeStampIsWholeMicrosecondsPastTheUtcHour) {
    const auto stamp = [](std::int64_t epoch, std::int64_t packet) {
        return decode(encoded(packet, 10, {}, epoch))->past_hour_us;
    };
    EXPECT_EQ(stamp(kEpoch, 0), 0U);
    EXPECT_EQ(stamp(kEpoch + 1'999, 0), 1U);
    EXPECT_EQ(stamp(kEpoch - 1, 0), 3'599'999'999U);
    EXPECT_EQ(stamp(kEpoch - 1'000'000, 1), 327U);  // over the hour: -1 ms + 1327.104 us
    EXPECT_EQ(stamp(-1'000, 0), 3'599'999'999U);    // before 1970
}

TEST(Vlp16, DirectionIsClockwiseFromForward) {
    const auto near = [](const Vec3& a, const Vec3& b) { return norm(a - b) < 1e-15; };
    EXPECT_TRUE(near(direction(0, 0), {0, 1, 0}));
    EXPECT_TRUE(near(direction(90 * kDeg, 0), {1, 0, 0}));
    EXPECT_TRUE(near(direction(0, 90 * kDeg), {0, 0, 1}));
    EXPECT_NEAR(norm(direction(1.234, -15 * kDeg)), 1, 1e-15);
}

TEST(Vlp16, EachShotFiresAtItsOwnTimeAndAzimuth) {
    for (const double hz : {5.0, 10.0, 20.0, 9.37}) {
        for (const std::int64_t packet : {0L, 1L, 75L, 754L, 100'000'000L}) {
            std::array<Shot, kShots> shot;
            shots(packet, hz, shot);
            for (int i = 0; i < kShots; ++i) {
                EXPECT_EQ(shot[i].t_offset_ns, shot_offset_ns(i));
                EXPECT_EQ(shot[i].laser, i % 16);
                EXPECT_GE(shot[i].azimuth_rad, 0);
                EXPECT_LT(shot[i].azimuth_rad, 2 * std::numbers::pi);
                const long double t_s = 1e-9L * (packet * kPacketPeriodNs + shot_offset_ns(i));
                const long double turns = t_s * static_cast<long double>(hz);
                const auto expected =
                    static_cast<double>((turns - std::floor(turns)) * 2 * std::numbers::pi_v<long double>);
                EXPECT_NEAR(turn_difference(shot[i].azimuth_rad, expected), 0, 1e-9)
                    << hz << " " << packet << " " << i;
            }
        }
    }
}

// The optical drawing (manual, appendix C): all beams cross one point in front of the axis, 42 mm from it.
TEST(Vlp16, OriginHeightsAreThoseOfBeamsThatCrossInOnePoint) {
    for (int i = 0; i < kLasers; ++i)
        EXPECT_NEAR(kOriginHeightM[i] + 0.0419 * std::tan(kElevationDeg[i] * kDeg), 0, 1.1e-4) << i;
}

TEST(Vlp16, NoReturnWhereThereIsNoneOrItIsTooFar) {
    Returns r;
    r.reflectivity.fill(0.5F);
    r.range_m.fill(0);
    r.range_m[1] = -1;
    r.range_m[2] = std::numeric_limits<double>::quiet_NaN();
    r.range_m[3] = std::numeric_limits<double>::infinity();
    r.range_m[4] = 131.0701;
    r.range_m[5] = 1e300;
    r.range_m[6] = 0.0009;  // rounds to nothing
    r.range_m[7] = 0.0011;  // rounds to 2 mm
    const auto packet = decode(encoded(0, 10, r));
    ASSERT_TRUE(packet);
    for (int i = 0; i < kShots; ++i) {
        EXPECT_EQ(packet->range_2mm[i], i == 7 ? 1 : 0) << i;
        EXPECT_EQ(packet->reflectivity[i], i == 7 ? 50 : 0) << i;
    }
}

TEST(Vlp16, ReflectivityIsPercentAndNeverARetroReflector) {
    Returns r;
    r.range_m.fill(1);
    const std::array<float, 6> in{-1, 0, 0.004F, 0.006F, 1, 7};
    const std::array<int, 6> percent{0, 0, 0, 1, 100, 100};
    std::ranges::copy(in, r.reflectivity.begin());
    r.reflectivity[6] = std::numeric_limits<float>::quiet_NaN();
    const auto packet = decode(encoded(0, 10, r));
    for (int i = 0; i < 6; ++i) EXPECT_EQ(packet->reflectivity[i], percent[i]) << in[i];
    EXPECT_EQ(packet->reflectivity[6], 0);
}

TEST(Vlp16, DecodedPointsLieOnTheirShots) {
    std::mt19937_64 random(20260101);
    std::uniform_real_distribution<double> rate(kRotationHzMin, kRotationHzMax);
    for (int trial = 0; trial < 200; ++trial) {
        const double hz = rate(random);
        const auto p = static_cast<std::int64_t>(random() % 1'000'000);
        const Returns r = random_returns(random);
        std::array<Shot, kShots> shot;
        shots(p, hz, shot);
        const auto packet = decode(encoded(p, hz, r));
        ASSERT_TRUE(packet);
        std::array<Point, kShots> point;
        const std::size_t n = points(*packet, point);
        EXPECT_EQ(n, static_cast<std::size_t>(std::ranges::count_if(r.range_m, [](double x) { return x > 0; })));
        int last = -1;
        for (std::size_t k = 0; k < n; ++k) {
            const Point& found = point[k];
            const Shot& fired = shot[found.shot];
            EXPECT_GT(found.shot, last);
            last = found.shot;
            EXPECT_EQ(found.laser, fired.laser);
            EXPECT_EQ(found.t_offset_ns, fired.t_offset_ns);
            EXPECT_NEAR(found.range_m, r.range_m[found.shot], 0.001 + 1e-12);
            EXPECT_NEAR(found.reflectivity, 100 * r.reflectivity[found.shot], 0.5 + 1e-4);
            EXPECT_EQ(found.elevation_rad, fired.elevation_rad);
            // Two block azimuths rounded to 0.005 deg each, interpolated; extrapolated in the last block.
            const double tolerance = (found.shot < kShots - kShotsPerBlock ? 0.005 : 0.015) * kDeg + 1e-9;
            EXPECT_NEAR(turn_difference(found.azimuth_rad, fired.azimuth_rad), 0, tolerance) << hz << " " << p;
            const Vec3 truth = fired.origin_m() + r.range_m[found.shot] * direction(fired);
            EXPECT_LT(norm(found.position_m - truth), 0.001 + tolerance * r.range_m[found.shot] + 1e-9);
        }
    }
}

TEST(Vlp16, DecodeRefusesWhatTheManualForbids) {
    const Bytes good = encoded(5, 10, {});
    ASSERT_TRUE(decode(good));
    EXPECT_FALSE(decode({}));
    EXPECT_FALSE(decode(std::span(good).first(1205)));
    std::vector<std::uint8_t> longer(good.begin(), good.end());
    longer.push_back(0);
    EXPECT_FALSE(decode(longer));
    const auto with = [&](std::size_t at, std::uint8_t value) {
        Bytes bad = good;
        bad[at] = value;
        return decode(bad).has_value();
    };
    EXPECT_FALSE(with(0, 0xFE));     // flag of the first block
    EXPECT_FALSE(with(1101, 0xDD));  // flag of the last block
    EXPECT_FALSE(with(3, 0x8D));     // azimuth of 361 deg
    EXPECT_FALSE(with(1203, 0xFF));  // time stamp beyond the hour
    EXPECT_FALSE(with(1204, 0x39));  // dual return
    EXPECT_FALSE(with(1205, 0x21));  // HDL-32E
    EXPECT_TRUE(with(1204, 0x38));   // last return: the same layout
}

TEST(Vlp16, DecodeTakesAnyBytes) {
    std::mt19937_64 random(7);
    std::array<Point, kShots> point;
    int accepted = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        Bytes bytes = encoded(trial, 10, {});
        for (int i = 0; i < 400; ++i) bytes[random() % 1200] = static_cast<std::uint8_t>(random());
        for (int block = 0; block < kBlocks; ++block) bytes[100 * block] = 0xFF, bytes[100 * block + 1] = 0xEE;
        const auto packet = decode(bytes);
        if (!packet) continue;
        ++accepted;
        const std::size_t n = points(*packet, point);
        for (std::size_t k = 0; k < n; ++k) {
            EXPECT_TRUE(is_finite(point[k].position_m));
            EXPECT_GE(point[k].azimuth_rad, 0);
            EXPECT_LT(point[k].azimuth_rad, 2 * std::numbers::pi);
        }
    }
    EXPECT_GT(accepted, 10);
}

}  // namespace
}  // namespace narpa::vlp16
