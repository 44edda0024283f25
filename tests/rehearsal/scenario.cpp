// Scenario files, and what follows from them.
#include "rehearsal/scenario/scenario.h"
#include "rehearsal/runner/run_folder.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/paths.h"
#include "tests/support/read_file.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

const std::string kScenarios = test::build_path("scenes/rehearsal/");

TEST(Orbit, LvlhRotatesAboutTheMomentum) {
    const Orbit orbit;
    const double quarter_s = 0.5 * 3.14159265358979323846 / orbit.rate_rad_s();
    EXPECT_NEAR(norm(orbit.q_world_frame(0) * Vec3{1, 0, 0} - orbit.up), 0, 1e-12);
    EXPECT_NEAR(norm(orbit.q_world_frame(0) * Vec3{0, 1, 0} - orbit.along), 0, 1e-12);
    EXPECT_NEAR(norm(orbit.q_world_frame(quarter_s) * Vec3{1, 0, 0} - orbit.along), 0, 1e-12);
    EXPECT_NEAR(norm(orbit.q_world_frame(quarter_s) * Vec3{0, 1, 0} + orbit.up), 0, 1e-12);
}

TEST(Scenario, NavigatesByVelocimetersThatMeasureVelocities) {
    const auto good = read_scenario(kScenarios + "docking-doppler.toml");
    ASSERT_TRUE(good) << good.error().text();
    EXPECT_EQ(good->navigation.velocimeters, std::vector<std::string>{"doppler"});
    const test::TemporaryFolder folder;
    std::ofstream(folder / "s.toml") << "[scenario]\nbased_on = \"" + kScenarios +
                                            "docking-lidar.toml\"\n[navigation]\nvelocimeters = [\"top\"]\n";
    const auto wrong = read_scenario(folder / "s.toml");
    ASSERT_FALSE(wrong);
    EXPECT_NE(wrong.error().text().find("s.toml:4:16: velocimeters: \"top\" measures no velocity"),
              std::string::npos)
        << wrong.error().text();
}

TEST(Scenario, ReadsTheDocking) {
    const auto s = read_scenario(kScenarios + "docking.toml");
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->target.can_id, 0x110u);
    EXPECT_EQ(s->chaser.can_id, 0x100u);
    ASSERT_TRUE(s->attractor);
    EXPECT_EQ(s->attractor->second, 0x120u);
    EXPECT_EQ(s->orbit.model, orbit_model("two-body"));
    EXPECT_NEAR(s->orbit.rate_rad_s(), 2 * 3.14159265358979 / 5553.6, 1e-7);
    ASSERT_EQ(s->legs.size(), 3u);
    EXPECT_TRUE(s->legs.back().contact);
    EXPECT_EQ(s->navigation.cameras, std::vector<std::string>{"nav"});
    EXPECT_EQ(s->period_ns(), 1'000'000'000);
    EXPECT_EQ(s->pose_period_ns(), 50'000'000);
    ASSERT_TRUE(s->gates.contact);
    EXPECT_EQ(s->gates.contact->lateral_m, 0.10);
    EXPECT_EQ(s->chaser.inertia_kg_m2(1, 1), 31000);
}

/// Against the flights of docs/rehearsal.md, "Measured results".
TEST(Scenario, NominalDurationIsThatOfAFlight) {
    for (const auto& [name, flown_s] : {std::pair{"docking", 209.5}, {"dispersions", 98.1}}) {
        const auto s = read_scenario(kScenarios + name + ".toml");
        ASSERT_TRUE(s) << s.error().text();
        EXPECT_NEAR(s->nominal_duration_s(), flown_s, 1.5) << name;
    }
}

TEST(Scenario, NamesAMissingScene) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "lost.toml") << "[scenario]\nname = \"lost\"\nscene = \"none.toml\"\n";
    const auto s = read_scenario(folder / "lost.toml");
    ASSERT_FALSE(s);
    EXPECT_EQ(s.error().text(),
              (folder / "lost.toml") + ":3:9: scene: " + (folder / "none.toml") + ": no such file");
}

