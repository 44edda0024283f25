// LiDARs that fire in a part of the turn, and what packets declare beside their returns.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "protocols/lidar/ouster.h"
#include "protocols/lidar/ouster_metadata.h"
#include "protocols/lidar/velodyne.h"
#include "protocols/lidar/velodyne_packet.h"

namespace narpa {
namespace {

constexpr std::int64_t kHour_ns = 3'600'000'000'000;
using VelodyneBytes = std::array<std::uint8_t, VelodynePacket::kBytes>;

/// A packet whose shots all have a return at 10 m, with these azimuths of its blocks.
VelodyneBytes packet_at(const LidarModel& unit, const std::array<int, 12>& azimuths_cdeg) {
    VelodyneBytes bytes;
    std::vector<LidarEchoes> echoes(unit.spec().shots_per_packet);
    for (LidarEchoes& e : echoes) e.strongest = e.last = {10, 0.5f};
    unit.encode(0, 0, echoes, bytes);
    VelodynePacket packet = *VelodynePacket::read(bytes);
    for (std::size_t b = 0; b < azimuths_cdeg.size(); ++b)
        packet.blocks[b].azimuth_cdeg = static_cast<std::uint16_t>((azimuths_cdeg[b] + 36'000) % 36'000);
    packet.write(bytes);
    return bytes;
}

/// The largest angle between a block's azimuth and those of its shots, and whether any lies before it.
double widest_cdeg(const LidarModel& unit, std::span<const std::uint8_t> bytes) {
    const VelodynePacket packet = *VelodynePacket::read(bytes);
    std::vector<LidarPoint> points(unit.spec().points_per_packet);
    points.resize(unit.points(bytes, points));
    EXPECT_FALSE(points.empty());
    double widest = 0;
    for (const LidarPoint& p : points) {
        const int block = unit.spec().returns == LidarReturns::dual ? p.shot / 32 * 2 : p.shot / 32;
        double off = std::atan2(p.direction.x, p.direction.y) * 18'000 / std::numbers::pi -
                     packet.blocks[static_cast<std::size_t>(block)].azimuth_cdeg;
        off -= 36'000 * std::round(off / 36'000);
        EXPECT_GT(off, -0.01) << block;
        widest = std::max(widest, off);
    }
    return widest;
}

// The rotor turns by 0.4 deg a block at 10 Hz.
TEST(VelodyneWindow, NoBlockIsSpreadOverWhatTheWindowLeavesOut) {
    const auto unit = vlp16().configure_default();
    const std::array<int, 12> steady{0, 40, 80, 120, 160, 200, 240, 280, 320, 360, 400, 440};
    EXPECT_LT(widest_cdeg(*unit, packet_at(*unit, steady)), 40);
    for (std::size_t jump = 1; jump < 12; ++jump)
        for (const int by : {-1, -30, 70, 300, 18'000, 35'900}) {  // back by jitter; over a gap
            std::array<int, 12> azimuths = steady;
            for (std::size_t b = jump; b < 12; ++b) azimuths[b] += by;
            if (by == -1) azimuths[jump] -= 60;
            EXPECT_LT(widest_cdeg(*unit, packet_at(*unit, azimuths)), 62) << jump << " " << by;
        }
}

TEST(VelodyneWindow, AWindowOfOneBlockTakesTheNominalRate) {
    const auto unit = vlp16().configure_default();
    std::array<int, 12> azimuths{};
    for (std::size_t b = 0; b < 12; ++b) azimuths[b] = static_cast<int>(b % 2) * 18'000;
    EXPECT_NEAR(widest_cdeg(*unit, packet_at(*unit, azimuths)), 40 * (55.296 + 15 * 2.304) / 110.592, 0.5);
}

TEST(VelodyneWindow, DualReturnsJumpByPairs) {
    for (const LidarMake* make : {&vlp16(), &hdl32e()}) {
        const auto unit = make->configure({.rate_hz = 10, .returns = LidarReturns::dual});
        std::array<int, 12> azimuths{};
        for (std::size_t b = 0; b < 12; ++b) azimuths[b] = static_cast<int>(b / 2) * 40 + (b >= 6 ? 9000 : 0);
        EXPECT_LT(widest_cdeg(*unit, packet_at(*unit, azimuths)), 41) << make->name;
    }
}

// Real stamps start again at the full hour; units have been seen to count on.
TEST(VelodyneStamp, CountsOverTheHour) {
    const auto unit = vlp16().configure_default();
    VelodyneBytes bytes = packet_at(*unit, {});
    VelodynePacket packet = *VelodynePacket::read(bytes);
    for (const std::uint32_t past_us : {3'599'999'000u, 3'600'000'000u, 3'600'005'000u, 4'000'000'000u}) {
        packet.past_hour_us = past_us;
        packet.write(bytes);
        const std::int64_t t_ns = 7 * kHour_ns + 1000 * std::int64_t{past_us};
        EXPECT_EQ(unit->packet_time(bytes, t_ns + 12'345), t_ns);
    }
}

TEST(VelodyneMismatch, IsNamed) {
    const auto unit = vlp16().configure_default();
    const VelodyneBytes good = packet_at(*unit, {});
    EXPECT_EQ(unit->mismatch(good), "");
    EXPECT_EQ(unit->mismatch(std::span(good).first(512)), "512 bytes, expected 1206");
    EXPECT_EQ(hdl32e().configure_default()->mismatch(good), "product 22, expected 21");
    VelodyneBytes dual = good;
    dual[1204] = VelodynePacket::dual;
    EXPECT_EQ(unit->mismatch(dual), "return mode 39, expected 37, as the scene has it");
}

std::string metadata(const std::string& more) {
    std::string zeros = "0";
    for (int i = 1; i < 16; ++i) zeros += ", 0";
    return "{\"beam_altitude_angles\": [" + zeros + "], \"beam_azimuth_angles\": [" + zeros + "], " + more + "}";
}

std::shared_ptr<const LidarModel> sensor(const std::string& more, int columns = 0) {
    LidarSettings settings{.columns = columns, .calibration = metadata(more)};
    const LidarMake& make = *find_lidar_make("os1-16");
    const Status completed = make.complete(settings);
    EXPECT_TRUE(completed) << completed.error().text();
    return make.configure(settings);
}

TEST(OusterWindow, MayGoByWayOfColumnZero) {
    for (const auto& [columns, first, last] : {std::array{0, 853, 170}, {512, 426, 84}, {2048, 1706, 341}}) {
        const auto unit = sensor(R"("lidar_mode": "1024x10", "column_window": [853, 170])", columns);
        const int turn = columns == 0 ? 1024 : columns;
        std::vector<LidarShot> shots(unit->spec().shots_per_packet);
        for (int m = 0; m < turn; m += 16) {
            unit->shots(m / 16, shots);
            for (int c = 0; c < 16; ++c)
                EXPECT_EQ(shots[static_cast<std::size_t>(16 * c)].fires, m + c >= first || m + c <= last) << m + c;
        }
        const auto stated = read_ouster_metadata(unit->metadata());
        ASSERT_TRUE(stated);
        EXPECT_EQ(stated->column_window, (std::array{first, last}));
    }
}

TEST(OusterColumns, APacketHoldsAsManyAsTheMetadataState) {
    for (const std::int64_t n : {1, 2, 4, 8, 16, 32}) {
        const auto unit = sensor("\"lidar_mode\": \"1024x20\", \"columns_per_packet\": " + std::to_string(n));
        const LidarSpec& spec = unit->spec();
        ASSERT_EQ(spec.data_packet_bytes, static_cast<std::size_t>(32 + n * (12 + 16 * 12) + 32));
        EXPECT_EQ(read_ouster_metadata(unit->metadata())->columns_per_packet, n);
        std::vector<LidarEchoes> echoes(spec.shots_per_packet);
        for (LidarEchoes& e : echoes) e.strongest = {10, 0.5f};
        std::vector<std::uint8_t> bytes(spec.data_packet_bytes);
        std::vector<LidarPoint> points(spec.points_per_packet);
        for (const std::int64_t packet : {std::int64_t{0}, 1024 / n - 1, 1024 / n * 20'000'000 + 3}) {
            const std::int64_t turn = packet / (1024 / n), column = packet % (1024 / n) * n;
            EXPECT_EQ(unit->packet_start_ns(packet), turn * 50'000'000 + column * 50'000'000 / 1024);
            EXPECT_EQ(unit->first_packet_from(unit->packet_start_ns(packet)), packet);
            EXPECT_EQ(unit->sweep(packet), turn);
            unit->encode(packet, 1000, echoes, bytes);
            EXPECT_EQ(unit->packet_time(bytes, 0), 1000 + unit->packet_start_ns(packet));
            EXPECT_EQ(unit->points(bytes, points), spec.shots_per_packet);
        }
    }
}

TEST(OusterMismatch, IsNamed) {
    const auto unit = sensor(R"("initialization_id": 12345, "prod_sn": "77")");
    std::vector<LidarEchoes> echoes(unit->spec().shots_per_packet);
    std::vector<std::uint8_t> bytes(unit->spec().data_packet_bytes);
    unit->encode(3, 0, echoes, bytes);
    EXPECT_EQ(unit->mismatch(bytes), "");
    EXPECT_EQ(sensor(R"("initialization_id": 12346)")->mismatch(bytes),
              "init id 12345 in the packets, 12346 in the sensor's metadata");
    EXPECT_EQ(sensor(R"("prod_sn": "78")")->mismatch(bytes),
              "serial number 77 in the packets, 78 in the sensor's metadata");
    EXPECT_EQ(unit->mismatch(std::span(bytes).first(100)), "100 bytes, expected 3328");
    EXPECT_EQ(sensor("\"lidar_mode\": \"512x10\"")->mismatch(bytes), "") << "it states no identity: any is its own";
    EXPECT_EQ(sensor("\"columns_per_packet\": 8")->mismatch(bytes), "3328 bytes, expected 1696");
    bytes[32 + 8] = 5;  // of the first column
    EXPECT_EQ(unit->mismatch(bytes), "measurement ids that are not those of 16 successive columns of 1024");
}

}  // namespace
}  // namespace narpa
