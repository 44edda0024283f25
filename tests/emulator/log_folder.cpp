// A log folder that is used again: it holds the log of one run, the last that has started.
#include <filesystem>

#include "tests/emulator/loop_support.h"
#include "tracking/online_estimator.h"

namespace narpa::test {
namespace {

using Files = std::map<std::string, std::string>;

class LogFolder : public LoopTest {
protected:
    RunOptions options(int commands = 3) {
        RunOptions o;
        o.bus = record(commands);
        o.lockstep = true;
        o.log_folder = log_;
        return o;
    }
    RunOptions of_both_sensors(int commands = 3) {
        RunOptions o = options(commands);
        o.video = {{"nav", "none"}};
        o.lidar = {{"top", "none"}};
        o.log_shots = true;
        return o;
    }
    /// The log folder's files and their content.
    [[nodiscard]] Files files() const {
        Files all;
        for (const auto& entry : std::filesystem::directory_iterator(log_))
            all[entry.path().filename()] = read_text(entry.path());
        return all;
    }
    [[nodiscard]] std::vector<std::string> names() const {
        std::vector<std::string> all;
        for (const auto& [name, text] : files()) all.push_back(name);
        return all;
    }

    const std::string log_ = folder_ / "log";
};

TEST_F(LogFolder, ARunThatCannotStartLeavesTheLogOfAnEarlierOne) {
    ran(scene(small_scene()), of_both_sensors());
    const Files before = files();
    EXPECT_EQ(before.size(), 9U);
    RunOptions video = of_both_sensors(), lidar = of_both_sensors(), estimate = of_both_sensors();
    video.video[0].second = "/nowhere/at/all.y4m";
    lidar.lidar[0].second = "/nowhere/at/all.pcap";
    estimate.observers = {estimate_from("aft", {})};
    for (const RunOptions& o : {video, lidar, estimate}) {
        EXPECT_FALSE(Emulator::create(scene(small_scene()), o));
        EXPECT_TRUE(files() == before);
    }
}

TEST_F(LogFolder, HasNoFilesOfSensorsThatTheRunLacks) {
    ran(scene(small_scene()), of_both_sensors());
    std::ofstream(log_ + "/notes.csv") << "mine\n";
    std::ofstream(log_ + "/nav.y4m.png") << "mine\n";
    RunOptions lidar = options();
    lidar.lidar = {{"top", "none"}};
    ran(scene(small_scene()), lidar);
    EXPECT_EQ(names(), (std::vector<std::string>{"calibration.json", "can.log", "nav.y4m.png", "notes.csv",
                                                 "run.json", "scene.toml", "top.sweeps.csv"}));
    RunOptions unheard = of_both_sensors();
    unheard.bus.clear(), unheard.lidar.clear();
    unheard.lockstep = false, unheard.duration_s = 0.2;
    ran(scene(small_scene()), unheard);
    EXPECT_EQ(names(), (std::vector<std::string>{"calibration.json", "nav.ledger.csv", "nav.png", "nav.truth.csv",
                                                 "nav.y4m.png", "notes.csv", "run.json", "scene.toml"}));
}

TEST_F(LogFolder, FilesBesideARunJsonThatIsNoRunsStay) {
    std::filesystem::create_directory(log_);
    std::ofstream(log_ + "/run.json") << "{\"mine\": true}\n";
    std::ofstream(log_ + "/approach.truth.csv") << "mine\n";
    const Files before = files();
    const auto refused = Emulator::create(scene(small_scene()), of_both_sensors());
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().text().find("run.json:1:1: format: expected"), std::string::npos)
        << refused.error().text();
    EXPECT_TRUE(files() == before);
}

TEST_F(LogFolder, FilesOfAFolderThatHasNoRunStay) {
    std::filesystem::create_directory(log_);
    std::ofstream(log_ + "/approach.truth.csv") << "mine\n";
    ran(scene(small_scene()), of_both_sensors());
    EXPECT_EQ(files()["approach.truth.csv"], "mine\n");
}

}  // namespace
}  // namespace narpa::test