TEST(Scenario, InheritsMissingKeys) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "over.toml") << "[scenario]\nbased_on = \"" << kScenarios << "docking.toml\"\n"
                                        << "name = \"over\"\n[control]\ndamping = 0.7\n"
                                        << "[[leg]]\nto_m = [5, 0, 0]\n[gates]\ncontact = 1\n";
    const auto wrong = read_scenario(folder / "over.toml");
    ASSERT_FALSE(wrong);
    EXPECT_EQ(wrong.error().line, 9) << wrong.error().text();

    std::ofstream(folder / "over.toml") << "[scenario]\nbased_on = \"" << kScenarios << "docking.toml\"\n"
                                        << "name = \"over\"\n[control]\ndamping = 0.7\n";
    const auto s = read_scenario(folder / "over.toml");
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->name, "over");
    EXPECT_EQ(s->scene, kScenarios + "scene.toml");
    EXPECT_EQ(s->control.damping, 0.7);
    EXPECT_EQ(s->control.bandwidth_rad_s, 0.15);
    EXPECT_EQ(s->legs.size(), 3u);
}

TEST(Scenario, OverridesReplaceItsKeysAndThoseOfItsScene) {
    const std::vector<std::string> sets{"scenario.seed=9", "camera.nav.detector.exposure_s=1e-4",
                                        "control.damping=0.6"};
    const auto s = read_scenario(kScenarios + "docking.toml", sets);
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->seed, 9u);
    EXPECT_EQ(s->control.damping, 0.6);
    EXPECT_EQ(s->scene_overrides, std::vector{sets[1]});
    const auto texts = scenario_texts(*s), plain = scenario_texts(*read_scenario(kScenarios + "docking.toml"));
    ASSERT_TRUE(texts);
    EXPECT_NE(texts->scene.find("exposure_s = 0.0001"), std::string::npos) << "the run's folder has what was flown";
    EXPECT_NE(texts->hash, plain->hash);
    for (const std::string set : {"camera.nav.detector.exposre_s=1", "control.dampng=1", "gatse.contact=1"}) {
        const auto bad = read_scenario(kScenarios + "docking.toml", std::vector{set});
        ASSERT_FALSE(bad) << set;
        EXPECT_NE(bad.error().text().find("--set " + set + ": unknown key"), std::string::npos)
            << bad.error().text();
        EXPECT_NE(bad.error().text().find("did you mean"), std::string::npos) << bad.error().text();
    }
}

TEST(Scenario, MayBeBasedOnAShippedOneByItsName) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "mine.toml") << "[scenario]\nbased_on = \"dispersions\"\nname = \"mine\"\nseed = 5\n";
    const auto s = read_scenario(folder / "mine.toml");
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->seed, 5u);
    EXPECT_EQ(s->legs.size(), 2u) << "the legs of a scenario replace those below as a whole";
    std::ofstream(folder / "wrong.toml") << "[scenario]\nname = \"wrong\"\nbased_on = \"dispersion\"\n";
    const auto wrong = read_scenario(folder / "wrong.toml");
    ASSERT_FALSE(wrong);
    EXPECT_EQ(wrong.error().file, folder / "wrong.toml");
    EXPECT_EQ(wrong.error().line, 3);
    EXPECT_NE(wrong.error().what.find("did you mean \"dispersions\""), std::string::npos) << wrong.error().what;
}

TEST(Scenario, ErrorsNameTheFileThatHasThem) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "base.toml") << test::read_text(kScenarios + "docking.toml") << "\nsurprise = 1\n";
    std::ofstream(folder / "over.toml")
        << "[scenario]\nbased_on = \"base.toml\"\nname = \"over\"\nscene = \"" << kScenarios << "scene.toml\"\n";
    const auto s = read_scenario(folder / "over.toml");
    ASSERT_FALSE(s);
    EXPECT_EQ(s.error().file, folder / "base.toml");
    std::ofstream(folder / "self.toml") << "[scenario]\nbased_on = \"self.toml\"\n";
    const auto self = read_scenario(folder / "self.toml");
    ASSERT_FALSE(self);
    EXPECT_NE(self.error().what.find("one on another"), std::string::npos);
}

TEST(Scenario, ReadsErrorsOfTheModel) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "wrong.toml")
        << "[scenario]\nbased_on = \"" << kScenarios << "docking.toml\"\nname = \"wrong\"\nscene = \"" << kScenarios
        << "scene.toml\"\n[model_error]\nscale = 0.01\nlight_deg = 2\ntold = 0.5\n";
    const auto s = read_scenario(folder / "wrong.toml");
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->model_error.error.scale, 0.01);
    EXPECT_NEAR(s->model_error.error.light_rad, 0.0349, 1e-4);
    EXPECT_EQ(s->model_error.uncertainty().scale, 0.005);
}

struct Bad {
    std::string from, to;  ///< what is changed in the docking scenario
    std::string says;
};

class BadScenario : public testing::TestWithParam<Bad> {};

