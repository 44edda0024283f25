/// The Mid-360's packets against the maker's protocol document: field by field at literal offsets.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "protocols/crc32.h"
#include "protocols/lidar/livox.h"
#include "protocols/little_endian.h"

namespace narpa::mid360_packets {
namespace {

constexpr std::size_t kPoints = 96, kBytes = 36 + 96 * 14;
constexpr std::int64_t kEpoch = 1'767'225'600'000'000'000;  // 2026-01-01T00:00:00Z
constexpr double kDeg = std::numbers::pi / 180;
using Bytes = std::array<std::uint8_t, kBytes>;

const LidarModel& unit() {
    static const auto model = mid360().configure_default();
    return *model;
}

std::vector<LidarShot> shots_of(std::int64_t packet) {
    std::vector<LidarShot> out(kPoints);
    unit().shots(packet, out);
    return out;
}

Bytes encoded(std::int64_t packet, const std::vector<LidarEchoes>& echoes) {
    Bytes bytes;
    bytes.fill(0xAA);  // stale contents must be overwritten
    unit().encode(packet, kEpoch, echoes, bytes);
    return bytes;
}

std::int32_t int32_at(const Bytes& bytes, std::size_t at) {
    return static_cast<std::int32_t>(get_le<std::uint32_t>(&bytes[at]));
}

TEST(Mid360, HeaderHasTheFieldsOfTheProtocolDocument) {
    const std::vector<LidarEchoes> none(kPoints);
    const Bytes b = encoded(209, none);  // starts at 100.32 ms: the first packet that starts in frame 1
    EXPECT_EQ(b[0], 0) << "version";
    EXPECT_EQ(get_le<std::uint16_t>(&b[1]), 1380) << "length";
    EXPECT_EQ(get_le<std::uint16_t>(&b[3]), 4750) << "time_interval, 0.1 us";
    EXPECT_EQ(get_le<std::uint16_t>(&b[5]), 96) << "dot_num";
    EXPECT_EQ(get_le<std::uint16_t>(&b[7]), 0) << "udp_cnt";
    EXPECT_EQ(b[9], 1) << "frame_cnt";
    EXPECT_EQ(b[10], 1) << "data_type";
    EXPECT_EQ(b[11], 1) << "time_type";
    EXPECT_TRUE(std::all_of(&b[12], &b[24], [](std::uint8_t v) { return v == 0; })) << "reserved";
    EXPECT_EQ(get_le<std::uint32_t>(&b[24]), crc32(std::span(b).subspan(28)));
    EXPECT_EQ(get_le<std::uint64_t>(&b[28]), static_cast<std::uint64_t>(kEpoch + 209 * 480'000));
    EXPECT_EQ(get_le<std::uint16_t>(&encoded(208, none)[7]), 208) << "the last packet of frame 0";
    EXPECT_EQ(encoded(208, none)[9], 0);
    EXPECT_EQ(get_le<std::uint16_t>(&encoded(625, none)[7]), 0) << "starts exactly with frame 3";
    EXPECT_EQ(encoded(625, none)[9], 3);
    EXPECT_EQ(encoded(625 + 256 * 625 / 3 + 1, none)[9], 3) << "modulo 256";
}

TEST(Mid360, PointsAreMillimetresAlongTheMakersAxes) {
    std::vector<LidarEchoes> echoes(kPoints);
    const auto shots = shots_of(12'345);
    for (std::size_t i = 0; i < kPoints; i += 2) echoes[i].strongest = {1.0 + 0.5 * static_cast<double>(i), 0.5f};
    const Bytes b = encoded(12'345, echoes);
    for (std::size_t i = 0; i < kPoints; ++i) {
        const std::size_t at = 36 + 14 * i;
        const Vec3 p = echoes[i].strongest.range_m * shots[i].direction;
        EXPECT_EQ(int32_at(b, at), std::lround(1e3 * p.y)) << "x forward";
        EXPECT_EQ(int32_at(b, at + 4), std::lround(-1e3 * p.x)) << "y left";
        EXPECT_EQ(int32_at(b, at + 8), std::lround(1e3 * p.z)) << "z up";
        EXPECT_EQ(b[at + 12], i % 2 == 0 ? 75 : 0);
        EXPECT_EQ(b[at + 13], 0) << "tag";
    }
}

TEST(Mid360, ReflectivityHasTheMakersTwoScales) {
    std::vector<LidarEchoes> echoes(kPoints);
    const std::array<std::pair<float, int>, 6> codes{
        {{0.f, 0}, {0.1f, 15}, {1.f, 150}, {1.001f, 151}, {1000.f, 255}, {1e9f, 255}}};
    for (std::size_t i = 0; i < codes.size(); ++i) echoes[i].strongest = {10, codes[i].first};
    const Bytes b = encoded(0, echoes);
    for (std::size_t i = 0; i < codes.size(); ++i)
        EXPECT_EQ(b[36 + 14 * i + 12], codes[i].second) << codes[i].first;
}

TEST(Mid360, ReadersGetTheEchoesBack) {
    std::vector<LidarEchoes> echoes(kPoints);
    const auto shots = shots_of(777);
    for (std::size_t i = 0; i < kPoints; ++i) echoes[i].strongest = {0.1 + 0.7 * static_cast<double>(i), 0.3f};
    echoes[5].strongest.range_m = 0;
    echoes[6].strongest.range_m = -1;
    echoes[7].strongest.range_m = std::numeric_limits<double>::quiet_NaN();
    echoes[8].strongest.range_m = 2.1e6;
    const Bytes b = encoded(777, echoes);
    ASSERT_EQ(unit().packet_time(b, 0), kEpoch + 777 * 480'000);
    std::vector<LidarPoint> points(kPoints);
    ASSERT_EQ(unit().points(b, points), kPoints - 4);
    for (std::size_t k = 0; k < kPoints - 4; ++k) {
        const LidarPoint& p = points[k];
        const auto i = static_cast<std::size_t>(p.shot);
        EXPECT_EQ(i, k < 5 ? k : k + 4);
        EXPECT_NEAR(p.range_m, echoes[i].strongest.range_m, 0.867e-3) << "half a millimetre along each axis";
        EXPECT_LE(norm(p.position_m() - echoes[i].strongest.range_m * shots[i].direction), 0.867e-3);
        EXPECT_EQ(p.t_offset_ns, shots[i].t_offset_ns);
        EXPECT_EQ(p.intensity, 45);
        EXPECT_EQ(p.beam, shots[i].beam);
    }
}

TEST(Mid360, RefusesBytesThatAreNotItsPackets) {
    const Bytes good = encoded(3, std::vector<LidarEchoes>(kPoints));
    std::vector<LidarPoint> points(kPoints);
    for (const std::size_t at : {0, 1, 5, 10, 24, 28, 36, 1379}) {
        Bytes bad = good;
        bad[at] ^= 0x10;
        EXPECT_FALSE(unit().packet_time(bad, 0)) << "byte " << at;
        EXPECT_EQ(unit().points(bad, points), 0U);
    }
    EXPECT_FALSE(unit().packet_time(std::span(good).first(kBytes - 1), 0));
    EXPECT_FALSE(unit().packet_time({}, 0));
}

TEST(Mid360, RosetteHasTheStatedAnglesAndFillsTheFieldOfView) {
    EXPECT_NEAR(norm(LivoxRosette::direction(0) - Vec3{0, std::cos(22.5 * kDeg), std::sin(22.5 * kDeg)}), 0, 1e-15);
    // A quarter of a turn later: 16.6545 swings.
    const double elevation = (22.5 + 29.5 * std::sin(2 * std::numbers::pi * 66.61803398874989 / 4)) * kDeg;
    EXPECT_NEAR(norm(LivoxRosette::direction(5'000) - Vec3{std::cos(elevation), 0, std::sin(elevation)}), 0, 1e-12);

    // Share of cells of 2 x 2 degrees that hold a point: grows from turn to turn, as the pattern does not repeat.
    std::vector<bool> met(180 * 29);
    const auto fill = [&](std::int64_t from, std::int64_t to) {
        for (std::int64_t n = from; n < to; ++n) {
            const Vec3 d = LivoxRosette::direction(n);
            EXPECT_NEAR(norm(d), 1, 1e-12);
            const double e = std::asin(d.z) / kDeg;
            EXPECT_GE(e, -7 - 1e-9);
            EXPECT_LE(e, 52 + 1e-9);
            const auto row = static_cast<std::size_t>(std::clamp((e + 7) / 2, 0.0, 28.0));
            const auto column = static_cast<std::size_t>((std::atan2(d.x, d.y) / kDeg + 180) / 2) % 180;
            met[row * 180 + column] = true;
        }
        return static_cast<double>(std::ranges::count(met, true)) / static_cast<double>(met.size());
    };
    const double first = fill(0, 20'000), second = fill(20'000, 40'000), fifth = fill(40'000, 100'000);
    EXPECT_GT(first, 0.5);
    EXPECT_GT(second, first + 0.1);
    EXPECT_GT(fifth, 0.98);
}

TEST(Mid360, ShotsFollowOneAnotherAcrossPackets) {
    const auto a = shots_of(41), b = shots_of(42);
    EXPECT_EQ(norm(a[95].direction - LivoxRosette::direction(42 * 96 - 1)), 0);
    EXPECT_EQ(norm(b[0].direction - LivoxRosette::direction(42 * 96)), 0);
    EXPECT_EQ(a[95].t_offset_ns + 5'000, unit().packet_start_ns(42) - unit().packet_start_ns(41));
    EXPECT_EQ(unit().sweep(208), 0);
    EXPECT_EQ(unit().sweep(209), 1);
    EXPECT_EQ(unit().first_packet_from(100'320'000), 209);
}

}  // namespace
}  // namespace narpa::mid360_packets
