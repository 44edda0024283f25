// A LiDAR model that is not in the product, added in this file alone, through the whole program: read from a scene,
// run in lockstep, written to a capture, and read back by navigation as points that match the geometry.
#include <array>
#include <cmath>
#include <numbers>

#include "drivers/lidar/capture.h"
#include "emulator/lidar/lidar_unit.h"
#include "protocols/little_endian.h"
#include "rehearsal/navigation/sensor_inputs.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/allocation_counter.h"

namespace narpa {
namespace {

constexpr LidarNetwork kNetwork{.data_port = 7000, .mac = {2, 0, 0, 0, 0, 1}, .address = {10, 0, 0, 8}};

/// 8 beams side by side that fire together, 25 times a turn and packet: its packet period follows its rate. A
/// packet is its number in 8 bytes, then a range in mm (4 bytes; 0: none) and a percentage (1 byte) for each shot.
class Fan8 final : public LidarModel {
public:
    static constexpr int kBeams = 8, kColumns = 25, kShots = kBeams * kColumns;

    explicit Fan8(const LidarSettings& settings)
        : LidarModel({.name = "FAN-8",
                      .rate_hz = settings.rate_hz,
                      .packet_period_ns = std::llround(1e9 / settings.rate_hz),
                      .shots_per_packet = kShots,
                      .points_per_packet = kShots,
                      .data_packet_bytes = 8 + 5 * kShots,
                      .range_m_max = 4000,
                      .range_resolution_m = 1e-3,
                      .network = kNetwork}) {}

    void shots(std::int64_t, std::span<LidarShot> out) const noexcept override {
        for (int i = 0; i < kShots; ++i) {
            const int beam = i % kBeams, column = i / kBeams;
            const double azimuth = 2 * std::numbers::pi * column / kColumns, elevation = 0.05 * (beam - 3.5);
            out[i] = {.t_offset_ns = column * spec().packet_period_ns / kColumns,
                      .origin_m = {0.01 * beam, 0, 0.2},
                      .direction = {std::cos(elevation) * std::sin(azimuth),
                                    std::cos(elevation) * std::cos(azimuth), std::sin(elevation)},
                      .azimuth_rad = azimuth,
                      .elevation_rad = elevation,
                      .beam = beam};
        }
    }

    void encode(std::int64_t packet, LidarUtc epoch, std::span<const LidarEchoes> echoes,
                std::span<std::uint8_t> out) const noexcept override {
        put_le(out.data(), static_cast<std::uint64_t>(epoch.unix_ns + packet_start_ns(packet)));
        for (std::size_t i = 0; i < kShots; ++i) {
            const LidarEcho& echo = echoes[i].strongest;
            put_le(&out[8 + 5 * i], static_cast<std::uint32_t>(std::lround(1e3 * echo.range_m)));
            out[8 + 5 * i + 4] = static_cast<std::uint8_t>(std::lround(100 * echo.reflectivity));
        }
    }

