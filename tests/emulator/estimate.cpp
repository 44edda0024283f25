// Poses estimated beside a run and from its log: what is logged, what goes out on CAN, what the program prints.
#include <gtest/gtest.h>

#include <bit>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "emulator/camera/camera_unit.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/trajectory/trajectory.h"
#include "tests/drivers/can_support.h"
#include "tests/emulator/loop_support.h"
#include "tests/protocols/mcap_reader.h"
#include "tests/protocols/protobuf_reader.h"
#include "tests/support/cameras.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"
#include "tracking/estimate_report.h"
#include "tracking/online_estimator.h"

namespace narpa::test {
namespace {

using nlohmann::json;

const std::string kDocking = test::build_path("scenes/docking/docking.toml");

/// The docking scene, small, over a second of its approach.
class EstimateTest : public LoopTest {
protected:
    Scene docking() {
        auto read = read_scene(kDocking);
        if (!read) ADD_FAILURE() << read.error().text();
        Scene s = *std::move(read);
        Camera& c = s.cameras[0];
        c = scaled(c, 0.5, 0.5);
        s.render.spp = 4;
        return s;
    }
    /// The approach's commands from 40 s on, a tenth of a second apart.
    static std::vector<PoseCommand> approach_commands(std::size_t count) {
        std::vector<PoseCommand> commands;
        auto rows = read_trajectory(test::build_path("scenes/docking/approach.csv"));
        EXPECT_TRUE(rows);
        for (const TrajectoryRow& row : *rows)
            if (row.t_ns % 100'000'000 == 0 && row.t_ns >= 40'000'000'000 && commands.size() < count)
                commands.push_back({static_cast<std::uint8_t>(commands.size()), row.t_ns, row.motion});
        EXPECT_EQ(commands.size(), count);
        return commands;
    }
    /// The same on a recorded bus.
    std::string approach(std::size_t count) {
        const std::string spec = "log:" + (folder_ / "commands.log");
        const auto bus = open_or_fail(spec, CanRole::client);
        for (const PoseCommand& command : approach_commands(count)) {
            CanFrame frame;
            EXPECT_TRUE(encode_fd(command, 0x100, frame));
            EXPECT_TRUE(bus->send(frame));
        }
        return spec;
    }
    std::unique_ptr<Emulator> fly(std::size_t commands, const std::string& log) {
        RunOptions o;
        o.bus = approach(commands);
        o.lockstep = true;
        o.log_folder = log;
        o.mcap = mcap_;
        o.video = {{"nav", "none"}};
        TrackerOptions options;
        options.start_deg = options.start_percent = 3;
        o.observers = {estimate_from("", options, &estimator_)};
        return ran(docking(), o);
    }
    const OnlineEstimator* estimator_ = nullptr;
    std::string mcap_;
};

TEST_F(EstimateTest, TheMcapFileHasPosesAndCovariances) {
    mcap_ = folder_ / "a.mcap";
    const auto emulator = fly(3, "");
    ASSERT_NE(emulator, nullptr);
    const McapFileRead file = read_mcap(read_bytes(mcap_));
    const auto& frames = estimator_->frames();
    ASSERT_EQ(file.count("/camera/nav/estimate"), frames.size());
    EXPECT_EQ(file.count("/camera/nav/estimate/pose"), frames.size());
    const auto number = [](const ProtoFields& fields, int field) {
        const auto found = fields.find(field);
        return found == fields.end() ? 0 : std::bit_cast<double>(found->second.number);
    };
    std::size_t k = 0;
    for (const McapMessageRead& m : file.messages) {
        if (m.topic != "/camera/nav/estimate") continue;
        const TrackedFrame& f = frames[k++];
        EXPECT_EQ(m.log_ns, static_cast<std::uint64_t>(f.t_ns));
        const ProtoFields fields = read_proto(m.data);
        EXPECT_EQ(text_of(fields.find(2)->second), "camera/nav");
        EXPECT_EQ(text_of(fields.find(5)->second), "measured");
        const ProtoFields pose = read_proto(fields.find(7)->second.bytes);
        const ProtoFields position = read_proto(pose.find(1)->second.bytes);
        EXPECT_EQ(number(position, 3), f.filtered.t.z);
        EXPECT_EQ(number(read_proto(pose.find(2)->second.bytes), 4), f.filtered.q.w);
        const auto& covariance = fields.find(8)->second.bytes;
        ASSERT_EQ(covariance.size(), 36 * sizeof(double));
        for (std::size_t i = 0; i < 36; ++i)
            EXPECT_EQ(std::bit_cast<double>(get_le<std::uint64_t>(covariance.data() + 8 * i)),
                      f.filtered_covariance(static_cast<int>(i / 6), static_cast<int>(i % 6)));
    }
}

TEST_F(EstimateTest, EveryFrameOfALockstepRunIsLookedAt) {
    const std::string log = folder_ / "log";
    const auto emulator = fly(6, log);
    ASSERT_NE(emulator, nullptr);
    ASSERT_NE(estimator_, nullptr);
    const auto& frames = estimator_->frames();
    ASSERT_EQ(frames.size(), camera_of(*emulator).stats().frames);
    EXPECT_EQ(emulator->observers().front()->skipped(), 0u);
    for (const TrackedFrame& f : frames) {
        ASSERT_EQ(f.state, EstimateState::measured) << f.why;
        EXPECT_LT(error_between(*f.measured, f.truth).head<3>().norm(), 5e-3);
        EXPECT_LT(error_between(f.filtered, f.truth).tail<3>().norm(), 2e-3 * norm(f.truth.t));
    }
    EXPECT_LT(error_between(frames.back().guess, frames.back().truth).head<3>().norm(),
              0.2 * error_between(frames.front().guess, frames.front().truth).head<3>().norm())
        << "the track leads on from what it knows";

    const auto rows = read_rows(log + "/nav.estimate.csv");
    ASSERT_EQ(rows.size(), frames.size());
    EXPECT_EQ(rows.back().at("state"), "measured");
    EXPECT_NEAR(std::stod(rows.back().at("z_m")), frames.back().measured->t.z, 1e-9);
    EXPECT_TRUE(std::filesystem::exists(log + "/nav.estimate.png"));
}

/// A chaser that turns at 3 deg/s beside a target that moves takes frames row by row, through a lens that distorts
/// and blurs.
TEST_F(EstimateTest, KnowsTheShutterAndTheLens) {
    Scene s = docking();
    Camera& c = s.cameras[0];
    c.shutter = Shutter{200'000};  // 48 ms from the first row to the last
    c.model = test::brown_conrady(test::pinhole_of(c), {-0.3, 0.1, 1e-3, -8e-4});
    c.optics.point_spread = PointSpreadFunction{.sigma_px = 0.7};
    Motion& chaser = s.bodies[1].initial;
    chaser.T_world_body.t = {14, 0.4, -0.3};
    chaser.velocity_m_s = {-0.1, 100.02, 0.01};
    s.bodies[0].initial.velocity_m_s = {0, 100, 0};  // both are on an orbit
    chaser.rate_rad_s = {0.01, 0.05, 0.01};
    Scene at_once = s;
    at_once.cameras[0].shutter.reset();
    const auto world = World::create(s), ignorant = World::create(at_once);
    ASSERT_TRUE(world && ignorant);
    CameraUnit unit(**world, 0);
    const auto knows = FrameTracker::create(**world, 0, {}), ignores = FrameTracker::create(**ignorant, 0, {});
    ASSERT_TRUE(knows && ignores);
    double found = 0;
    int without_shutter = 0;
    for (std::uint32_t k = 0; k < 4; ++k) {
        const FrameLedger ledger = unit.expose(k, unit.t_mid_ns(k));
        const TrackedFrame a = (*knows)->take(ledger, unit.bytes(), unit.placement());
        const TrackedFrame b = (*ignores)->take(ledger, unit.bytes(), unit.placement());
        ASSERT_TRUE(a.measured) << a.why;
        found += error_between(*a.measured, a.truth).head<3>().squaredNorm();
        // Without the shutter: refused by its name, or with a covariance that includes what the rows show.
        if (b.measured)
            EXPECT_LT(normalised_error_squared(error_between(*b.measured, b.truth), b.covariance), 50) << k;
        else if (b.why.find("a rolling shutter") != std::string::npos)
            ++without_shutter;
        if (b.measured && error_between(*b.measured, b.truth).head<3>().norm() >
                              2 * error_between(*a.measured, a.truth).head<3>().norm())
            ++without_shutter;
    }
    EXPECT_LT(found, 4 * 1e-7);
    EXPECT_GE(without_shutter, 3);
}

/// Frames are taken with the exposure and gain that their ledgers have; parts of the image give no pose.
TEST_F(EstimateTest, KnowsTheSettingsOfTheFrame) {
    Scene s = docking();
    s.cameras[0].control = CameraControlLimits{.exposure_max_ns = 10'000'000};
    const auto world = World::create(s);
    ASSERT_TRUE(world) << world.error().text();
    CameraUnit unit(**world, 0);
    TrackerOptions options;
    options.start_deg = options.start_percent = 1;
    const auto tracker = FrameTracker::create(**world, 0, options);
    ASSERT_TRUE(tracker);
    CameraSettings settings = unit.settings();
    settings.exposure_ns /= 4, settings.gain_cdb = 600;  // half as bright
    unit.set(settings, 1);
    FrameLedger ledger = unit.expose(0, 0);
    const TrackedFrame dark = (*tracker)->take(ledger, unit.bytes(), unit.placement());
    ASSERT_TRUE(dark.measured) << dark.why;
    EXPECT_LT(error_between(*dark.measured, dark.truth).head<3>().norm(), 3e-3);
    settings.binning = 2;
    unit.set(settings, 2);
    ledger = unit.expose(1, unit.t_mid_ns(1));
    const TrackedFrame binned = (*tracker)->take(ledger, unit.bytes(), unit.placement());
    EXPECT_FALSE(binned.measured);
    EXPECT_EQ(binned.state, EstimateState::predicted);
    EXPECT_EQ(binned.why, "320 x 240 pixels, binned by 2: expected the whole image, not binned");
}

/// Without a guess the first frame is searched, and the next ones follow from it.
TEST_F(EstimateTest, StartsBySearch) {
    const auto world = World::create(docking());
    ASSERT_TRUE(world) << world.error().text();
    CameraUnit unit(**world, 0);
    TrackerOptions options;
    options.search = true;
    options.range_guess_m = 50;
    const auto tracker = FrameTracker::create(**world, 0, options);
    ASSERT_TRUE(tracker);
    for (std::uint32_t k = 0; k < 2; ++k) {
        const FrameLedger ledger = unit.expose(k, unit.t_mid_ns(k));
        const TrackedFrame f = (*tracker)->take(ledger, unit.bytes(), unit.placement());
        ASSERT_TRUE(f.measured) << f.why;
        EXPECT_LT(error_between(*f.measured, f.truth).head<3>().norm(), 5e-3) << k;
        EXPECT_LT(error_between(*f.measured, f.truth).tail<3>().norm(), 0.01 * norm(f.truth.t)) << k;
        EXPECT_GT(position_sigma(f.bound), 0) << k;
    }
}

TEST_F(EstimateTest, GoesOutOnCan) {
    RunOptions o;
    o.bus = "slcan:0";
    o.lockstep = true;
    o.video = {{"nav", "none"}};
    o.observers = {estimate_from("", {}, &estimator_)};
    auto emulator = Emulator::create(docking(), o);
    ASSERT_TRUE(emulator) << emulator.error().text();
    StopFlag stop{false};
    std::thread loop([&] { EXPECT_TRUE((*emulator)->run(stop)); });

    const auto bus = open_or_fail("slcan:" + std::to_string(hub_port((*emulator)->can()->bus())), CanRole::client);
    ASSERT_NE(bus, nullptr);
    for (const PoseCommand& command : approach_commands(4)) {
        FrameSet encoded;
        ASSERT_TRUE(encode_classic(command, 0x100, encoded));
        for (const CanFrame& frame : encoded) EXPECT_TRUE(bus->send(frame));
    }
    EstimateDecoder decoder;
    std::vector<EstimateReport> reports;
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(1800);
    while (reports.size() < 3 && std::chrono::steady_clock::now() < until) {
        bus->wait(10'000'000);
        EstimateReport report;
        for (ReceivedFrame got; bus->receive(got);)
            if (decoder.accept(got.frame, 40'000'000'000, report) == DecodeStatus::complete)
                reports.push_back(report);
    }
    stop = true;
    loop.join();
    const auto& frames = estimator_->frames();
    ASSERT_GE(reports.size(), 3u);
    ASSERT_GE(frames.size(), reports.size());
    for (std::size_t i = 0; i < reports.size(); ++i) {
        EXPECT_EQ(reports[i].frame, frames[i].frame);
        EXPECT_EQ(reports[i].t_ns, frames[i].t_ns);
        EXPECT_EQ(reports[i].state, frames[i].state);
        EXPECT_LT(norm(reports[i].T_camera_target.t - frames[i].filtered.t), 1e-6);
        EXPECT_NEAR(reports[i].sigma_position_m.z, std::sqrt(frames[i].filtered_covariance(5, 5)), 1e-6);
    }
}

Done narpa_does(const std::string& arguments) {
    return run_command(NARPA_BIN " " + arguments + " 2>&1");
}

TEST_F(EstimateTest, FromOneFrameAndFromOneSweep) {
    const std::string frame = folder_ / "frame.raw", sweep = folder_ / "sweep.pcap";
    const std::string scene = kDocking, where = " --pose chaser=20,0.5,-0.4,0,0,0,1 ";
    ASSERT_EQ(narpa_does("render " + scene + where + "--spp 4 -o " + frame).status, 0);
    const Done of_frame = narpa_does("estimate " + scene + where + "--frame " + frame + " --json");
    ASSERT_EQ(of_frame.status, 0) << of_frame.out;
    const json told = json::parse(of_frame.out.substr(of_frame.out.find("\n{") + 1));
    EXPECT_LT(told["error_rotation_rad"].get<double>(), 5e-3);
    EXPECT_LT(told["error_position_m"].get<double>(), 0.05);

    const Done scanned = narpa_does("scan " + scene + where + "-o " + sweep);
    ASSERT_EQ(scanned.status, 0) << scanned.out;
    const Done of_sweep = narpa_does("estimate " + scene + where + "--sweep " + sweep + " --target station --json");
    ASSERT_EQ(of_sweep.status, 0) << of_sweep.out;
    const json cloud = json::parse(of_sweep.out.substr(of_sweep.out.find("\n{") + 1));
    EXPECT_LT(cloud["error_rotation_rad"].get<double>(), 5e-3);
    EXPECT_LT(cloud["error_position_m"].get<double>(), 0.05);
    EXPECT_EQ(cloud["unobserved"].get<int>(), 0);
}

/// As of a real camera: an image file, and poses that are a guess.
TEST_F(EstimateTest, FromAnImageWithoutTruth) {
    const std::string frame = folder_ / "frame.png", scene = kDocking;
    ASSERT_EQ(narpa_does("render " + scene + " --pose chaser=20,0.5,-0.4,0,0,0,1 --spp 16 -o " + frame).status, 0);
    const auto estimate = [&](const std::string& options) {
        const Done done = narpa_does("estimate " + scene + " --pose chaser=20.3,0.6,-0.43,0,0,0,1 --frame " +
                                     frame + " --no-truth --json " + options);
        EXPECT_EQ(done.status, 0) << done.out;
        return json::parse(done.out.substr(done.out.find("\n{") + 1));
    };
    const auto sigma_z = [](const json& told) { return std::sqrt(told["covariance"][5][5].get<double>()); };
    const json told = estimate(""), uncertain = estimate("--uncertainty scale=0.01");
    EXPECT_EQ(told["answer"]["class"], "good");
    EXPECT_EQ(told["target"], "station");
    EXPECT_LT(norm(Vec3{told["pose_in_world"]["position_m"][0], told["pose_in_world"]["position_m"][1],
                        told["pose_in_world"]["position_m"][2]} -
                   Vec3{0.3, 0.1, -0.03}),
              0.03)
        << "the station, as the guess of the chaser is off";
    EXPECT_FALSE(told.contains("truth") || told.contains("nees") || told.contains("error_position_m"));
    EXPECT_NEAR(told["pose"]["position_m"][0].get<double>(), -0.5, 0.01);
    EXPECT_NEAR(told["pose"]["position_m"][1].get<double>(), -0.4, 0.01);
    EXPECT_NEAR(told["pose"]["position_m"][2].get<double>(), 20.45, 0.05);
    EXPECT_LT(sigma_z(told), 0.02);
    EXPECT_NEAR(sigma_z(uncertain), 0.01 * 20.45, 0.02);
}

/// A model that is told to be uncertain makes the filter's covariance no smaller than that, however many frames.
TEST_F(EstimateTest, UncertaintyOfTheModelIsNotAveraged) {
    const auto world = World::create(docking());
    ASSERT_TRUE(world) << world.error().text();
    CameraUnit unit(**world, 0);
    TrackerOptions options;
    options.model.scale = 0.01;
    const auto tracker = FrameTracker::create(**world, 0, options);
    ASSERT_TRUE(tracker);
    for (std::uint32_t k = 0; k < 3; ++k) {
        const FrameLedger ledger = unit.expose(k, unit.t_mid_ns(k));
        const TrackedFrame f = (*tracker)->take(ledger, unit.bytes(), unit.placement());
        ASSERT_TRUE(f.measured) << f.why;
        EXPECT_GE(std::sqrt(f.filtered_covariance(5, 5)), 0.01 * f.measured->t.z);
        EXPECT_GE(std::sqrt(f.bound(5, 5)), 0.01 * f.measured->t.z);
    }
}

/// A frame that is known to have no noise but the detector's, and has more, is refused.
TEST_F(EstimateTest, NoiseThatIsStatedIsExpected) {
    Scene s = docking();
    s.render.spp = 16;
    const auto world = World::create(s);
    ASSERT_TRUE(world) << world.error().text();
    CameraUnit unit(**world, 0);
    const FrameLedger ledger = unit.expose(0, unit.t_mid_ns(0));
    const auto answer = [&](std::optional<double> noise_dn) {
        TrackerOptions options;
        options.method = find_camera_method("dense");
        options.frame_noise_dn = noise_dn;
        const auto tracker = FrameTracker::create(**world, 0, options);
        return (*tracker)->take(ledger, unit.bytes(), unit.placement());
    };
    const TrackedFrame known = answer(0), unknown = answer({});
    EXPECT_EQ(known.answer.kind, AnswerKind::refused) << "a frame of sixteen samples a pixel";
    EXPECT_EQ(unknown.answer.kind, AnswerKind::good) << unknown.why;
}

TEST_F(EstimateTest, ComparesAFrameWithARender) {
    const std::string frame = folder_ / "frame.png", scene = kDocking;
    ASSERT_EQ(
        narpa_does("render " + scene + " --pose chaser=20,0.5,-0.4,0,0,0,1 --spp 64 --seed 7 -o " + frame).status,
        0);
    const auto compared = [&](const std::string& y, const std::string& options = "", int status = 0) {
        const Done done = narpa_does("compare " + scene + " --pose chaser=20," + y + ",-0.4,0,0,0,1 --frame " +
                                     frame + " --json " + options);
        EXPECT_EQ(done.status, status) << done.out;
        return json::parse(done.out.substr(done.out.find("\n{") + 1));
    };
    const json right = compared("0.5", "-o " + (folder_ / "comparison.png")), aside = compared("0.6");
    EXPECT_GT(right["overlap"].get<double>(), 0.96);
    EXPECT_NEAR(right["gain"].get<double>(), 1, 0.01);
    EXPECT_GT(right["correlation"].get<double>(), 0.998);
    EXPECT_LT(right["residual_over_noise"].get<double>(), 1.5) << "the frame has sampling noise too";
    EXPECT_EQ(right["target"], "station");
    EXPECT_TRUE(std::filesystem::exists(folder_ / "comparison.json"));
    EXPECT_LT(aside["overlap"].get<double>(), 0.8);
    // The camera stands 10 cm aside: 3.8 px at 20.45 m, less for what is further off.
    EXPECT_NEAR(std::abs(aside["shift"]["x_px"].get<double>()), 3.2, 0.8);
    EXPECT_NEAR(aside["shift"]["y_px"].get<double>(), 0, 0.2);
    EXPECT_NEAR(aside["gain"].get<double>(), 1, 0.03);
    const std::string limits = "--min-overlap 0.9 --min-correlation 0.99 --max-shift 0.5";
    EXPECT_TRUE(compared("0.5", limits)["faults"].empty());
    EXPECT_EQ(compared("0.6", limits, 1)["faults"].size(), 3U);
    const Done dark = narpa_does("compare " + scene + " --pose chaser=-200,0,0,0,0,0,1 --frame " + frame);
    EXPECT_EQ(dark.status, 1) << dark.out;
    EXPECT_NE(dark.out.find("shows the target lit in 0 pixels"), std::string::npos) << dark.out;
    const Done over = narpa_does("compare " + scene + " --frame " + frame + " -o " + frame);
    EXPECT_EQ(over.status, 2) << over.out;
    EXPECT_NE(over.out.find("would be replaced, but this command reads it"), std::string::npos) << over.out;
}

TEST_F(EstimateTest, ErrorsNameTheBadInput) {
    const std::string scene = kDocking;
    const auto refuses = [](const std::string& arguments, const std::string& words) {
        const Done p = narpa_does("estimate " + arguments);
        EXPECT_EQ(p.status, 2) << p.out;
        EXPECT_NE(p.out.find(words), std::string::npos) << p.out;
    };
    std::ofstream(folder_ / "short.raw") << "four";
    refuses(scene + " --frame " + (folder_ / "short.raw"), "expected 307200");
    refuses(scene + " --frame " + (folder_ / "none.raw"), "none.raw");
    refuses(scene + " --sweep " + (folder_ / "short.raw"), "short.raw");
    refuses(scene, "--frame");
    std::ofstream(folder_ / "words.png") << "words";
    refuses(scene + " --frame " + (folder_ / "words.png"), "words.png: is no image that can be decoded");
    refuses(scene + " --frame x --uncertainty size=1", "expected NAME=VALUE with one of scale, mesh_m");
    refuses(scene + " --frame x --uncertainty scale=-1", "expected scale=NUMBER, 0 or more");
    refuses(scene + " --frame x --uncertainty scale", "expected scale=NUMBER, 0 or more");
    refuses(scene + " --frame x --uncertainty scale=1,scale=2", "scale is given twice");
    refuses(scene + " --frame x --frame-noise 1", "--frame-noise is for all pixels: expected --method dense");
    refuses(scene + " --sweep x --method dense", "--method goes with a frame, and this is a sweep");
    refuses(scene + " --frame x --range-noise 1", "--range-noise goes with a sweep, and this is a frame");
    refuses((folder_ / "") + " --no-truth", "--no-truth goes with a scene file");
    refuses((folder_ / "") + " --set render.seed=3", "made again from the scene that it was flown with");
    refuses(scene + " --frame x --target moon", "expected one of: station, chaser");
    refuses(scene + " --frame x --start 5", "expected DEG,PERCENT");
    refuses(scene + " --frame x --range-guess 20", "start by search");
    refuses(scene + " --sweep none.pcap --start search", "none.pcap: No such file");
    refuses(scene + " --sweep x --start search --range-guess 20", "not for a sweep");
    refuses(folder_ / "nowhere", "nowhere");
}

TEST(EstimateSummary, TheBandOfOneNeesHas95Percent) {
    // Distributions of chi-square with 1 to 6 degrees of freedom.
    const auto share_below = [](double x, int freedom) {
        double share = freedom % 2 == 0 ? 1 - std::exp(-x / 2) : std::erf(std::sqrt(x / 2));
        for (int f = freedom % 2 == 0 ? 2 : 1; f < freedom; f += 2)
            share -= std::pow(x / 2, 0.5 * f) * std::exp(-x / 2) / std::tgamma(0.5 * f + 1);
        return share;
    };
    for (int freedom = 1; freedom <= 6; ++freedom) {
        EXPECT_NEAR(share_below(nees_band(freedom).low, freedom), 0.025, 1e-4) << freedom;
        EXPECT_NEAR(share_below(nees_band(freedom).high, freedom), 0.975, 1e-4) << freedom;
    }
}

TEST(EstimateSummary, SaysWhereTheNeesLies) {
    const auto begins = [](double nees, const char* words) { return nees_verdict(nees, 5, 7).starts_with(words); };
    EXPECT_TRUE(begins(4.9, "below: the covariances are too cautious"));
    EXPECT_TRUE(begins(7.1, "above: the covariances are too small"));
    EXPECT_TRUE(begins(5, "inside") && begins(7, "inside"));
    EXPECT_TRUE(begins(std::numeric_limits<double>::infinity(), "not known"));
}

TEST(EstimateSummary, CoversTheFramesWithAPose) {
    std::vector<TrackedFrame> frames(3);
    for (std::size_t i = 0; i < 2; ++i) {
        TrackedFrame& f = frames[i];
        f.state = EstimateState::measured;
        f.truth.t = {0, 0, 10};
        f.measured = displaced(f.truth, (Vector6() << 0.01, 0, 0, 0, 0, 0.2).finished());
        f.filtered = *f.measured;
        f.covariance = f.bound = (Vector6() << 1e-4, 1e-4, 1e-4, 0.04, 0.04, 0.04).finished().asDiagonal();
    }
    const EstimateSummary s = summarise(frames);
    EXPECT_EQ(s.frames, 3u);
    EXPECT_EQ(s.measured, 2u);
    EXPECT_NEAR(s.rotation_rms_rad, 0.01, 1e-12);
    EXPECT_NEAR(s.position_rms_of_range, 0.02, 1e-12);
    EXPECT_NEAR(s.nees_mean, 2, 1e-9);
    EXPECT_NE(to_text(s).find("NEES 2.00, 6 expected, 95 % band 1.20 to 10.80; inside: "), std::string::npos)
        << to_text(s);
    EXPECT_NEAR(s.position_of_bound, 1 / std::sqrt(3.0), 1e-9);
    EXPECT_EQ(estimate_row(frames[2]).substr(0, 9), "0,0,lost,");
    frames[2].why = "bad, and worse";
    const auto columns = [](const std::string& text) { return std::count(text.begin(), text.end(), ','); };
    for (const TrackedFrame& f : frames) EXPECT_EQ(columns(estimate_row(f)), columns(std::string(kEstimateHeader)));
}

}  // namespace
}  // namespace narpa::test
