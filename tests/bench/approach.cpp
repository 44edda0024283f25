// The approach bench: results on the docking scene and on a model of the ISS before the Earth at the edge of
// eclipse, and its plots.
#include "bench/estimation/approach.h"
#include "base/constants.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "estimator/view/measured_image.h"
#include "plot/plot.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace narpa::test {
namespace {

const std::string kIss = test::source_path("../shared/assets/spacecraft/iss/iss.obj");

Result<std::unique_ptr<World>> small_world(const std::string& path, int factor) {
    auto scene = read_scene(path);
    if (!scene) return scene.error();
    scene->cameras[0] = coarser_camera(scene->cameras[0], factor);
    return World::create(*std::move(scene));
}

Result<std::vector<ApproachRun>> run(const World& world, const ApproachOptions& options) {
    TracingThreads threads(0);
    const StopFlag stop{false};
    return run_approach(
        world, 0, 0, options, threads, [](const std::string&) {}, stop);
}

TEST(BenchApproach, FindsTheDockingStationAtAllRanges) {
    const auto world = small_world(test::build_path("scenes/docking/docking.toml"), 2);
    ASSERT_TRUE(world) << world.error().text();
    ApproachOptions options;
    options.methods = camera_methods().first(1);
    options.frames = 6;
    options.from_m = 60, options.to_m = 2;
    options.basin = {3};
    options.basin_trials = 2;
    const auto runs = run(**world, options);
    ASSERT_TRUE(runs) << runs.error().text();
    ASSERT_EQ(runs->size(), 1u);
    const ApproachRun& features = runs->front();
    ASSERT_EQ(features.frames.size(), 6u);
    const ApproachBand& all = features.bands.back();
    EXPECT_EQ(all.frames, 6);
    EXPECT_GE(all.found, 5);
    EXPECT_LT(all.rotation_rms_rad, 0.1 * kRadPerDeg);
    EXPECT_EQ(features.basin.front().trials, 2);
    EXPECT_NEAR(features.frames.front().range_m, 60, 6);
    EXPECT_NEAR(features.frames.back().range_m, 2, 0.2);

    TemporaryFolder folder;
    const std::string plot = folder / "approach.png", frames = folder / "frames.png";
    EXPECT_TRUE(write_plot(plot, {{"plot", "approach"}, {"title", "approach"}, {"runs", to_json(*runs)}}));
    EXPECT_GT(std::filesystem::file_size(plot), 5000u);
    TracingThreads threads(0);
    EXPECT_TRUE(plot_approach_frames(frames, **world, 0, 0, options, threads));
    EXPECT_GT(std::filesystem::file_size(frames), 20000u);
    EXPECT_EQ(to_json(*runs)[0]["bands"].back()["found"], all.found);
    EXPECT_NE(to_text(*runs).find("features"), std::string::npos);
}

TEST(BenchApproach, FindsTheIssBeforeTheEarthAtTheEdgeOfEclipse) {
    if (!std::filesystem::exists(kIss)) GTEST_SKIP() << "no station beside the project: ../shared/assets";
    TemporaryFolder folder;
    const std::string path = folder / "iss.toml";
    std::ofstream(path)
        << "[scene]\nname = \"iss\"\n[sun]\ndirection = [0.93, 0.10, -0.34]\nirradiance_w_m2 = 450\n"
           "[ambient]\nradiance = 6.0\n[[body]]\nname = \"iss\"\nmesh = \""
        << kIss
        << "\"\n[[body]]\nname = \"earth\"\nsphere = {radius_m = 6378137}\nposition_m = [0, -6798137, "
           "0]\nmaterial = {kind = \"lambert\", albedo = [0.25, 0.28, 0.33]}\n[[camera]]\nname = "
           "\"nav\"\nposition_m = [0, 300, 0]\nattitude_wxyz = [0.7071067811865476, "
           "0.7071067811865476, 0, 0]\nresolution = [320, 240]\nfov_horizontal_deg = 30\nrate_hz = "
           "10\nformat = \"GREY\"\n[camera.detector]\nexposure_s = 500e-6\nf_number = 8\n"
           "pixel_pitch_m = 5.5e-6\nquantum_efficiency = 0.6\nfull_well_e = 13500\nread_noise_e = 13\n"
           "shot_noise = true\nblack_level_dn = 64\nbits = 12\n[render]\nspp = 4\nseed = 1\n";
    const auto world = small_world(path, 1);
    ASSERT_TRUE(world) << world.error().text();
    ApproachOptions options;
    options.methods = camera_methods().first(1);
    options.frames = 3;
    options.from_m = 350, options.to_m = 200;
    options.along = {0, 1, 0}, options.up = {0, 0, 1};
    options.start_deg = options.start_percent = 2;
    options.frame_spp = 4;
    options.basin.clear();
    const auto runs = run(**world, options);
    ASSERT_TRUE(runs) << runs.error().text();
    const ApproachBand& all = runs->front().bands.back();
    EXPECT_GE(all.found, 2);
    EXPECT_LT(all.rotation_rms_rad, 0.3 * kRadPerDeg);
}

}  // namespace
}  // namespace narpa::test
