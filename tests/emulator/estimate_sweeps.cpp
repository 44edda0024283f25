// Poses estimated from the sweeps of a logged run, which are made again from its CAN log.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "emulator/replay/sweep_replay.h"
#include "renderer/camera/scene_camera.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"
#include "tracking/estimate_report.h"
#include "tracking/sweep_tracker.h"

namespace narpa::test {
namespace {

using nlohmann::json;

class EstimateSweeps : public LoopTest {
protected:
    /// A run in lockstep over 0.8 s of the docking approach: eight turns, of which the last ends after the run.
    void fly(const RunOptions& sinks) {
        auto scene = read_scene(test::build_path("scenes/docking/docking.toml"));
        ASSERT_TRUE(scene) << scene.error().text();
        scene->render.spp = 1;
        scene->cameras[0] = scaled(scene->cameras[0], 0.125, 0.125);
        RunOptions o = sinks;
        o.bus = record_approach(40'050'000'000, 40'950'000'000);
        o.lockstep = true;
        o.log_folder = log_;
        ASSERT_NE(ran(*std::move(scene), o), nullptr);
    }
    static RunOptions with_lidar() {
        RunOptions o;
        o.lidar = {{"top", "none"}};
        return o;
    }
    static RunOptions with_camera() {
        RunOptions o;
        o.video = {{"nav", "none"}};
        return o;
    }
    [[nodiscard]] std::unique_ptr<SweepReplay> replay() const {
        auto opened = SweepReplay::open(log_, "top", "");
        EXPECT_TRUE(opened) << opened.error().text();
        return opened ? *std::move(opened) : nullptr;
    }
    /// The estimates of all whole sweeps.
    static std::vector<TrackedFrame> tracked(SweepReplay& run, const TrackerOptions& options) {
        auto tracker = SweepTracker::create(run.world(), run.lidar_index(), options);
        EXPECT_TRUE(tracker) << tracker.error().text();
        std::vector<TrackedFrame> frames;
        for (ReplayedSweep made; run.next(0, made);) {
            LidarSweep sweep;
            SweepReader reader(*run.lidar().model);
            for (const auto& p : made.packets) reader.append(p.bytes, p.t_ns - made.t_ns, sweep);
            frames.push_back((*tracker)->take(made.sweep, made.t_ns, made.t_end_ns, sweep));
        }
        return frames;
    }
    const std::string log_ = folder_ / "log";
};

TEST_F(EstimateSweeps, AreThoseOfTheRunBitForBit) {
    fly(with_lidar());
    const auto run = replay();
    ASSERT_NE(run, nullptr);
    EXPECT_TRUE(run->is_lockstep());
    std::vector<std::int64_t> sweeps;
    for (ReplayedSweep made; run->next(0, made);) {
        EXPECT_EQ(made.repeats, std::optional(true)) << made.sweep;
        EXPECT_GE(made.packets.size(), 75U);
        sweeps.push_back(made.sweep);
    }
    EXPECT_EQ(sweeps, (std::vector<std::int64_t>{401, 402, 403, 404, 405, 406, 407}));
    const auto every_third = replay();
    ReplayedSweep made;
    ASSERT_TRUE(every_third->next(0, made) && every_third->next(2, made));
    EXPECT_EQ(made.sweep, 404);
    EXPECT_EQ(made.repeats, std::optional(true)) << "what is left out has no effect on the others";
}

TEST_F(EstimateSweeps, OfARunWithoutTheLidarAreTracked) {
    fly(with_camera());
    const auto run = replay();
    ASSERT_NE(run, nullptr);
    TrackerOptions options;
    options.start_deg = options.start_percent = 3;
    const std::vector<TrackedFrame> frames = tracked(*run, options);
    ASSERT_EQ(frames.size(), 7U);
    for (const TrackedFrame& f : frames) {
        ASSERT_EQ(f.state, EstimateState::measured) << f.why;
        EXPECT_EQ(f.answer.kind, AnswerKind::good);
        EXPECT_LT(error_between(*f.measured, f.truth).head<3>().norm(), 1e-3);
        EXPECT_LT(error_between(*f.measured, f.truth).tail<3>().norm(), 0.02);
    }
    const EstimateSummary s = summarise(frames);
    EXPECT_LT(s.nees_mean, 2 * s.nees_high);
    EXPECT_NEAR(error_between(frames.front().guess, frames.front().truth).head<3>().norm(), 3 * kDegree, 1e-9);
    EXPECT_LT(error_between(frames.back().guess, frames.back().truth).tail<3>().norm(), 0.05)
        << "the track leads on from what it knows";
}

TEST_F(EstimateSweeps, AreEstimatedByOneCommand) {
    fly(with_lidar());
    const auto narpa = [](const std::string& arguments) {
        return run_command(NARPA_BIN " estimate " + arguments + " 2>&1");
    };
    const std::string csv = folder_ / "sweeps.csv";
    const Done done = narpa(log_ + " --lidar top --every 2 --csv " + csv + " --json");
    ASSERT_EQ(done.status, 0) << done.out;
    EXPECT_NE(done.out.find("lidar top, target station, by icp: 4 of 4 sweeps gave a pose"), std::string::npos)
        << done.out;
    const json told = json::parse(done.out.substr(done.out.find("\n{") + 1));
    EXPECT_EQ(told["lidar"], "top");
    EXPECT_EQ(told["summary"]["answers"]["good"], 4);
    EXPECT_EQ(told["summary"]["nees_expected"], 6.0);
    EXPECT_LT(told["summary"]["position_rms_m"].get<double>(), 0.02);
    const auto rows = read_rows(csv);
    ASSERT_EQ(rows.size(), 4U);
    EXPECT_EQ(rows[1].at("frame"), "403");
    EXPECT_EQ(rows[1].at("answer"), "good");

    const auto refuses = [&](const std::string& arguments, const std::string& words) {
        const Done refused = narpa(arguments);
        EXPECT_EQ(refused.status, 2) << refused.out;
        EXPECT_NE(refused.out.find(words), std::string::npos) << refused.out;
    };
    refuses(log_ + " --lidar bottom", "no camera or LiDAR named \"bottom\", expected one of: nav, top");
    refuses(log_ + " --lidar top --method dense", "--method goes with frames, and sweeps of a LiDAR are estimated");
    refuses(log_ + " --range-noise 0.001", "--range-noise goes with sweeps, expected --lidar NAME too");
    // A packet that differs is found, and so is a damaged row.
    std::string sweeps = read_text(log_ + "/top.sweeps.csv");
    const std::string crc = read_rows(log_ + "/top.sweeps.csv")[2].at("packets_crc32");
    std::ofstream(log_ + "/top.sweeps.csv") << std::string(sweeps).replace(sweeps.find(crc), crc.size(), "1");
    refuses(log_ + " --lidar top", "top.sweeps.csv:4: sweep 403 is not the run's any more");
    std::ofstream(log_ + "/top.sweeps.csv") << std::string(sweeps).replace(sweeps.find(crc), crc.size(), "one");
    refuses(log_ + " --lidar top", "top.sweeps.csv:4:");
    std::filesystem::remove(log_ + "/top.sweeps.csv");
    std::filesystem::remove(log_ + "/can.log");
    refuses(log_ + " --lidar top", "holds no can.log, frame or sweep");
}

}  // namespace
}  // namespace narpa::test
