// Dual returns, the HDL-32E, a unit's own beams, and packets that a real unit sent.
#include "protocols/lidar/velodyne.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "protocols/lidar/velodyne_packet.h"
#include "protocols/little_endian.h"
#include "tests/protocols/capture.h"
#include "tests/support/paths.h"

namespace narpa {
namespace {

constexpr double kRadian = std::numbers::pi / 180;
using Packet = std::array<std::uint8_t, VelodynePacket::kBytes>;

std::vector<LidarPoint> decoded(const LidarModel& unit, std::span<const std::uint8_t> bytes) {
    std::vector<LidarPoint> points(unit.spec().points_per_packet);
    points.resize(unit.points(bytes, points));
    return points;
}

// Manual, sections 8.2.1 and 9.3: twice as many packets, of 6 pairs of blocks with the same azimuth.
TEST(Vlp16Dual, PairsOfBlocksHaveTheLastAndTheStrongest) {
    const auto unit = vlp16().configure({.rate_hz = 10, .returns = LidarReturns::dual});
    EXPECT_EQ(unit->spec().packet_period_ns, 6 * 110'592);
    EXPECT_EQ(unit->spec().shots_per_packet, 192u);
    EXPECT_EQ(unit->spec().data_packets_per_position, 28);
    std::vector<LidarEchoes> echoes(192);
    const LidarEcho near{10, 0.2f}, far{30, 0.7f}, farthest{50, 0.1f};
    echoes[0] = {.strongest = near, .second = far, .last = far};
    echoes[1] = {.strongest = far, .second = near, .last = far};
    echoes[2] = {.strongest = near, .second = {}, .last = near};
    echoes[3] = {.strongest = near, .second = far, .last = farthest};
    Packet bytes{};
    unit->encode(7, 0, echoes, bytes);
    EXPECT_EQ(bytes[1204], 0x39);
    const auto range_at = [&](int block, int shot) {
        return 0.002 * get_le<std::uint16_t>(&bytes[static_cast<std::size_t>(100 * block + 4 + 3 * shot)]);
    };
    const double expected[4][2] = {{30, 10}, {30, 10}, {10, 10}, {50, 10}};
    for (int shot = 0; shot < 4; ++shot)
        for (int block = 0; block < 2; ++block)
            EXPECT_DOUBLE_EQ(range_at(block, shot), expected[shot][block]) << shot;
    for (int block = 0; block < 12; block += 2)
        EXPECT_EQ(std::memcmp(&bytes[100 * block], &bytes[100 * block + 100], 4), 0) << "the same azimuth";

    const auto points = decoded(*unit, bytes);
    ASSERT_EQ(points.size(), 7u) << "an echo that both blocks state is one point";
    EXPECT_EQ(points[0].echo, 0);
    EXPECT_EQ(points[1].echo, 1);
    EXPECT_EQ(points[1].shot, 0);
    EXPECT_EQ(points[4].shot, 2);
    EXPECT_EQ(decoded(*vlp16().configure_default(), bytes).size(), 0u);
}

TEST(Vlp16Dual, ShotsFireAsWithSingleReturns) {
    const auto dual = vlp16().configure({.rate_hz = 10, .returns = LidarReturns::dual}),
               single = vlp16().configure_default();
    std::vector<LidarShot> first(192), second(192), both(384);
    dual->shots(20, first);
    dual->shots(21, second);
    single->shots(10, both);
    first.insert(first.end(), second.begin(), second.end());
    for (std::size_t i = 0; i < both.size(); ++i) {
        EXPECT_EQ(first[i].direction, both[i].direction);
        EXPECT_EQ(dual->packet_start_ns(i < 192 ? 20 : 21) + first[i].t_offset_ns,
                  single->packet_start_ns(10) + both[i].t_offset_ns);
    }
}

// HDL-32E: 32 lasers, 46.080 us a firing, 12 firings a packet, 1808.4 packets a second.
TEST(Hdl32e, FiringsArePacketsBlocks) {
    const auto unit = hdl32e().configure_default();
    EXPECT_EQ(unit->spec().packet_period_ns, 552'960);
    std::vector<LidarShot> shots(unit->spec().shots_per_packet);
    unit->shots(100, shots);
    EXPECT_EQ(shots[31].t_offset_ns, 31 * 1'152);
    EXPECT_EQ(shots[32].t_offset_ns, 46'080);
    EXPECT_EQ(shots[33].beam, 1);
    EXPECT_NEAR(shots[0].elevation_rad, -30.67 * kRadian, 1e-12);
    EXPECT_NEAR(shots[31].elevation_rad, 10.67 * kRadian, 1e-12);
    const double rotor =
        std::fmod(1e-8 * static_cast<double>(100 * 552'960 + shots[50].t_offset_ns), 1) * 2 * std::numbers::pi;
    EXPECT_NEAR(shots[50].azimuth_rad, rotor, 1e-9);
}

TEST(Hdl32e, DecodedPointsLieOnTheirShots) {
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> range(1, 100);
    for (const auto returns : {LidarReturns::strongest, LidarReturns::last, LidarReturns::dual}) {
        const auto unit = hdl32e().configure({.rate_hz = 7.5, .returns = returns});
        std::vector<LidarShot> shots(unit->spec().shots_per_packet);
        std::vector<LidarEchoes> echoes(shots.size());
        for (LidarEchoes& e : echoes) e.strongest = e.last = {range(random), 0.5f};
        unit->shots(321, shots);
        Packet bytes;
        unit->encode(321, 0, echoes, bytes);
        EXPECT_EQ(bytes[1205], 0x21);
        const auto points = decoded(*unit, bytes);
        ASSERT_EQ(points.size(), shots.size());
        for (const LidarPoint& p : points) {
            const auto i = static_cast<std::size_t>(p.shot);
            EXPECT_EQ(p.t_offset_ns, shots[i].t_offset_ns);
            EXPECT_LT(norm(p.position_m() - echoes[i].strongest.range_m * shots[i].direction),
                      0.001 + 0.016 * kRadian * p.range_m);
        }
    }
}

/// A unit fires along its own beams and takes its offset from the ranges that it states; a reader that has the same
/// calibration finds the surface.
TEST(Velodyne, UnitsHaveTheirOwnBeams) {
    std::vector<LidarBeam> beams(16);
    for (int i = 0; i < 16; ++i)
        beams[static_cast<std::size_t>(i)] = {0.03 * (i - 8), 0.002 * (i - 4), 0.01 * (i - 7), 0.001 * i};
    const auto unit = vlp16().configure({.rate_hz = 10, .beams = beams});
    std::vector<LidarShot> shots(384);
    std::vector<LidarEchoes> echoes(384);
    unit->shots(3, shots);
    for (LidarEchoes& e : echoes) e.strongest.range_m = 12.345;
    Packet bytes;
    unit->encode(3, 0, echoes, bytes);
    EXPECT_EQ(get_le<std::uint16_t>(&bytes[4]), std::lround((12.345 + 0.07) / 0.002));
    for (const LidarPoint& p : decoded(*unit, bytes)) {
        const LidarShot& s = shots[static_cast<std::size_t>(p.shot)];
        EXPECT_NEAR(s.elevation_rad, beams[static_cast<std::size_t>(p.beam)].elevation_rad, 1e-12);
        EXPECT_LT(norm(p.position_m() - (s.origin_m + 12.345 * s.direction)), 0.0011 + 12.345 * 0.016 * kRadian);
    }
}

TEST(Hdl32e, PacketsOfARealUnitAreReadAndWrittenByteForByte) {
    const auto packets = test::captured_payloads(
        test::source_path("../shared/assets/lidar/velodyne/sample_velodyne_hdl32.pcap"), VelodynePacket::kBytes);
    if (packets.empty()) GTEST_SKIP() << "no capture beside the project: ../shared/assets/lidar/velodyne";
    const auto unit = hdl32e().configure_default();
    std::size_t points = 0;
    for (const std::vector<std::uint8_t>& bytes : packets) {
        const auto packet = VelodynePacket::read(bytes);
        ASSERT_TRUE(packet);
        Packet again;
        again.fill(0xAA);
        packet->write(again);
        EXPECT_TRUE(std::ranges::equal(again, bytes));
        points += decoded(*unit, bytes).size();
    }
    EXPECT_EQ(packets.size(), 500u);
    EXPECT_EQ(points, 146'705u);
}

}  // namespace
}  // namespace narpa
