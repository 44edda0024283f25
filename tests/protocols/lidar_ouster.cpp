// The Ouster OS1: firing pattern, packets and what it states of itself.
#include "protocols/lidar/ouster.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "protocols/lidar/ouster_metadata.h"
#include "protocols/lidar/ouster_packet.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"

namespace narpa {
namespace {

constexpr std::int64_t kEpoch_ns = 1'800'000'000'123'456'789;

const LidarMake& os1(int beams) {
    const LidarMake* make = find_lidar_make("os1-" + std::to_string(beams));
    EXPECT_NE(make, nullptr);
    return *make;
}

std::shared_ptr<const LidarModel> os1_unit(int beams, int columns, double rate_hz, OusterProfile profile) {
    LidarSettings settings{.rate_hz = rate_hz,
                           .profile = std::string(kOusterProfiles[static_cast<std::size_t>(profile)]),
                           .columns = columns};
    EXPECT_TRUE(os1(beams).complete(settings));
    return os1(beams).configure(settings);
}

std::string recorded_metadata(const char* file) {
    return test::read_text(test::source_path("../shared/assets/lidar/ouster/") + file);
}

TEST(Os1, HasItsModesInWholePackets) {
    struct Mode {
        int columns, rate_hz;
        std::int64_t period_ns;
    };
    for (const Mode& m : {Mode{512, 10, 3'125'000},
                          {1024, 10, 1'562'500},
                          {2048, 10, 781'250},
                          {512, 20, 1'562'500},
                          {1024, 20, 781'250}})
        for (const int beams : {16, 32, 64, 128}) {
            const auto unit = os1_unit(beams, m.columns, m.rate_hz, OusterProfile::single);
            EXPECT_EQ(unit->spec().packet_period_ns, m.period_ns);
            EXPECT_EQ(unit->spec().packet_period_ns * m.columns / 16 * m.rate_hz, 1'000'000'000)
                << "a turn is exact";
            EXPECT_EQ(unit->spec().shots_per_packet, static_cast<std::size_t>(16 * beams));
            EXPECT_EQ(unit->spec().network.position_port_offset(), 0);
        }
}

TEST(Os1, RefusesModesThatItDoesNotHave) {
    const std::pair<int, double> bad[] = {{2048, 20}, {700, 10}, {1024, 15}, {1024, 10.5}};
    for (const auto& [columns, rate_hz] : bad) {
        LidarSettings settings{.rate_hz = rate_hz, .columns = columns};
        const Status refused = os1(64).complete(settings);
        ASSERT_FALSE(refused) << columns << "x" << rate_hz;
        EXPECT_EQ(refused.error().line, 0);
        EXPECT_NE(refused.error().what.find("512x10, 1024x10, 2048x10, 512x20, 1024x20"), std::string::npos);
    }
}

// README.md, "Where a ray starts": all shots of a column at once, evenly spaced columns, clockwise.
TEST(Os1, FiresColumnByColumn) {
    const auto unit = os1_unit(64, 1024, 10, OusterProfile::single);
    std::vector<LidarShot> shots(1024);
    unit->shots(64 * 7 + 16, shots);  // a quarter of the eighth turn
    for (std::size_t i = 0; i < shots.size(); ++i) {
        EXPECT_EQ(shots[i].t_offset_ns, static_cast<std::int64_t>(i / 64 * 1'562'500 / 16));
        EXPECT_EQ(shots[i].beam, static_cast<int>(i % 64));
        EXPECT_EQ(shots[i].block, static_cast<int>(i / 64));
        EXPECT_NEAR(norm(shots[i].direction), 1, 1e-12);
        EXPECT_NEAR(std::hypot(shots[i].origin_m.x, shots[i].origin_m.y), 0.015806, 1e-12);
        EXPECT_NEAR(shots[i].origin_m.z, 0.03618, 1e-12);
        EXPECT_TRUE(shots[i].fires);
    }
    // Column 0 is backwards, so a quarter of a turn clockwise from there is left.
    EXPECT_NEAR(shots[0].origin_m.x, -0.015806, 1e-12);
    EXPECT_NEAR(shots[0].origin_m.y, 0, 1e-12);
}

class Os1Profiles : public ::testing::TestWithParam<OusterProfile> {};

TEST_P(Os1Profiles, PacketsDecodeToWhatWasMeasured) {
    const OusterProfile profile = GetParam();
    const auto unit = os1_unit(32, 512, 20, profile);
    const LidarSpec& spec = unit->spec();
    const bool dual = profile == OusterProfile::dual;
    std::mt19937 random(7);
    std::uniform_real_distribution<double> range(0.5, 230);
    std::vector<LidarEchoes> echoes(spec.shots_per_packet);
    std::size_t expected = 0;
    for (std::size_t i = 0; i < echoes.size(); ++i) {
        if (i % 5 == 0) continue;
        echoes[i].strongest = echoes[i].last = {range(random), 0.37f};
        if (i % 3 == 0) echoes[i].second = {range(random), 0.11f};
        echoes[i].sunlight = 0.25f;
        expected += dual && i % 3 == 0 ? 2 : 1;
    }
    const std::int64_t packet = 32 * 65'537 + 5;  // the frame's number wraps
    std::vector<LidarShot> shots(spec.shots_per_packet);
    std::vector<std::uint8_t> bytes(spec.data_packet_bytes, 0xAA);
    unit->shots(packet, shots);
    unit->encode(packet, kEpoch_ns, echoes, bytes);
    EXPECT_EQ(unit->packet_time(bytes, 0), kEpoch_ns + unit->packet_start_ns(packet));

    std::vector<LidarPoint> points(spec.points_per_packet);
    points.resize(unit->points(bytes, points));
    ASSERT_EQ(points.size(), expected);
    for (const LidarPoint& p : points) {
        const auto i = static_cast<std::size_t>(p.shot);
        const LidarEcho& echo = p.echo == 0 ? echoes[i].strongest : echoes[i].second;
        EXPECT_EQ(p.intensity, p.echo == 0 ? 37 : 11);
        EXPECT_EQ(p.beam, shots[i].beam);
        EXPECT_EQ(p.t_offset_ns, shots[i].t_offset_ns);
        EXPECT_LT(norm(p.position_m() - (shots[i].origin_m + echo.range_m * shots[i].direction)),
                  0.5001 * spec.range_resolution_m);
    }

    const OusterFormat format(profile, 32);
    const OusterColumn column = format.column(bytes, 3);
    EXPECT_EQ(column.measurement_id, 5 * 16 + 3);
    EXPECT_EQ(column.t_ns, static_cast<std::uint64_t>(kEpoch_ns + unit->packet_start_ns(packet) + 292'968));
    EXPECT_TRUE(format.is_valid(column));
    const std::uint16_t frame = profile == OusterProfile::legacy ? column.frame_id : format.header(bytes).frame_id;
    EXPECT_EQ(frame, 1);
    EXPECT_EQ(column.encoder, profile == OusterProfile::legacy ? 83u * 90'112 / 512 : 0u);
    const OusterPixel pixel = format.pixel(bytes, 0, 1);
    EXPECT_EQ(pixel.near_ir, profile == OusterProfile::low_bandwidth ? 992 : 1000);  // in steps of 16
    if (profile != OusterProfile::low_bandwidth) {
        const double r = echoes[1].strongest.range_m;
        EXPECT_NEAR(pixel.returns[0].signal, 25'000 * 0.37 / (r * r), 0.51);
    }
    EXPECT_EQ(format.pixel(bytes, 0, 0).returns[0].range_mm, 0u) << "no echo";
}

TEST_P(Os1Profiles, RangesBeyondTheFieldAreNone) {
    const auto unit = os1_unit(16, 512, 10, GetParam());
    std::vector<LidarEchoes> echoes(unit->spec().shots_per_packet);
    const double max_m = unit->spec().range_m_max;
    const double ranges[] = {max_m, std::nextafter(max_m, 1e9), std::nan(""), -1, 1e300, INFINITY};
    for (std::size_t i = 0; i < std::size(ranges); ++i) echoes[i].strongest = {ranges[i], 1e30f};
    std::vector<std::uint8_t> bytes(unit->spec().data_packet_bytes);
    unit->encode(0, kEpoch_ns, echoes, bytes);
    std::vector<LidarPoint> points(unit->spec().points_per_packet);
    ASSERT_EQ(unit->points(bytes, points), 1u);
    EXPECT_NEAR(points[0].range_m, max_m, 1e-9);
    EXPECT_EQ(points[0].intensity, 255);

    std::vector<LidarShot> shots(echoes.size());
    unit->shots(0, shots);
    std::vector<LidarAxis> empty(echoes.size());
    ASSERT_EQ(unit->empty_shots(bytes, empty), echoes.size() - 1);
    for (std::size_t i = 1; i < shots.size(); ++i) {
        EXPECT_EQ(empty[i - 1].origin_m, shots[i].origin_m);
        EXPECT_EQ(empty[i - 1].direction, shots[i].direction);
        EXPECT_NEAR(static_cast<double>(empty[i - 1].t_offset_ns), static_cast<double>(shots[i].t_offset_ns), 1);
    }
    EXPECT_EQ(unit->empty_shots({}, empty), 0u);
}

/// Single bytes and whole stretches are changed: what is no packet of the unit is refused, and what is taken is
/// sound.
TEST_P(Os1Profiles, MutatedPacketsAreRefusedOrSound) {
    const auto unit = os1_unit(16, 512, 10, GetParam());
    std::vector<LidarEchoes> echoes(unit->spec().shots_per_packet);
    for (LidarEchoes& e : echoes) e.strongest = {12, 0.5f};
    std::vector<std::uint8_t> good(unit->spec().data_packet_bytes);
    unit->encode(3, kEpoch_ns, echoes, good);
    std::vector<LidarPoint> points(unit->spec().points_per_packet);
    std::mt19937 random(11);
    std::size_t refused = 0, taken = 0;
    for (int round = 0; round < 4000; ++round) {
        auto bytes = good;
        const std::size_t at = random() % bytes.size(), n = 1 + random() % (round % 2 == 0 ? 1 : 40);
        for (std::size_t i = at; i < std::min(bytes.size(), at + n); ++i)
            bytes[i] = static_cast<std::uint8_t>(random());
        if (round % 10 == 0) bytes.resize(random() % (2 * good.size()));
        const std::size_t count = unit->points(bytes, points);
        ++(unit->packet_time(bytes, 0) ? taken : refused);
        EXPECT_TRUE(unit->packet_time(bytes, 0) || count == 0);
        for (std::size_t i = 0; i < count; ++i) {
            ASSERT_GT(points[i].range_m, 0);
            ASSERT_LE(points[i].range_m, unit->spec().range_m_max + 1e-9);
            ASSERT_GE(points[i].t_offset_ns, 0);
            ASSERT_LE(points[i].t_offset_ns, 100'000'000);
            ASSERT_NEAR(norm(points[i].direction), 1, 1e-9);
        }
    }
    EXPECT_GT(refused, 400u);
    EXPECT_GT(taken, 400u);
    EXPECT_EQ(unit->points({}, points), 0u);
}

INSTANTIATE_TEST_SUITE_P(Of, Os1Profiles,
                         ::testing::Values(OusterProfile::legacy, OusterProfile::single, OusterProfile::dual,
                                           OusterProfile::low_bandwidth),
                         [](const auto& of) {
                             if (of.param == OusterProfile::legacy) return "Legacy";
                             if (of.param == OusterProfile::single) return "Single";
                             return of.param == OusterProfile::dual ? "Dual" : "LowBandwidth";
                         });

TEST(OusterMetadata, OfAConfiguredUnitIsReadAgain) {
    const auto unit = os1_unit(64, 2048, 10, OusterProfile::dual);
    const auto read = read_ouster_metadata(unit->metadata());
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(read->columns, 2048);
    EXPECT_EQ(read->rate_hz, 10);
    EXPECT_EQ(read->profile, "RNG19_RFL8_SIG16_NIR16_DUAL");
    EXPECT_EQ(read->prod_line, "OS-1-64");
    EXPECT_EQ(read->altitude_deg.size(), 64u);
    EXPECT_EQ(read->column_window, (std::array{0, 2047}));
    EXPECT_EQ(read->pixel_shift_by_row.front() - read->pixel_shift_by_row[1], std::lround(5.61 / 360 * 2048));
    EXPECT_DOUBLE_EQ(read->origin_to_beam_mm(), 15.806);
    EXPECT_EQ(write_ouster_metadata(*read), unit->metadata());
}

// Files of real sensors: firmware 2.2 and 2.3, and one that a user reduced to the angles.
TEST(OusterMetadata, OfRealSensorsConfiguresUnits) {
    const std::string text = recorded_metadata("OS-1-128_v2.3.0_1024x10.json");
    if (text.empty()) GTEST_SKIP() << "no metadata beside the project: ../shared/assets/lidar/ouster";
    LidarSettings settings{.calibration = text};
    ASSERT_TRUE(os1(128).complete(settings));
    EXPECT_EQ(settings.columns, 1024);
    EXPECT_EQ(settings.rate_hz, 10);
    EXPECT_EQ(settings.profile, "RNG15_RFL8_NIR8");
    const auto unit = os1(128).configure(settings);
    std::vector<LidarShot> shots(unit->spec().shots_per_packet);
    unit->shots(0, shots);
    EXPECT_NEAR(shots[127].elevation_rad, -21.82 * std::numbers::pi / 180, 1e-12);
    EXPECT_NEAR(shots[127].azimuth_rad, 2 * std::numbers::pi + 4.2 * std::numbers::pi / 180, 1e-12);
    const auto stated = read_ouster_metadata(unit->metadata());
    ASSERT_TRUE(stated) << stated.error().text();
    EXPECT_EQ(stated->serial(), 122'201'000'998u);
    EXPECT_EQ(stated->init_id, 7'109'750u);
    EXPECT_EQ(stated->pixel_shift_by_row[1], 16);
    EXPECT_EQ(stated->prod_line, "OS-1-128");
    // The designed beams are near those of a real unit.
    std::vector<LidarShot> designed(shots.size());
    os1_unit(128, 1024, 10, OusterProfile::single)->shots(0, designed);
    for (std::size_t i = 0; i < 128; ++i)
        EXPECT_LT(norm(designed[i].direction - shots[i].direction), 0.9 * std::numbers::pi / 180) << i;

    LidarSettings reduced{.calibration = recorded_metadata("OS-1-64_sensor_config_reduced.json")};
    ASSERT_TRUE(os1(64).complete(reduced));
    EXPECT_EQ(reduced.columns, 1024);
    LidarSettings of_another{.calibration = recorded_metadata("OS-0-32-U1_v2.2.0_1024x10.json")};
    EXPECT_TRUE(os1(32).complete(of_another));
    EXPECT_EQ(of_another.returns, LidarReturns::strongest_two);
    const Status too_many = os1(64).complete(of_another);
    ASSERT_FALSE(too_many);
    EXPECT_NE(too_many.error().what.find("expected 64 numbers"), std::string::npos);
}

TEST(OusterMetadata, ErrorsNameTheLineAndWhatWasExpected) {
    const std::string beams = "\"beam_altitude_angles\": [1, -1],\n\"beam_azimuth_angles\": [0, 0]";
    struct Case {
        std::string text;
        int line;
        const char* what;
    };
    const Case cases[] = {
        {"", 1, "not JSON"},
        {"[]", 1, "a JSON object with beam_altitude_angles"},
        {"{\n\"beam_altitude_angles\": [1,,2]}", 2, "not JSON"},
        {"{\n\"prod_sn\": \"1\"}", 1, "beam_altitude_angles: expected the angle of each beam"},
        {"{\n\"beam_altitude_angles\": 7}", 2, "a list of numbers"},
        {"{\n\n\"beam_altitude_angles\": [91]}", 3, "numbers from -90"},
        {"{\n\"beam_altitude_angles\": [1, -1],\n\"beam_azimuth_angles\": [0]}", 3, "as many angles"},
        {"{" + beams + ",\n\"lidar_mode\": \"1024\"}", 3, "as 1024x10"},
        {"{" + beams + ",\n\"lidar_mode\": \"1024x10x\"}", 3, "as 1024x10"},
        {"{" + beams + ",\n\"lidar_origin_to_beam_origin_mm\": 1e9}", 3, "numbers from"},
        {"{" + beams + ",\n\"lidar_to_sensor_transform\": [2,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}", 3, "a rotation"},
        {"{" + beams + ",\n\"lidar_to_sensor_transform\": [1, 2]}", 3, "16 numbers"},
        {"{" + beams + ",\n\"lidar_mode\": \"512x10\", \"column_window\": [9]}", 3,
         "the first and the last column"},
        {"{" + beams + ",\n\"lidar_mode\": \"512x10\", \"column_window\": [0, 512]}", 3,
         "the first and the last column"},
        {"{" + beams + ",\n\"lidar_mode\": \"512x10\", \"columns_per_packet\": 12}", 3, "a divisor of the columns"},
        {"{" + beams + ",\n\"columns_per_packet\": 4096}", 3, "at most 65507 bytes"},
        {"{" + beams + ",\n\"pixels_per_column\": 16}", 3, "the number of beam_altitude_angles"},
        {"{" + beams + ",\n\"pixel_shift_by_row\": [1]}", 3, "a number for each beam"},
        {"{" + beams + ",\n\"udp_profile_lidar\": \"NEW\"}", 3, "RNG19_RFL8_SIG16_NIR16"},
        {"{" + beams + ",\n\"prod_sn\": \"abc\"}", 3, "at most 12 digits"},
        {"{" + beams + ",\n\"initialization_id\": 1e300}", 3, "whole numbers"},
        {"{" + beams + ",\n\"initialization_id\": 99999999999999999999}", 3, "whole numbers"},
    };
    for (const Case& c : cases) {
        const auto read = read_ouster_metadata(c.text);
        ASSERT_FALSE(read) << c.text;
        EXPECT_EQ(read.error().line, c.line) << c.text;
        EXPECT_NE(read.error().what.find(c.what), std::string::npos) << c.text << "\n" << read.error().what;
    }
}

// Columns outside of the window are off: their packets are marked, and a reader finds nothing there.
TEST(OusterMetadata, ColumnWindowTurnsLasersOff) {
    LidarSettings settings{.calibration =
                               R"({"beam_altitude_angles": [2, 1, 0, -1, 2, 1, 0, -1, 2, 1, 0, -1, 2, 1, 0, -1],
        "beam_azimuth_angles": [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        "lidar_mode": "512x10", "column_window": [40, 99]})"};
    ASSERT_TRUE(os1(16).complete(settings));
    const auto unit = os1(16).configure(settings);
    std::vector<LidarShot> shots(256);
    std::vector<LidarEchoes> echoes(256);
    for (LidarEchoes& e : echoes) e.strongest = {10, 0.5f};
    std::vector<std::uint8_t> bytes(unit->spec().data_packet_bytes);
    std::vector<LidarPoint> points(256);
    const std::size_t firing[] = {0, 0, 8, 16, 16, 16, 4, 0};  // columns of each packet
    for (std::int64_t packet = 0; packet < 8; ++packet) {
        unit->shots(packet, shots);
        const auto on = std::ranges::count_if(shots, &LidarShot::fires);
        EXPECT_EQ(static_cast<std::size_t>(on), 16 * firing[packet]) << packet;
        unit->encode(packet, kEpoch_ns, echoes, bytes);
        EXPECT_EQ(unit->points(bytes, points), 16 * firing[packet]) << packet;
    }
    // In a mode with twice as many columns, the window keeps its angles.
    LidarSettings wide{.columns = 1024, .calibration = settings.calibration};
    ASSERT_TRUE(os1(16).complete(wide));
    const auto stated = read_ouster_metadata(os1(16).configure(wide)->metadata());
    ASSERT_TRUE(stated);
    EXPECT_EQ(stated->column_window, (std::array{80, 199}));
}

}  // namespace
}  // namespace narpa
