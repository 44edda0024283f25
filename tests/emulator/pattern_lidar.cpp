// LiDARs that a file describes: flash, raster, spinning, separate beams, a table of shots. Each is fired inside a
// sphere, and its packets decode to the geometry, at each shot's own time.
#include "protocols/lidar/pattern_lidar.h"

#include <cmath>
#include <random>

#include "base/constants.h"
#include "emulator/lidar/lidar_unit.h"
#include "protocols/lidar/point_packet.h"
#include "tests/emulator/loop_support.h"

namespace narpa::test {
namespace {

constexpr Vec3 kLidar_m{0.5, 0, 2}, kVelocity_m_s{1, 2, -0.5};
constexpr const char* kHead = "[lidar]\nname = \"an instrument\"\nrate_hz = 10\nrange_max_m = 500\n";
constexpr const char* kGrid = "[grid]\ncolumns = 30\nrows = 20\nfov_horizontal_deg = 60\nfov_vertical_deg = 40\n";

class PatternLidars : public LoopTest {
protected:
    /// The instrument moves through a hollow sphere of 30 m, with the world's axes.
    std::string scene_text(const std::string& keys = "") const {
        return "sun.direction = [0, 0, 1]\n[[body]]\nname = \"shell\"\nsphere = {radius_m = 30}\n"
               "material = {kind = \"lambert\", albedo = 0.6}\n"
               "[[body]]\nname = \"craft\"\nsphere = {radius_m = 1e-6}\nposition_m = [0.5, 0, 1.9]\n"
               "velocity_m_s = [1, 2, -0.5]\n"
               "[[lidar]]\nname = \"eye\"\nmount = \"craft\"\nposition_m = [0, 0, 0.1]\nmodel = \"it.toml\"\n" +
               keys;
    }
    void describe(const std::string& text) { std::ofstream(folder_ / "it.toml") << text; }
    std::unique_ptr<World> world(const std::string& text, const std::string& keys = "") {
        describe(text);
        auto made = World::create(scene(scene_text(keys)));
        EXPECT_TRUE(made) << made.error().text();
        return *std::move(made);
    }
    std::string error_of(const std::string& text) {
        describe(text);
        std::ofstream(folder_ / "scene.toml") << scene_text();
        const auto read = read_scene(folder_ / "scene.toml");
        return read ? "" : read.error().text();
    }
};

/// From inside: the distance to the sphere of 30 m about the world's origin.
double range_m(const Vec3& from, const Vec3& direction) {
    const double b = dot(from, direction);
    return -b + std::sqrt(b * b - dot(from, from) + 900);
}

/// Fires two frames and checks every point of every packet; returns the shots of the second, by their times after
/// its start.
std::vector<std::pair<std::int64_t, LidarShot>> check_frames(const World& world, double velocity_step_m_s = 0) {
    LidarUnit unit(world, 0, true);
    const LidarModel& model = *unit.lidar().model;
    const LidarSpec& spec = unit.spec();
    const std::int64_t epoch_ns = world.scene().epoch_unix_ns;
    std::vector<LidarPoint> points(spec.points_per_packet);
    std::vector<std::pair<std::int64_t, LidarShot>> second;
    std::size_t all = 0;
    for (std::int64_t p = 0; unit.sweep(p) < 2; ++p) {
        unit.fire(p);
        const std::int64_t start_ns = unit.packet_start_ns(p);
        EXPECT_EQ(model.packet_time(unit.bytes(), 0), epoch_ns + start_ns);
        EXPECT_EQ(model.first_packet_from(start_ns), p);
        EXPECT_EQ(model.first_packet_from(start_ns + 1), p + 1);
        const std::size_t n = model.points(unit.bytes(), points);
        EXPECT_EQ(n, unit.shots().size()) << "every shot meets the sphere";
        all += n;
        for (std::size_t i = 0; i < n; ++i) {
            const LidarPoint& point = points[i];
            const LidarShot& shot = unit.shots()[i];
            EXPECT_EQ(point.t_offset_ns, shot.t_offset_ns);
            EXPECT_LE(start_ns + shot.t_offset_ns, unit.t_sent_ns(p)) << "sent when it is fired";
            EXPECT_LT(norm(point.direction - shot.direction), 1.5e-8);
            EXPECT_EQ(point.beam, shot.beam);
            EXPECT_EQ(point.shot, static_cast<int>(i));
            EXPECT_NEAR(point.intensity, 1000 * unit.truth()[i].reflectivity, 0.51);
            const double t_s = 1e-9 * static_cast<double>(start_ns + shot.t_offset_ns);
            EXPECT_NEAR(point.range_m, range_m(kLidar_m + t_s * kVelocity_m_s, shot.direction),
                        0.5 * spec.range_resolution_m + 1e-5);
            EXPECT_NEAR(point.velocity_m_s, velocity_step_m_s > 0 ? -dot(kVelocity_m_s, shot.direction) : 0,
                        0.5 * velocity_step_m_s + 1e-9);
            if (unit.sweep(p) == 1)
                second.emplace_back(start_ns + shot.t_offset_ns - std::llround(1e9 / spec.rate_hz), shot);
        }
    }
    EXPECT_EQ(all, 2 * second.size());
    return second;
}

TEST_F(PatternLidars, AFlashFiresAllAtOnce) {
    const auto shots = check_frames(*world(std::string(kHead) + kGrid));
    ASSERT_EQ(shots.size(), 600U);
    for (const auto& [t_ns, shot] : shots) EXPECT_EQ(t_ns, 0);
    // Evenly spaced on a plane: the corner's cell is half a cell inside of the field of view.
    const Vec3 corner = shots.front().second.direction;
    EXPECT_NEAR(corner.x / corner.y, -std::tan(30 * kRadPerDeg) * 29 / 30, 1e-12);
    EXPECT_NEAR(corner.z / corner.y, std::tan(20 * kRadPerDeg) * 19 / 20, 1e-12);
}

/// Inside of the sphere, whose points all light each other evenly: rho^2 W / (4 pi R^2) more light at each, W being
/// the solid angle of the field.
TEST_F(PatternLidars, APulseOfAFlashLightsItsWholeField) {
    const auto made = world(std::string(kHead) + kGrid, "multipath = \"diffuse\"\npulse_length_m = 1000\n");
    LidarUnit unit(*made, 0, true);
    double light = 0;
    int shots = 0;
    for (std::int64_t p = 0; unit.sweep(p) < 2; ++p) {
        unit.fire(p);
        for (std::size_t i = 0; i < unit.shots().size(); ++i, ++shots) {
            const auto& echo = unit.echoes()[i].strongest;
            const auto& truth = unit.truth()[i];
            light += static_cast<double>(echo.reflectivity) / (echo.range_m * echo.range_m) -
                     static_cast<double>(truth.reflectivity) / (truth.range_m * truth.range_m);
        }
    }
    const double a = std::tan(30 * kRadPerDeg), b = std::tan(20 * kRadPerDeg),
                 solid_angle = 4 * std::atan(a * b / std::sqrt(1 + a * a + b * b));
    const double expected = 0.36 * solid_angle / (4 * kPi * 900);
    EXPECT_NEAR(light / shots, expected, 0.08 * expected);
}

TEST_F(PatternLidars, ARasterFiresCellAfterCellThereAndBack) {
    const auto shots = check_frames(*world(
        std::string(kHead) + kGrid + "spacing = \"angles\"\nscan = \"rows\"\ntwo_way = true\nscan_share = 0.9"));
    ASSERT_EQ(shots.size(), 600U);
    for (std::size_t i = 0; i < shots.size(); ++i) {
        const std::size_t row = i / 30, column = row % 2 == 0 ? i % 30 : 29 - i % 30;
        const LidarShot& shot = shots[i].second;
        EXPECT_NEAR(static_cast<double>(shots[i].first), 150e3 * static_cast<double>(i), 1);
        EXPECT_NEAR(shot.azimuth_rad, (2 * static_cast<double>(column) - 29) * kRadPerDeg, 1e-12);
        EXPECT_NEAR(shot.elevation_rad, (19 - 2 * static_cast<double>(row)) * kRadPerDeg, 1e-12);
    }
}

TEST_F(PatternLidars, ASpinningOneGoesRound) {
    const auto shots = check_frames(
        *world(std::string(kHead) + "rate_hz_max = 20\n[spin]\ncolumns = 100\nelevation_deg = [-10, 0, 10]\n"
                                    "azimuth_deg = [1, 0, -1]",
               "rate_hz = 20"));
    ASSERT_EQ(shots.size(), 300U);
    for (std::size_t i = 0; i < shots.size(); ++i) {
        const int beam = static_cast<int>(i % 3);
        EXPECT_NEAR(static_cast<double>(shots[i].first), 0.5e6 * static_cast<double>(i / 3), 1);
        EXPECT_NEAR(shots[i].second.azimuth_rad, (3.6 * static_cast<double>(i / 3) + 1 - beam) * kRadPerDeg, 1e-12);
    }
}

TEST_F(PatternLidars, AVelocimeterMeasuresAlongItsBeams) {
    std::string text = std::string(kHead) + "velocity_resolution_m_s = 0.001\nlatency_s = 0.01\n";
    for (int i = 0; i < 4; ++i)
        text += "[[beam]]\nazimuth_deg = " + std::to_string(90 * i) + "\nelevation_deg = -65\nphase = 0.0" +
                std::to_string(i) + "\n";
    const auto made = world(text);
    EXPECT_EQ(check_frames(*made, 1e-3).size(), 4U);
    LidarUnit unit(*made, 0);
    EXPECT_EQ(unit.t_sent_ns(5), 500'000'000 + 3'000'000 + 10'000'001) << "a latency after its last shot";
}

TEST_F(PatternLidars, ATableHasShotsAtAnyTimes) {
    std::ofstream table(folder_ / "rosette.csv");
    table << "phase,azimuth_deg,elevation_deg,beam\n# late in the frame\n";
    for (int i = 0; i < 118; ++i)
        table << 0.5 + 0.004 * i << ',' << 20 * std::sin(0.7 * i) << ',' << 20 * std::cos(1.1 * i) << ",0\n";
    table.close();
    const auto shots = check_frames(*world(std::string(kHead) + "shots = \"rosette.csv\""));
    ASSERT_EQ(shots.size(), 118U);
    EXPECT_NEAR(static_cast<double>(shots[100].first), 90e6, 1);
}

TEST_F(PatternLidars, StatesTwoEchoesOfAShot) {
    const auto made = world(std::string(kHead) + "dual = true\n" + kGrid, "returns = \"dual\"");
    const LidarModel& model = *made->scene().lidars[0].model;
    std::vector<std::uint8_t> bytes(model.spec().data_packet_bytes);
    std::vector<LidarEchoes> echoes(model.spec().shots_per_packet);
    const LidarEcho near{10, 0.5f, 0}, far{20.0004, 70.0f, 0};
    echoes[1] = {.strongest = near, .second = far, .last = far};
    echoes[3] = {.strongest = near, .second = {}, .last = near};
    model.encode(7, 0, echoes, bytes);
    std::vector<LidarPoint> points(model.spec().points_per_packet);
    ASSERT_EQ(model.points(bytes, points), 3U);
    EXPECT_EQ(points[0].range_m, 20.0);
    EXPECT_EQ(points[0].intensity, 65535) << "saturates";
    EXPECT_EQ(points[1].range_m, 10.0);
    EXPECT_EQ(points[1].intensity, 500);
    EXPECT_EQ(points[0].shot, 1);
    EXPECT_EQ(points[1].echo, 1);
    EXPECT_EQ(points[2].shot, 3);
    std::vector<LidarShot> shots(echoes.size());
    model.shots(7, shots);
    std::vector<LidarAxis> empty(echoes.size());
    ASSERT_EQ(model.empty_shots(bytes, empty), echoes.size() - 2);
    EXPECT_NEAR(dot(empty[0].direction, shots[0].direction), 1, 1e-12);
    EXPECT_NEAR(dot(empty[1].direction, shots[2].direction), 1, 1e-12);
    EXPECT_EQ(empty[1].t_offset_ns, shots[2].t_offset_ns);
    bytes.pop_back();
    EXPECT_EQ(model.empty_shots(bytes, empty), 0U);
}

TEST_F(PatternLidars, RefusesPacketsThatAreNotItsOwnOrChanged) {
    const auto made = world(std::string(kHead) + kGrid);
    LidarUnit unit(*made, 0);
    const LidarModel& model = *unit.lidar().model;
    unit.fire(3);
    std::vector<std::uint8_t> bytes(unit.bytes().begin(), unit.bytes().end());
    std::vector<LidarPoint> points(unit.spec().points_per_packet);
    std::mt19937 random(1);
    for (int k = 0; k < 20'000; ++k) {
        auto changed = bytes;
        changed[random() % changed.size()] ^= static_cast<std::uint8_t>(1U << random() % 8);
        if (random() % 4 == 0) changed.resize(random() % changed.size());
        ASSERT_FALSE(model.packet_time(changed, 0));
        ASSERT_EQ(model.points(changed, points), 0U);
    }
    const auto other = world(std::string(kHead) +
                             "[grid]\ncolumns = 30\nrows = 40\nfov_horizontal_deg = 60\n"
                             "fov_vertical_deg = 40\n");
    EXPECT_FALSE(other->scene().lidars[0].model->packet_time(bytes, 0)) << "of another instrument";
}

TEST_F(PatternLidars, WrongDescriptionsAreToldWithTheirLine) {
    const std::string head = kHead, grid = kGrid;
    const auto expect_error = [&](const std::string& text, const std::string& part) {
        const std::string error = error_of(text);
        EXPECT_NE(error.find("it.toml"), std::string::npos) << error;
        EXPECT_NE(error.find(part), std::string::npos) << error;
    };
    EXPECT_EQ(error_of(head + grid), "");
    expect_error(head, "expected one of [grid], [spin], [[beam]] and shots");
    expect_error(head + grid + "[spin]\ncolumns = 3\nelevation_deg = [1]", "expected one of [grid], [spin]");
    expect_error(head + grid + "two_way = true", "it.toml:10:");
    expect_error(head + "colour = 1\n" + grid, "colour");
    expect_error(head + "range_resolution_m = 1.5e-6\n" + grid, "range_resolution_m: expected whole micrometres");
    expect_error(head + "rate_hz_min = 1\n" + grid, "expected at most 0.9 s together");
    expect_error(head + "rate_hz_max = 5\n" + grid, "rate_hz_min <= rate_hz <= rate_hz_max");
    expect_error(head + "rate_hz_max = 1e4\n" + grid, "12 packets a frame at 10000 Hz, expected at most 100000");
    expect_error(head + "[grid]\ncolumns = 2000\nrows = 2000\nfov_horizontal_deg = 9\nfov_vertical_deg = 9",
                 "2000 x 2000 shots a frame, expected at most 1000000");
    expect_error(head + "[grid]\ncolumns = 9\nrows = 9\nfov_horizontal_deg = 180\nfov_vertical_deg = 9",
                 "(0, 170]");
    expect_error(head + "[spin]\ncolumns = 9\nelevation_deg = [1, 2]\nazimuth_deg = [1]", "an array of 2 numbers");
    expect_error(head +
                     "[[beam]]\nazimuth_deg = 0\nelevation_deg = 0\nphase = 0.5\n[[beam]]\nazimuth_deg = 0\n"
                     "elevation_deg = 0\n",
                 "shot 1: fires before the shot above it");
    std::ofstream(folder_ / "bad.csv") << "phase,azimuth_deg,elevation_deg,beam\n0,0,0,0\n0.5,0,91,0\n";
    expect_error(head + "shots = \"bad.csv\"", "bad.csv:3:1: expected phase,azimuth_deg");
    expect_error(head + "shots = \"none.csv\"", "none.csv: cannot be opened");
    expect_error("", "has no \"lidar\"");
    expect_error("[lidar", "it.toml:1");
    std::filesystem::remove(folder_ / "it.toml");
    std::ofstream(folder_ / "scene.toml") << scene_text();
    const auto read = read_scene(folder_ / "scene.toml");
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().text().find("it.toml"), std::string::npos) << read.error().text();
}

}  // namespace
}  // namespace narpa::test
