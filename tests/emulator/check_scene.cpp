// What `narpa check` reports of a scene's light and materials: the program itself is run.
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "renderer/scene_file/scene_file.h"
#include "tests/emulator/loop_support.h"
#include "tests/support/command.h"
#include "tests/support/paths.h"

namespace narpa::test {
namespace {

Done run_check(const std::string& arguments) {
    return run_command(std::string(kTimeLimit) + NARPA_BIN + " check " + arguments);
}

const std::string kComplete = test::source_path("tests/data/scenes/complete.toml");

TEST(UseMethod, RefusesWhatKeepsNoEnergyAndWarnsOfWhatIsDark) {
    Scene s;
    s.materials = {{.name = "old", .kind = &kinds::phong_classic}};
    EXPECT_FALSE(use_method(s, RenderSettings::Method::path));
    s.materials = {{.name = "pane", .kind = &kinds::dielectric}};
    EXPECT_TRUE(use_method(s, RenderSettings::Method::direct));
    EXPECT_EQ(s.warnings.size(), 1u);
    EXPECT_TRUE(use_method(s, RenderSettings::Method::path));
    EXPECT_TRUE(s.warnings.empty());
}

TEST(Check, ReportsLightsMethodAndMaterialsByKind) {
    const Done said = run_check(std::string(kComplete) + " 2>&1 >/dev/null");
    EXPECT_EQ(said.status, 0) << said.out;
    for (const char* words :
         {"render: path tracing over at most 12 surfaces, 4 samples per pixel\n",
          "materials: 1 akimov, 1 dielectric, 1 ggx, 1 hapke, 2 lambert, 1 lommel_seeliger, 1 lunar_lambert, 1 "
          "mirror, 2 "
          "phong\n",
          "light beacon: point on body target\n", "light earthshine: directional\n",
          "light floodlight: disc of radius 0.05 m on body chaser\n", "light panel: rectangle of 1 x 0.5 m\n",
          "camera overview: 500 x 500 RGB24 at 2.5 Hz, with a lens\n", "stars: 4\n",
          "camera overview: 0 stars in its view at time 0\n"})
        EXPECT_NE(said.out.find(words), std::string::npos) << words << "in\n" << said.out;
}

TEST(Check, JsonHasTheSame) {
    const Done said = run_check(std::string("--json ") + kComplete + " 2>/dev/null");
    ASSERT_EQ(said.status, 0) << said.out;
    const nlohmann::json scene = nlohmann::json::parse(said.out).at("scene");
    EXPECT_EQ(scene.at("render"), (nlohmann::json{{"method", "path"}, {"spp", 4}, {"max_depth", 12}}));
    EXPECT_EQ(scene.at("material_kinds").at("phong"), 2);
    EXPECT_EQ(scene.at("lights").size(), 4u);
    EXPECT_EQ(scene.at("stars"), 4);
    EXPECT_EQ(scene.at("lights")[2], (nlohmann::json{{"name", "floodlight"}, {"kind", "disc"}}));
    EXPECT_EQ(scene.at("bodies")[3].at("ellipsoid_semi_axes_m"), (nlohmann::json{13000.0, 11400.0, 9100.0}));
    EXPECT_EQ(scene.at("cameras")[0].at("lens"), true);
}

TEST(Check, ReportsTheBudget) {
    const TemporaryFolder folder;
    const std::string file = folder / "s.toml";
    std::ofstream(file) << with_render(small_scene(), "budget_ms = 60");
    EXPECT_NE(run_check(file + " 2>&1 >/dev/null")
                  .out.find("render: direct light, 60 ms from the end of an exposure to the hand-over\n"),
              std::string::npos);
    std::ofstream(file) << with_render(small_scene(), "budget_rays = 100000");
    EXPECT_NE(
        run_check(file + " 2>&1 >/dev/null").out.find("render: direct light, at most 100000 rays per frame\n"),
        std::string::npos);
    EXPECT_EQ(nlohmann::json::parse(run_check("--json " + file + " 2>/dev/null").out).at("scene").at("render"),
              (nlohmann::json{{"method", "direct"}, {"budget_rays", 100'000}}));
}

TEST(Check, WarnsOfMirrorsInDirectLight) {
    const TemporaryFolder folder;
    std::ofstream(folder / "s.toml")
        << small_scene() + "[[body]]\nname = \"ball\"\nsphere = {radius_m = 1}\nmaterial = {kind = \"mirror\"}\n";
    const Done said = run_check((folder / "s.toml") + " 2>&1 >/dev/null");
    EXPECT_EQ(said.status, 0);
    EXPECT_NE(said.out.find("warning: black in direct light: \"ball\" (mirror); method = \"path\""),
              std::string::npos)
        << said.out;
    EXPECT_NE(said.out.find("render: direct light, 2 samples per pixel\n"), std::string::npos) << said.out;
}

}  // namespace
}  // namespace narpa::test