    std::optional<std::int64_t> packet_time(std::span<const std::uint8_t> bytes,
                                            std::int64_t) const noexcept override {
        if (bytes.size() != spec().data_packet_bytes) return std::nullopt;
        return static_cast<std::int64_t>(get_le<std::uint64_t>(bytes.data()));
    }
    std::size_t points(std::span<const std::uint8_t> bytes, std::span<LidarPoint> out) const noexcept override {
        if (bytes.size() != spec().data_packet_bytes) return 0;
        std::array<LidarShot, kShots> fired;
        shots(0, fired);
        std::size_t count = 0;
        for (int i = 0; i < kShots; ++i) {
            const std::uint8_t* at = &bytes[static_cast<std::size_t>(8 + 5 * i)];
            const auto range_mm = get_le<std::uint32_t>(at);
            if (range_mm == 0) continue;
            out[count++] = {.origin_m = fired[i].origin_m,
                            .direction = fired[i].direction,
                            .range_m = 1e-3 * range_mm,
                            .t_offset_ns = fired[i].t_offset_ns,
                            .intensity = at[4],
                            .beam = fired[i].beam,
                            .shot = i};
        }
        return count;
    }
};

const LidarMake& fan8() {
    static const LidarMake make{
        .name = "FAN-8",
        .rate_hz_min = 1,
        .rate_hz_max = 4,
        .rate_hz_default = 2,
        .range_m_max = 4000,
        .range_m_default = 500,
        .network = kNetwork,
        .configure = [](const LidarSettings& settings) { return std::make_shared<const Fan8>(settings); }};
    if (!find_lidar_make("FAN-8")) add_lidar_make(make);
    return make;
}

/// The LiDAR is 2 m above the centre of a hollow sphere of 30 m, with the world's axes; another body is commanded.
constexpr double kRadius_m = 30;
constexpr Vec3 kPosition_m{0.5, 0, 2};
std::string inside_a_sphere(const std::string& lidar_keys = "") {
    return "[scene]\nname = \"shell\"\nepoch = 2026-11-21T12:00:00Z\n[sun]\ndirection = [0, 0, 1]\n"
           "[[body]]\nname = \"shell\"\nsphere = {radius_m = 30}\nmaterial = {kind = \"lambert\", albedo = 0.6}\n"
           "[[body]]\nname = \"commanded\"\nsphere = {radius_m = 1e-6}\ncan_id = 0x100\n"
           "[[lidar]]\nname = \"fan\"\nmodel = \"FAN-8\"\nposition_m = [0.5, 0, 2]\n" +
           lidar_keys + "[render]\nspp = 1\n";
}

class JointLidar : public test::LoopTest {
protected:
    void SetUp() override { ASSERT_EQ(fan8().name, "FAN-8"); }
};

TEST_F(JointLidar, SceneChecksItsKeysAgainstTheModelsLimits) {
    const Scene good = scene(inside_a_sphere());
    EXPECT_EQ(good.lidars[0].model->spec().name, "FAN-8");
    EXPECT_EQ(good.lidars[0].model->spec().rate_hz, 2);
    EXPECT_EQ(good.lidars[0].range_max_m, 500);
    const std::string path = folder_ / "bad.toml";
    std::ofstream(path) << inside_a_sphere("rate_hz = 5\n");
    const auto too_fast = read_scene(path);
    ASSERT_FALSE(too_fast);
    EXPECT_NE(too_fast.error().what.find("expected a number in [1, 4]"), std::string::npos)
        << too_fast.error().what;
}

TEST_F(JointLidar, PacketsOfALockstepRunDecodeToTheGeometry) {
    RunOptions o;
    o.bus = record(21);  // two seconds
    o.lockstep = true;
    o.lidar = {{"fan", folder_ / "fan.pcap"}};
    auto emulator = Emulator::create(scene(inside_a_sphere()), o);
    if (!emulator && emulator.error().text().find("built without captures") != std::string::npos)
        GTEST_SKIP() << "built without libpcap";
    ASSERT_TRUE(emulator) << emulator.error().text();
    ASSERT_TRUE((*emulator)->run(StopFlag{false}));
    const LidarSensor& lidar = test::lidar_of(**emulator);
    EXPECT_EQ(lidar.stats().packets, 4U);  // a turn of 0.5 s each
    EXPECT_EQ(lidar.stats().returns, 4U * Fan8::kShots);
    EXPECT_DOUBLE_EQ(lidar.sweeps(), 4);
    EXPECT_EQ(lidar.sinks()[0]->counters().sent, 4U) << "no position packets";
    EXPECT_NE(lidar.to_text(true).find("fan.pcap: 4 written, 0 dropped"), std::string::npos) << lidar.to_text(true);

    // As navigation reads them: the turn that ends at 1.5 s, from the third packet.
    const auto capture = read_capture(folder_ / "fan.pcap");
    ASSERT_TRUE(capture) << capture.error().text();
    const Scene& s = (*emulator)->world().scene();
    rehearsal::SweepBuffer buffer(s.lidars[0], s.epoch_unix_ns);
    for (const UdpDatagram& d : capture->datagrams) EXPECT_TRUE(buffer.take(d.payload, 0));
    EXPECT_FALSE(buffer.take(std::vector<std::uint8_t>(1206), 0));
    EXPECT_TRUE(buffer.complete_to(1'500'000'000));
    LidarSweep sweep;
    buffer.turn(1'500'000'000, sweep);
    const std::vector<RangePoint>& points = sweep.points;
    EXPECT_TRUE(sweep.empty.empty()) << "this format does not state them";
    ASSERT_EQ(points.size(), static_cast<std::size_t>(Fan8::kShots));
    EXPECT_EQ(points.front().t_s, -0.5);
    EXPECT_EQ(points.back().t_s, -0.02);
    for (const RangePoint& p : points)
        EXPECT_NEAR(norm(kPosition_m + p.position_m()), kRadius_m, 0.501e-3) << "half the resolution of the ranges";
}

TEST_F(JointLidar, FiringAllocatesNothing) {
    if (!test::kAllocationsAreCounted) GTEST_SKIP() << "a sanitizer has its own heap";
    auto world = World::create(scene(inside_a_sphere()));
    ASSERT_TRUE(world) << world.error().text();
    LidarUnit unit(**world, 0);
    unit.fire(0);
    const test::AllocationCounter counter;
    for (std::int64_t packet = 1; packet < 20; ++packet) {
        unit.fire(packet);
        EXPECT_TRUE(unit.position(packet).empty());
    }
    EXPECT_EQ(counter.on_all_threads(), 0U);
}

}  // namespace
}  // namespace narpa
