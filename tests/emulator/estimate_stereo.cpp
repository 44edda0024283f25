// Poses, depth maps and point clouds from the frames of two cameras: of a logged run, and of two files.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "emulator/camera/camera_unit.h"
#include "estimator/uncertainty/observed_error.h"
#include "renderer/camera/scene_camera.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/campaign.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"
#include "tests/support/shapes.h"
#include "tracking/stereo_tracker.h"

namespace narpa::test {
namespace {

using nlohmann::json;

const std::string kStereoScene = build_path("scenes/docking/docking-stereo.toml");

Done narpa_estimate(const std::string& arguments) {
    return run_command(kTimeLimit + std::string(NARPA_BIN " estimate ") + arguments + " 2>&1");
}
json document_of(const Done& done) {
    const auto start = done.out.find("\n{");
    return start == std::string::npos ? json() : json::parse(done.out.substr(start + 1));
}
void expect_stereo_refusal(const std::string& arguments, const std::string& words) {
    const Done refused = narpa_estimate(arguments);
    EXPECT_EQ(refused.status, 2) << refused.out;
    EXPECT_NE(refused.out.find(words), std::string::npos) << refused.out;
}

class EstimateStereo : public LoopTest {
protected:
    static std::size_t index_of(const Scene& s, const std::string& camera) {
        return static_cast<std::size_t>(std::ranges::find(s.cameras, camera, &Camera::name) - s.cameras.begin());
    }
    static Scene docking() {
        auto read = read_scene(kStereoScene);
        if (!read) ADD_FAILURE() << read.error().text();
        return *std::move(read);
    }
    /// A run in lockstep over a quarter of a second of the approach.
    void fly(Scene scene, const std::vector<std::string>& cameras) {
        RunOptions o;
        o.bus = record_approach(40'050'000'000, 40'350'000'000);
        o.lockstep = true;
        o.log_folder = log_;
        for (const std::string& camera : cameras) o.video.emplace_back(camera, "none");
        ASSERT_NE(ran(std::move(scene), o), nullptr);
    }
    const std::string log_ = folder_ / "log";
};

TEST_F(EstimateStereo, PairsOfARunGiveThePose) {
    fly(docking(), {"left", "right", "nav"});
    const std::string csv = folder_ / "pairs.csv", map = folder_ / "depth.pfm", cloud = folder_ / "cloud.csv";
    const Done done = narpa_estimate(log_ + " --stereo left,right --json --csv " + csv + " --depth-map " + map +
                                     " --cloud " + cloud + " --cloud " + (folder_ / "cloud.ply") + " --grid 8");
    ASSERT_EQ(done.status, 0) << done.out;
    const json told = document_of(done);
    EXPECT_EQ(told["cameras"], "left,right");
    EXPECT_EQ(told["method"], "stereo");
    const auto rows = read_rows(csv);
    ASSERT_GE(rows.size(), 2U);
    for (const auto& row : rows) {
        EXPECT_EQ(row.at("answer"), "good") << row.at("why");
        EXPECT_LT(std::stod(row.at("nees")), 50);
        EXPECT_LT(std::stod(row.at("error_position_m")), 0.2);
        EXPECT_LT(std::stod(row.at("error_rotation_rad")), 2 * kDegree);
        EXPECT_LE(std::stod(row.at("bound_position_m")),
                  1.01 * std::hypot(std::stod(row.at("sigma_x_m")), std::stod(row.at("sigma_y_m")),
                                    std::stod(row.at("sigma_z_m"))));
    }
    EXPECT_EQ(told["summary"]["good_beyond_six_sigma"], 0);
    // Files of each pair, by the number of the left frame.
    ASSERT_EQ(told["depth_maps"].size(), rows.size());
    const json& first = told["depth_maps"][0];
    EXPECT_EQ(first["frame"], std::stoi(rows[0].at("frame")));
    EXPECT_GT(first["points"], 100);
    EXPECT_GT(first["within_three_sigma"], 0.75);
    ASSERT_EQ(first["files"].size(), 3U);
    std::ifstream pfm(first["files"][0].get<std::string>(), std::ios::binary);
    std::string kind;
    int width = 0, height = 0;
    pfm >> kind >> width >> height;
    EXPECT_EQ(kind, "Pf");
    EXPECT_EQ(width, 640);
    EXPECT_EQ(height, 480);
    const auto points = read_rows(first["files"][1]);
    ASSERT_EQ(points.size(), first["points"]);
    for (const auto& p : points) {
        const double x = std::stod(p.at("x_m")), y = std::stod(p.at("y_m")), z = std::stod(p.at("z_m"));
        EXPECT_NEAR(std::stod(p.at("sigma_m")), std::sqrt(std::stod(p.at("zz_m2"))) * std::hypot(x, y, z) / z,
                    1e-3 * std::stod(p.at("sigma_m")));
    }
    EXPECT_NE(read_text(first["files"][2]).find("property float sigma"), std::string::npos);

    expect_stereo_refusal(log_ + " --stereo left", "--stereo left: expected the names of two cameras, LEFT,RIGHT");
    expect_stereo_refusal(log_ + " --stereo left,back", "no camera named \"back\"");
    expect_stereo_refusal(log_ + " --stereo left,left", "are one camera, expected two for stereo");
    expect_stereo_refusal(log_ + " --stereo left,right --camera nav", "--camera does not go with --stereo");
    expect_stereo_refusal(log_ + " --stereo left,right --method dense", "--method does not go with --stereo");
    expect_stereo_refusal(log_ + " --stereo left,right --cloud points.xyz", "expected .ply, .pcd or .csv");
    expect_stereo_refusal(log_ + " --cloud points.ply", "--cloud goes with --stereo LEFT,RIGHT");
    expect_stereo_refusal(log_ + " --stereo left,right --start search", "stereo starts from a guess");
}

TEST_F(EstimateStereo, CamerasThatAreNoPairAreRefused) {
    const std::string file = folder_ / "unequal.toml";
    std::ofstream(file) << "[scene]\nname = \"unequal\"\nbased_on = \"" << kStereoScene
                        << "\"\n[[camera]]\nname = \"left\"\nresolution = [64, 48]\n[[camera]]\nname = "
                           "\"right\"\nresolution = [64, 48]\nrate_hz = 7\n";
    auto scene = read_scene(file);
    ASSERT_TRUE(scene) << scene.error().text();
    fly(*std::move(scene), {"left", "right"});
    expect_stereo_refusal(log_ + " --stereo left,right", "never exposed at the same time: mid-exposures at");
    expect_stereo_refusal(log_ + " --stereo left,nav",
                          "holds no frames of camera \"nav\", expected a run with --video nav=SINK");

    const auto refused = [&](const std::function<void(Scene&)>& change, const std::string& words,
                             std::uint32_t right_frame = 0) {
        Scene s = docking();
        for (Camera& c : s.cameras) c = scaled(c, 0.25, 0.25);
        change(s);
        const auto world = World::create(s);
        ASSERT_TRUE(world) << world.error().text();
        const std::size_t l = index_of(s, "left"), r = index_of(s, "right");
        CameraUnit left(**world, l), other(**world, r);
        const FrameLedger a = left.expose(0, left.t_mid_ns(0)),
                          b = other.expose(right_frame, other.t_mid_ns(right_frame));
        const auto tracker = StereoTracker::create(**world, l, r, {});
        const std::string why = tracker
                                    ? (*tracker)->take({a, left.bytes()}, {b, other.bytes()}, left.placement()).why
                                    : tracker.error().what;
        EXPECT_NE(why.find(words), std::string::npos) << why;
    };
    refused([&](Scene& s) { s.cameras[index_of(s, "right")].mount = -1; }, "expected two on one body");
    refused(
        [&](Scene& s) {
            s.cameras[index_of(s, "right")].T_mount_camera = s.cameras[index_of(s, "left")].T_mount_camera;
        },
        "are at one place, expected a baseline");
    refused([&](Scene& s) { s.cameras[index_of(s, "right")].shutter = Shutter{100'000}; }, "has a rolling shutter");
    refused([](Scene&) {}, "expected the same time", 1);
    refused(
        [&](Scene& s) {
            s.bodies[0].initial.T_world_body.t = {0, 0, -300};
        },
        "points of the target were matched");
}

/// NEES of pairs from 12 to 40 m, the chaser turned at random. The mean of 12 is between 4.2 and 8.1 in 95 % of all
/// cases if covariances are right; these are cautious.
TEST_F(EstimateStereo, ErrorsOfRandomPairsAreWithinTheCovariance) {
    auto read = read_scene(kStereoScene);
    ASSERT_TRUE(read) << read.error().text();
    const std::size_t l = index_of(*read, "left"), r = index_of(*read, "right");
    const int pairs = trials(6, 60);
    int good = 0;
    double sum = 0, largest = 0;
    for (int k = 0; k < pairs; ++k) {
        std::mt19937_64 random(1000 + static_cast<std::uint64_t>(k));
        std::uniform_real_distribution<double> uniform(-0.25, 0.25);
        std::normal_distribution<double> normal;
        Scene s = *read;
        const double range_m = 12 * std::pow(40.0 / 12, 2 * uniform(random) + 0.5);
        const double azimuth = uniform(random), elevation = uniform(random);
        Rigid3& T = s.bodies[1].initial.T_world_body;
        T.t = range_m * Vec3{std::cos(azimuth) * std::cos(elevation), std::sin(azimuth) * std::cos(elevation),
                             std::sin(elevation)};
        const Vec3 x = -1 / range_m * T.t, y = normalized(cross(Vec3{0, 0, 1}, x));
        T.q = normalized(quat_from_columns(x, y, cross(x, y)) *
                         exp_rotation({0.2 * normal(random), 0.05 * normal(random), 0.05 * normal(random)}));
        s.render.seed = 100 + static_cast<std::uint64_t>(k);
        const auto world = World::create(s);
        ASSERT_TRUE(world) << world.error().text();
        CameraUnit left(**world, l), right(**world, r);
        const FrameLedger a = left.expose(0, left.t_mid_ns(0)), b = right.expose(0, right.t_mid_ns(0));
        TrackerOptions options;
        options.seed = 7 + static_cast<std::uint64_t>(k);
        const auto tracker = StereoTracker::create(**world, l, r, options);
        ASSERT_TRUE(tracker) << tracker.error().text();
        const TrackedFrame f = (*tracker)->take({a, left.bytes()}, {b, right.bytes()}, left.placement());
        if (f.answer.kind != AnswerKind::good) continue;
        const double nees = observed_error(*f.measured, f.covariance, f.answer, f.truth).squared;
        ++good, sum += nees, largest = std::max(largest, nees);
    }
    RecordProperty("good", good);
    RecordProperty("mean_nees", std::to_string(sum / good));
    RecordProperty("largest_nees", std::to_string(largest));
    EXPECT_GE(good, 0.85 * pairs);
    EXPECT_LT(largest, 50);
    EXPECT_GT(sum / good, 1);
    EXPECT_LT(sum / good, 8.1);
}

TEST_F(EstimateStereo, TwoFilesGiveThePose) {
    const std::string scene = kStereoScene, pose = " --pose chaser=18,1,-0.5,0,0,0,1 ";
    const std::string left = folder_ / "left.png", right = folder_ / "right.raw";
    for (const auto& [camera, file] : {std::pair{"left", left}, {"right", right}}) {
        const Done made = run_command(std::string(kTimeLimit) + NARPA_BIN " render " + scene + pose + " --camera " +
                                      camera + " -o " + file + " 2>&1");
        ASSERT_EQ(made.status, 0) << made.out;
    }
    const std::string frames = " --frame " + left + " --frame " + right;
    const Done done = narpa_estimate(scene + pose + "--stereo left,right" + frames + " --json --depth-map " +
                                     (folder_ / "depth.pfm"));
    ASSERT_EQ(done.status, 0) << done.out;
    const json told = document_of(done);
    EXPECT_EQ(told["answer"]["class"], "good");
    EXPECT_LT(told["nees"], 50);
    EXPECT_LT(told["error_position_m"], 0.2);
    EXPECT_TRUE(std::filesystem::exists(folder_ / "depth.pfm"));

    const Done guessed = narpa_estimate(scene +
                                        " --pose chaser=18.2,1.1,-0.5,0,0,0.008,0.999968 --no-truth "
                                        "--stereo left,right" +
                                        frames + " --json");
    ASSERT_EQ(guessed.status, 0) << guessed.out;
    const json there = told["pose"]["position_m"];
    const json again = document_of(guessed)["pose"]["position_m"];
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(there[i], again[i], 0.15) << i;

    expect_stereo_refusal(scene + pose + "--stereo left,right --frame " + left,
                          "--stereo with 1 --frame: expected two, of \"left\" and of \"right\"");
    expect_stereo_refusal(scene + pose + "--camera left" + frames, "one camera has one --frame");
    // The other way round: nothing is where it is looked for.
    const Done swapped =
        narpa_estimate(scene + pose + "--stereo left,right --frame " + right + " --frame " + left + " --json");
    EXPECT_EQ(swapped.status, 1) << swapped.out;
    EXPECT_EQ(document_of(swapped)["answer"]["class"], "refused");
}

}  // namespace
}  // namespace narpa::test