TEST_P(BadScenario, IsNamedWithItsPlace) {
    const Bad& bad = GetParam();
    std::string text = test::read_text(kScenarios + "docking.toml");
    const std::size_t at = text.find(bad.from);
    ASSERT_NE(at, std::string::npos) << bad.from;
    text.replace(at, bad.from.size(), bad.to);
    const std::string scene = "\"scene.toml\"";
    if (const std::size_t named = text.find(scene); named != std::string::npos)
        text.replace(named, scene.size(), '"' + kScenarios + "scene.toml\"");
    const test::TemporaryFolder folder;
    const std::string path = folder / "bad.toml";
    std::ofstream(path) << text;
    const auto s = read_scenario(path);
    ASSERT_FALSE(s);
    EXPECT_NE(s.error().what.find(bad.says), std::string::npos) << s.error().text();
    EXPECT_EQ(s.error().file, path);
    EXPECT_GT(s.error().line, 0);
}

INSTANTIATE_TEST_SUITE_P(
    All, BadScenario,
    testing::Values(
        Bad{"duration_s = 400.0", "duration_s = 0", "expected a number"}, Bad{"name = \"docking\"", "", "name"},
        Bad{"model = \"two-body\"", "model = \"three-body\"", "expected one of \"free\""},
        Bad{"along = [1.0, 0.0, 0.0]", "along = [1.0, 0.0, 0.1]", "at right angles to `up`"},
        Bad{"up = [0.0, 0.0, 1.0]", "up = [0.0, 0.0, 0.0]", "expected a direction"},
        Bad{"body = \"station\"", "body = \"moon\"", "\"moon\" is no body of"},
        Bad{"body = \"chaser\"", "body = \"station\"", "expected another body"},
        Bad{"inertia_kg_m2 = [22000.0, 31000.0, 31000.0]", "inertia_kg_m2 = [1.0, 1.0, 3.0]", "sum of the two"},
        Bad{"position_sigma_m = [0.5, 0.4, 0.4]", "position_sigma_m = [0.5, -0.4, 0.4]", "position_sigma_m[1]"},
        Bad{"cameras = [\"nav\"]", "cameras = [\"left\"]", "\"left\" is not in"},
        Bad{"cameras = [\"nav\"]", "cameras = [\"nav\"]\ncamera_method = \"sparse\"",
            "one of \"features\", \"dense\""},
        Bad{"cameras = [\"nav\"]\nlidars = [\"top\"]", "cameras = []", "expected a camera or a LiDAR"},
        Bad{"cameras = [\"nav\"]", "cameras = [\"nav\", \"nav\"]", "has \"nav\" twice"},
        Bad{"name = \"docking\"", "name = \"../docking\"", "expected 1 to 64 letters"},
        Bad{"name = \"docking\"", "name = \"..\"", "expected no '.' in front"},
        Bad{"radius_m = 6778137.0", "radius_m = 6778.137", "it turns at 35.8 rad/s, expected at most 0.005"},
        Bad{"body = \"earth\"", "body = \"station\"", "is the target too"},
        Bad{"min_on_s = 0.02", "min_on_s = 5.0", "expected at least min_on_s of [thrusters], 5"},
        Bad{"period_s = 1.0", "period_s = 0.33", "a whole number of them"},
        Bad{"to_m = [12.0, 0.0, 0.0]", "", "`arc_deg`"},
        Bad{"hold_s = 10.0", "contact = true", "only the last leg"},
        Bad{"contact = true", "", "expected the last one to have it"},
        Bad{"half_angle_deg = 8.0", "half_angle = 8.0", "half_angle"},
        Bad{"[control]", "[[fault]]\nkind = \"thruster_off\"\naxis = \"up\"\n[control]", "no group of thrusters"},
        Bad{"[control]", "[[fault]]\nkind = \"attitude_bias\"\n[control]", "value"},
        Bad{"[control]", "[[fault]]\nkind = \"gremlin\"\n[control]", "expected one of"},
        Bad{"[control]", "[[fault]]\nkind = \"commands_lost\"\nfrom_s = 4\nuntil_s = 2\n[control]",
            "is 2, expected more than from_s, 4"},
        Bad{"[control]", "[[fault]]\nkind = \"commands_lost\"\nfrom_s = 400\n[control]",
            "expected less than duration_s of [scenario], 400"},
        Bad{"contact = {}", "contact = { closing_min_m_s = 1.0 }", "expected less than closing_max_m_s"},
        Bad{"force_n = 400.0", "force_n = \"much\"", "force_n"}));

}  // namespace
}  // namespace narpa::rehearsal
