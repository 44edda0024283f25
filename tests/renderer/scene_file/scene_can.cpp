// [time], [can] and poses from a user's own messages: what is read, and what is refused where.
#include <gtest/gtest.h>

#include <fstream>

#include "protocols/can/pose_map.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

constexpr const char* kDbc =
    "BO_ 2147484000 POS: 24 X\n SG_ X : 0|64@1- (1,0) [0|0] \"km\" X\n SG_ Y : 64|64@1- (1,0) [0|0] \"\" X\n"
    " SG_ Z : 128|64@1- (1,0) [0|0] \"m\" X\nSIG_VALTYPE_ 2147484000 X : 2;\n"
    "BO_ 257 ATT: 8 X\n SG_ S : 0|16@1- (1,0) [0|0] \"\" X\n SG_ I : 16|16@1- (1,0) [0|0] \"\" X\n"
    " SG_ D m1 : 32|16@1- (1,0) [0|0] \"deg\" X\n SG_ T : 48|16@1+ (1,0) [0|0] \"ms\" X\n";

class SceneOnCan : public testing::Test {
protected:
    void SetUp() override { std::ofstream(folder_ / "mission.dbc") << kDbc; }
    Result<Scene> read(const std::string& body_keys, const std::string& tables = "") {
        const std::string path = folder_ / "scene.toml";
        std::ofstream(path) << tables +
                                   "[ambient]\nradiance = 1\n[[camera]]\nname = \"c\"\nresolution = [64, 48]\n"
                                   "fov_diagonal_deg = 30\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n" +
                                   body_keys;
        return read_scene(path);
    }
    void expect_error(const Result<Scene>& scene, const std::string& words) {
        ASSERT_FALSE(scene) << words;
        EXPECT_NE(scene.error().text().find(words), std::string::npos) << scene.error().text();
    }
    test::TemporaryFolder folder_;
};

const std::string kPose =
    "can_id = 0x100\n[body.can_pose]\ndbc = \"mission.dbc\"\nposition = [\"POS.X\", \"POS.Y\", \"POS.Z\"]\n"
    "attitude_wxyz = [\"ATT.S\", \"ATT.I\", \"ATT.I\", \"ATT.I\"]\n";

TEST_F(SceneOnCan, ReadsThePoseOfOtherMessages) {
    const auto scene = read(kPose + "time = \"ATT.T\"\nattitude = \"world_to_body\"\n");
    ASSERT_TRUE(scene) << scene.error().text();
    const PoseMap& map = *scene->bodies[0].can_map;
    ASSERT_EQ(map.messages.size(), 2u);
    EXPECT_EQ(map.messages[0].id, 352u);
    EXPECT_TRUE(map.messages[0].extended);
    EXPECT_EQ(map.position[0].to_si, 1e3);
    EXPECT_EQ(map.position[0].signal.kind, DbcSignal::Kind::float64);
    EXPECT_EQ(map.attitude_wxyz[3].message, 1u);
    EXPECT_EQ(map.attitude_wxyz[3].signal.start_bit, 16);
    EXPECT_EQ(map.time->to_si, 1e-3);
    EXPECT_TRUE(map.world_to_body);
    EXPECT_FALSE(map.velocity);
    ASSERT_EQ(scene->warnings.size(), 1u);
    EXPECT_NE(scene->warnings[0].find("signal POS.Y has no unit, taken for m"), std::string::npos)
        << scene->warnings[0];
}

TEST_F(SceneOnCan, RefusesSignalsThatAreNotThere) {
    const auto with = [&](const std::string& from, const std::string& to) {
        std::string text = kPose;
        return read(text.replace(text.find(from), from.size(), to));
    };
    expect_error(with("POS.X", "POX.X"), "scene.toml:13:12: position: \"POX.X\": expected MESSAGE.SIGNAL");
    expect_error(with("POS.X", "POSX"), "expected MESSAGE.SIGNAL");
    expect_error(with("POS.X", "POS.W"), "the message has no such signal, expected one of X, Y, Z");
    expect_error(with("\"POS.X\", ", ""), "has 2 signals, expected 3");
    expect_error(with("POS.X", "ATT.T"), "has the unit \"ms\", expected one of m, km");
    expect_error(with("POS.X", "ATT.D"), "is multiplexed");
    expect_error(with("mission.dbc", "other.dbc"), "other.dbc: cannot be read");
    expect_error(with("can_id = 0x100\n", ""), "the body has no can_id");
    expect_error(with("dbc = \"mission.dbc\"\n", ""), "expected the DBC file of the bus");
    std::ofstream(folder_ / "mission.dbc") << "BO_ 1 A: 8 X\n SG_ B : 0|8@1 (1,0) [0|0] \"\" X\n";
    expect_error(read(kPose), "mission.dbc:2:");
}

TEST_F(SceneOnCan, ReadsClockAndBuses) {
    const auto scene = read("can_id = 0x110\n",
                            "[time]\nsource = \"system\"\non_restart = \"new_run\"\nptp4l = \"/run/p\"\n"
                            "ptp4l_domain = 24\n[can]\nsync_period_s = 0.1\n"
                            "time_period_s = 1\ntime_id = 0x200\nredundancy = \"cold\"\nheartbeat_id = 0x77f\n"
                            "heartbeat_timeout_s = 0.25\n");
    ASSERT_TRUE(scene) << scene.error().text();
    EXPECT_EQ(scene->time.source, TimeSettings::Source::system);
    EXPECT_EQ(scene->time.on_restart, TimeSettings::OnRestart::new_run);
    EXPECT_EQ(scene->time.ptp4l, "/run/p");
    EXPECT_EQ(scene->time.ptp4l_domain, 24);
    EXPECT_EQ(scene->can.sync_period_ns, 100'000'000);
    EXPECT_EQ(scene->can.time_period_ns, 1'000'000'000);
    EXPECT_EQ(scene->can.time_id, 0x200u);
    EXPECT_EQ(scene->can.redundancy, CanSettings::Redundancy::cold);
    EXPECT_EQ(scene->can.heartbeat_id, 0x77Fu);
    EXPECT_EQ(scene->can.heartbeat_timeout_ns, 250'000'000);
}

TEST_F(SceneOnCan, RefusesWhatCollidesOrHasNoEffect) {
    expect_error(read("can_id = 0x100\n", "[can]\ntime_period_s = 1\n"),
                 "0x100 has the identifier 0x100 of time_period_s in [can]");
    expect_error(read("can_id = 0x80\n", "[can]\nsync_period_s = 1\n"),
                 "0x080 has the identifier 0x080 of sync_period_s");
    expect_error(read("", "[can]\ntime_id = 0x200\n"), "belongs to time_period_s");
    expect_error(read("", "[can]\nheartbeat_id = 0x701\n"), "belongs to redundancy = \"cold\"");
    expect_error(read("", "[time]\nsource = \"gps\"\n"), "source");
    expect_error(read("", "[can]\nsync_period_s = 0\n"), "sync_period_s");
    expect_error(read("", "[time]\nsource = \"system\"\nptp4l = \"ptp4l\"\n"), "expected the absolute path");
    expect_error(read("", "[time]\nsource = \"system\"\nptp4l_domain = 256\n"), "ptp4l_domain");
    const auto free = read("", "[time]\nptp4l = \"/run/ptp4l\"\n");
    ASSERT_TRUE(free) << free.error().text();
    ASSERT_EQ(free->warnings.size(), 1u);
    EXPECT_NE(free->warnings[0].find("ptp4l of [time] has no effect"), std::string::npos);
}

}  // namespace
}  // namespace narpa
