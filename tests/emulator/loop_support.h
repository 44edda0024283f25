/// tests/emulator/loop_support.h - a small scene, commands for it on a recorded bus, and the files of a run.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "drivers/can/can_bus.h"
#include "emulator/camera/camera_sensor.h"
#include "emulator/emulator.h"
#include "emulator/lidar/lidar_sensor.h"
#include "protocols/can/messages.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/trajectory/trajectory.h"
#include "tests/support/paths.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa::test {

/// A sphere to look at and a chaser with a camera and a LiDAR.
inline std::string small_scene(const std::string& camera_keys = "rate_hz = 10") {
    return "[scene]\nname = \"small\"\nepoch = 2026-11-21T12:00:00Z\n"
           "[sun]\ndirection = [-1, 0.5, 0.7]\n"
           "[[body]]\nname = \"target\"\nsphere = {radius_m = 2}\nmaterial = {kind = \"lambert\", albedo = 0.6}\n"
           "[[body]]\nname = \"chaser\"\nsphere = {radius_m = 0.01}\nposition_m = [-10, 0, 0]\ncan_id = 0x100\n"
           "[[camera]]\nname = \"nav\"\nmount = \"chaser\"\nposition_m = [0.1, 0, 0]\n"
           "attitude_wxyz = [0.5, -0.5, 0.5, -0.5]\nresolution = [64, 48]\nfov_horizontal_deg = 40\n" +
           camera_keys +
           "\n[[lidar]]\nname = \"top\"\nmount = \"chaser\"\nposition_m = [0.1, 0, 0]\n"
           "attitude_wxyz = [0.7071067811865476, 0, 0, -0.7071067811865476]\nmodel = \"VLP-16\"\nrate_hz = 10\n"
           "[render]\nspp = 2\nseed = 42\n";
}

/// A scene with these keys in [render] in place of `spp = 2`.
inline std::string with_render(std::string scene_text, const std::string& keys) {
    return scene_text.replace(scene_text.find("spp = 2"), 7, keys);
}
/// A scene whose image is of this size.
inline std::string with_resolution(std::string scene_text, const std::string& size) {
    return scene_text.replace(scene_text.find("[64, 48]"), 8, size);
}

/// The rows of a CSV file, each by the names of its columns.
inline std::vector<std::map<std::string, std::string>> read_rows(const std::string& path) {
    const auto cells = [](const std::string& line) {
        std::vector<std::string> out(1);
        for (const char c : line) c == ',' ? void(out.emplace_back()) : out.back().push_back(c);
        return out;
    };
    std::ifstream in(path);
    std::string line;
    std::getline(in, line);
    const std::vector<std::string> names = cells(line);
    std::vector<std::map<std::string, std::string>> rows;
    while (std::getline(in, line)) {
        const std::vector<std::string> values = cells(line);
        EXPECT_EQ(values.size(), names.size()) << line;
        auto& row = rows.emplace_back();
        for (std::size_t i = 0; i < std::min(names.size(), values.size()); ++i) row[names[i]] = values[i];
    }
    return rows;
}

/// The first camera and the first LiDAR of a run.
inline const CameraSensor& camera_of(const Emulator& emulator) {
    return *emulator.cameras().front();
}
inline const LidarSensor& lidar_of(const Emulator& emulator) {
    return *emulator.lidars().front();
}

class LoopTest : public ::testing::Test {
protected:
    Scene scene(const std::string& text) {
        const std::string path = folder_ / "scene.toml";
        std::ofstream(path) << text;
        auto read = read_scene(path);
        if (!read) ADD_FAILURE() << read.error().text();
        return *std::move(read);
    }

    /// After its run; null where it cannot be made.
    static std::unique_ptr<Emulator> ran(Scene scene, const RunOptions& o) {
        auto emulator = Emulator::create(std::move(scene), o);
        if (!emulator) {
            ADD_FAILURE() << emulator.error().text();
            return nullptr;
        }
        const StopFlag stop{false};
        const Status status = (*emulator)->run(stop);
        EXPECT_TRUE(status) << status.error().text();
        return *std::move(emulator);
    }

    /// The chaser closes in and turns slowly: pose k is for time k * 100 ms.
    static PoseCommand command(int k) {
        const double t = 0.1 * k;
        Motion m{{exp_rotation({0, 0, 0.02 * t}), {-10 + 0.5 * t, 0.1 * t, 0}}, {0.5, 0.1, 0}, {0, 0, 0.02}};
        return {static_cast<std::uint8_t>(k), k * 100'000'000LL, m};
    }

    /// Records `count` commands as a candump log; returns its BUS.
    std::string record(int count) {
        const std::string spec = "log:" + (folder_ / "commands.log");
        auto bus = open_can_bus(spec, CanRole::client);
        if (!bus) {
            ADD_FAILURE() << bus.error().text();
            return spec;
        }
        for (int k = 0; k < count; ++k) {
            CanFrame frame;
            EXPECT_TRUE(encode_fd(command(k), 0x100, frame));
            EXPECT_TRUE((*bus)->send(frame));
        }
        return spec;
    }

    /// Records the commands of the docking scene's approach in this span of time; returns their BUS.
    std::string record_approach(std::int64_t from_ns, std::int64_t to_ns) {
        const std::string spec = "log:" + (folder_ / "commands.log");
        auto bus = open_can_bus(spec, CanRole::client);
        const auto rows = read_trajectory(build_path("scenes/docking/approach.csv"));
        if (!bus || !rows) {
            ADD_FAILURE() << (bus ? rows.error().text() : bus.error().text());
            return spec;
        }
        std::uint8_t counter = 0;
        for (const TrajectoryRow& row : *rows) {
            if (row.t_ns < from_ns || row.t_ns > to_ns) continue;
            CanFrame frame;
            EXPECT_TRUE(encode_fd(PoseCommand{counter++, row.t_ns, row.motion}, 0x100, frame));
            EXPECT_TRUE((*bus)->send(frame));
        }
        EXPECT_GT(counter, 2);
        return spec;
    }

    TemporaryFolder folder_;
};

}  // namespace narpa::test
