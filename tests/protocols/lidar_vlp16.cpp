#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "protocols/lidar/velodyne.h"
#include "protocols/little_endian.h"

namespace narpa {
namespace {

constexpr int kShots = 384, kShotsPerBlock = 32, kBlocks = 12;
constexpr std::int64_t kPacketPeriodNs = 1'327'104;
using Bytes = std::array<std::uint8_t, 1206>;
using Shots = std::array<LidarShot, kShots>;
using Points = std::array<LidarPoint, kShots>;
constexpr double kDeg = std::numbers::pi / 180;
constexpr std::int64_t kEpoch = 1'767'225'600'000'000'000;  // 2026-01-01T00:00:00Z

struct Returns {
    std::array<double, kShots> range_m{};
    std::array<float, kShots> reflectivity{};
};

const LidarModel& unit() {
    static const auto model = vlp16().configure_default();
    return *model;
}

Bytes encoded(std::int64_t packet, double hz, const Returns& r, std::int64_t epoch = kEpoch) {
    Bytes bytes;
    bytes.fill(0xAA);  // whatever stood there before must be overwritten
    std::vector<LidarEchoes> echoes(kShots);
    for (int i = 0; i < kShots; ++i) echoes[i].strongest = {r.range_m[i], r.reflectivity[i]};
    vlp16().configure({.rate_hz = hz})->encode(packet, epoch, echoes, bytes);
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

Shots shots_of(std::int64_t packet, double hz) {
    Shots out;
    vlp16().configure({.rate_hz = hz})->shots(packet, out);
    return out;
}

/// The reader's points by their shot; shots without a return have range 0.
Points points_by_shot(std::span<const std::uint8_t> bytes) {
    Points found, out{};
    const std::size_t n = unit().points(bytes, found);
    for (std::size_t k = 0; k < n; ++k) out[static_cast<std::size_t>(found[k].shot)] = found[k];
    return out;
}

bool is_data_packet(std::span<const std::uint8_t> bytes) {
    return unit().packet_time(bytes, kEpoch).has_value();
}

double azimuth_of(const Vec3& direction) {
    return std::atan2(direction.x, direction.y);
}

double turn_difference(double a_rad, double b_rad) {
    return std::remainder(a_rad - b_rad, 2 * std::numbers::pi);
}

// VLP-16 User Manual 63-9243 Rev. D: 754 packets a second (8.2.1), 55.296 us a sequence (9.4).
TEST(Vlp16, TimingIsTheManuals) {
    const Shots shot = shots_of(0, 10);
    EXPECT_EQ(shot[0].t_offset_ns, 0);
    EXPECT_EQ(shot[15].t_offset_ns, 34'560);
    EXPECT_EQ(shot[16].t_offset_ns, 55'296);
    EXPECT_EQ(shot[32].t_offset_ns, 110'592);
    EXPECT_EQ(shot[383].t_offset_ns, 23 * 55'296 + 15 * 2'304);
    EXPECT_EQ(unit().spec().packet_period_ns, kPacketPeriodNs);
    EXPECT_EQ(unit().packet_start_ns(1000), 1'327'104'000);
    EXPECT_EQ(unit().first_packet_from(1'327'104'000), 1000);
    EXPECT_EQ(unit().first_packet_from(1'327'104'001), 1001);
}

// Offsets of figure 9-2 and tables 9-1, 9-2 of the manual, whose counts include 42 bytes of Ethernet, IP and UDP
// header: factory bytes at 0x04DE, 0x04DF, so 1204 and 1205 here.
TEST(Vlp16, PacketHasTheManualsBytes) {
    ASSERT_EQ(unit().spec().data_packet_bytes + 42, 1248U);
    Returns r;
    r.range_m[0] = 2.0;      // 1000 units
    r.range_m[33] = 131.07;  // block 1, second return: 65535 units
    r.reflectivity[0] = 0.5F;
    r.reflectivity[33] = 1.0F;
    // Packet 753 starts at 0.999309312 s; with 5 turns a second its azimuth there is 358.7567616 deg.
    const Bytes b = encoded(753, 5.0, r);
    const std::array<std::uint8_t, 7> head{0xFF, 0xEE, 0x24, 0x8C, 0xE8, 0x03, 50};  // 35876 = 0x8C24
    EXPECT_TRUE(std::equal(head.begin(), head.end(), b.begin()));
    const std::array<std::uint8_t, 10> block1{0xFF, 0xEE, 0x38, 0x8C, 0,
                                              0,    0xFF, 0xFF, 0xFF, 100};  // 358.9558272 deg
    EXPECT_TRUE(std::equal(block1.begin(), block1.end(), b.begin() + 100));
    const std::array<std::uint8_t, 6> tail{0x8D, 0x3F, 0x0F, 0x00, 0x37, 0x22};  // 999309 us = 0x0F3F8D
    EXPECT_TRUE(std::equal(tail.begin(), tail.end(), b.begin() + 1200));
}

TEST(Vlp16, TimeStampIsWholeMicrosecondsPastTheUtcHour) {
    const auto stamp = [](std::int64_t epoch, std::int64_t packet) {
        return get_le<std::uint32_t>(&encoded(packet, 10, {}, epoch)[1200]);
    };
    EXPECT_EQ(stamp(kEpoch, 0), 0U);
    EXPECT_EQ(stamp(kEpoch + 1'999, 0), 1U);
    EXPECT_EQ(stamp(kEpoch - 1, 0), 3'599'999'999U);
    EXPECT_EQ(stamp(kEpoch - 1'000'000, 1), 327U);  // over the hour: -1 ms + 1327.104 us
    EXPECT_EQ(stamp(-1'000, 0), 3'599'999'999U);    // before 1970
}

TEST(Vlp16, PacketTimeIsTheOneNearestToTheReference) {
    constexpr std::int64_t hour_ns = 3'600'000'000'000;
    const Bytes b = encoded(754, 10, {});  // 1'000'636'416 ns, stamped in whole microseconds
    const std::int64_t t_ns = kEpoch + 1'000'636'000;
    for (const std::int64_t off_ns : {0L, 1'000'000'000L, -1'000'000'000L, hour_ns / 2 - 1, -hour_ns / 2 + 1})
        EXPECT_EQ(unit().packet_time(b, t_ns + off_ns), t_ns) << off_ns;
    EXPECT_EQ(unit().packet_time(b, t_ns + hour_ns), t_ns + hour_ns);
    EXPECT_EQ(unit().packet_time(b, t_ns - 5 * hour_ns), t_ns - 5 * hour_ns);
}

TEST(Vlp16, DirectionIsClockwiseFromForward) {
    for (const LidarShot& s : shots_of(12345, 9.37)) {
        const double a = s.azimuth_rad, e = s.elevation_rad;
        EXPECT_LT(norm(s.direction - Vec3{std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e)}),
                  1e-15);
    }
    EXPECT_LT(norm(shots_of(0, 10)[0].direction - Vec3{0, std::cos(15 * kDeg), -std::sin(15 * kDeg)}), 1e-15);
}

TEST(Vlp16, EachShotFiresAtItsOwnTimeAndAzimuth) {
    for (const double hz : {5.0, 10.0, 20.0, 9.37}) {
        for (const std::int64_t packet : {0L, 1L, 75L, 754L, 100'000'000L}) {
            const Shots shot = shots_of(packet, hz);
            for (int i = 0; i < kShots; ++i) {
                const std::int64_t offset_ns = i / 16 * 55'296 + i % 16 * 2'304;
                EXPECT_EQ(shot[i].t_offset_ns, offset_ns);
                EXPECT_EQ(shot[i].beam, i % 16);
                EXPECT_EQ(shot[i].block, i / 32);
                EXPECT_GE(shot[i].azimuth_rad, 0);
                EXPECT_LT(shot[i].azimuth_rad, 2 * std::numbers::pi);
                const long double t_s = 1e-9L * (packet * kPacketPeriodNs + offset_ns);
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
    const Shots shot = shots_of(0, 10);
    for (int i = 0; i < 16; ++i) {
        EXPECT_EQ(shot[i].origin_m.x, 0);
        EXPECT_EQ(shot[i].origin_m.y, 0);
        EXPECT_NEAR(shot[i].origin_m.z + 0.0419 * std::tan(shot[i].elevation_rad), 0, 1.1e-4) << i;
    }
}

TEST(Vlp16, NoReturnWhereThereIsNoneOrItIsTooFarWhateverTheReflectivity) {
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
    const Bytes bytes = encoded(0, 10, r);
    for (int i = 0; i < kShots; ++i) {
        const std::uint8_t* at = &bytes[static_cast<std::size_t>(100 * (i / 32) + 4 + 3 * (i % 32))];
        EXPECT_EQ(get_le<std::uint16_t>(at), i == 7 ? 1 : 0) << i;
        EXPECT_EQ(at[2], i == 7 ? 50 : 255) << i;
    }
    Points found;
    EXPECT_EQ(unit().points(bytes, found), 1U);
}

/// 154 codes for three decades, from 101 on.
TEST(Vlp16, ReflectivityIsPercentAndAboveThatOfARetroreflector) {
    Returns r;
    r.range_m.fill(1);
    const std::array<float, 11> in{-1, 0, 0.004F, 0.006F, 1, 1.0001F, 7, 31.7F, 999, 1000, 1e6F};
    const std::array<int, 11> code{0, 0, 0, 1, 100, 101, 144, 178, 254, 255, 255};
    std::ranges::copy(in, r.reflectivity.begin());
    r.reflectivity[11] = std::numeric_limits<float>::quiet_NaN();
    const Points point = points_by_shot(encoded(0, 10, r));
    for (int i = 0; i < 11; ++i) EXPECT_EQ(point[i].intensity, code[i]) << in[i];
    EXPECT_EQ(point[11].intensity, 0);
}

TEST(Vlp16, DecodedPointsLieOnTheirShots) {
    std::mt19937_64 random(20260101);
    std::uniform_real_distribution<double> rate(vlp16().rate_hz_min, vlp16().rate_hz_max);
    for (int trial = 0; trial < 200; ++trial) {
        const double hz = rate(random);
        const auto p = static_cast<std::int64_t>(random() % 1'000'000);
        const Returns r = random_returns(random);
        const Shots shot = shots_of(p, hz);
        Points point;
        const std::size_t n = unit().points(encoded(p, hz, r), point);
        EXPECT_EQ(n, static_cast<std::size_t>(std::ranges::count_if(r.range_m, [](double x) { return x > 0; })));
        int last = -1;
        for (std::size_t k = 0; k < n; ++k) {
            const LidarPoint& found = point[k];
            const LidarShot& fired = shot[found.shot];
            EXPECT_GT(found.shot, last);
            last = found.shot;
            EXPECT_EQ(found.beam, fired.beam);
            EXPECT_EQ(found.origin_m, fired.origin_m);
            EXPECT_EQ(found.t_offset_ns, fired.t_offset_ns);
            EXPECT_NEAR(found.range_m, r.range_m[found.shot], 0.001 + 1e-12);
            EXPECT_NEAR(found.intensity, 100 * r.reflectivity[found.shot], 0.5 + 1e-4);
            EXPECT_EQ(found.direction.z, fired.direction.z);
            // Two block azimuths rounded to 0.005 deg each, interpolated; extrapolated in the last block.
            const double tolerance = (found.shot < kShots - kShotsPerBlock ? 0.005 : 0.015) * kDeg + 1e-9;
            EXPECT_NEAR(turn_difference(azimuth_of(found.direction), fired.azimuth_rad), 0, tolerance)
                << hz << " " << p;
            const Vec3 truth = fired.origin_m + r.range_m[found.shot] * fired.direction;
            EXPECT_LT(norm(found.position_m() - truth), 0.001 + tolerance * r.range_m[found.shot] + 1e-9);
        }
    }
}

TEST(Vlp16, DecodeRefusesWhatTheManualForbids) {
    const Bytes good = encoded(5, 10, {});
    ASSERT_TRUE(is_data_packet(good));
    EXPECT_FALSE(is_data_packet({}));
    EXPECT_FALSE(is_data_packet(std::span(good).first(1205)));
    std::vector<std::uint8_t> longer(good.begin(), good.end());
    longer.push_back(0);
    EXPECT_FALSE(is_data_packet(longer));
    const auto with = [&](std::size_t at, std::uint8_t value) {
        Bytes bad = good;
        bad[at] = value;
        Points none;
        EXPECT_EQ(unit().points(bad, none), 0U);
        return is_data_packet(bad);
    };
    EXPECT_FALSE(with(0, 0xFE));     // flag of the first block
    EXPECT_FALSE(with(1101, 0xDD));  // flag of the last block
    EXPECT_FALSE(with(3, 0x8D));     // azimuth of 361 deg
    EXPECT_FALSE(with(1204, 0x39));  // dual returns, from a unit that has single ones
    EXPECT_FALSE(with(1204, 0x36));
    EXPECT_FALSE(with(1205, 0x21));  // HDL-32E
    EXPECT_TRUE(with(1204, 0x38));   // last return: the same layout
}

TEST(Vlp16, DecodeTakesAnyBytes) {
    std::mt19937_64 random(7);
    Points point;
    int accepted = 0;
    for (int trial = 0; trial < 2000; ++trial) {
        Bytes bytes = encoded(trial, 10, {});
        for (int i = 0; i < 400; ++i) bytes[random() % 1200] = static_cast<std::uint8_t>(random());
        for (int block = 0; block < kBlocks; ++block) bytes[100 * block] = 0xFF, bytes[100 * block + 1] = 0xEE;
        const std::size_t n = unit().points(bytes, point);
        if (!is_data_packet(bytes)) {
            EXPECT_EQ(n, 0U);
            continue;
        }
        ++accepted;
        for (std::size_t k = 0; k < n; ++k) {
            EXPECT_TRUE(is_finite(point[k].position_m()));
            EXPECT_NEAR(norm(point[k].direction), 1, 1e-14);
        }
    }
    EXPECT_GT(accepted, 10);
}

}  // namespace
}  // namespace narpa
