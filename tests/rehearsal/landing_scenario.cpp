// Scenario files of landings.
#include <gtest/gtest.h>

#include <fstream>

#include "rehearsal/scenario/scenario.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace narpa::rehearsal {
namespace {

const std::string kLandings = test::build_path("scenes/rehearsal/");

TEST(LandingScenario, ReadsTheLanding) {
    const auto s = read_scenario(kLandings + "landing.toml");
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->orbit.model, orbit_model("surface"));
    ASSERT_TRUE(s->engine);
    EXPECT_EQ(s->engine->axis(), 2);
    EXPECT_EQ(s->engine->sign(), 1);
    ASSERT_TRUE(s->gear);
    ASSERT_EQ(s->gear->feet_m.size(), 4u);
    for (const Vec3& foot : s->gear->feet_m) {
        EXPECT_EQ(foot.x, 0);
        EXPECT_NEAR(norm(foot), 1.6, 1e-12);
    }
    EXPECT_TRUE(s->legs[0].descent_s);
    EXPECT_TRUE(s->legs[1].contact);
    EXPECT_TRUE(s->gates.landing);
    EXPECT_TRUE(s->navigation.scene.ends_with("landing-map.toml"));
    EXPECT_GT(s->nominal_duration_s(), 60);
    EXPECT_LT(s->nominal_duration_s(), 80);
}

TEST(LandingScenario, AllShippedOnesAreGood) {
    for (const char* name : {"landing-camera", "landing-doppler", "landing-moon", "fails-throttle"}) {
        const auto s = read_scenario(kLandings + name + ".toml");
        EXPECT_TRUE(s) << name << ": " << s.error().text();
    }
}

TEST(LandingScenario, ErrorsSayWhatIsExpected) {
    struct Case {
        const char *text, *error;
    };
    for (const Case& c :
         {Case{"[engine]\naxis = \"+tx\"\n", "\"+tx\" is no force"},
          {"[engine]\nleast_n = 9000.0\n", "least_n: expected at most `most_n`"},
          {"[landing_gear]\nfeet = 2\n", "feet"},
          {"[orbit]\nalong = [1.0, 0.0, 0.0]\n", "along: belongs to orbits"},
          {"[orbit]\nmodel = \"two-body\"\n", "belongs to model \"surface\""},
          {"[gates]\ncontact = {}\n", "belongs to docking ports"},
          {"[navigation]\nmap = \"nothing.toml\"\n", "nothing.toml"},
          {"[navigation]\nmap = \"MAP\"\n", "has other bodies or sensors"},
          {"[[leg]]\nto_m = [0.0, 0.0, 0.0]\ndescent_s = 9.0\nspeed_m_s = 1.0\n",
           "speed_m_s: belongs to legs without"},
          {"[[leg]]\nto_m = [0.0, 0.0, 0.0]\nend_velocity_m_s = [0.0, 0.0, 0.0]\n", "belongs to `descent_s`"},
          {"[attractor]\nbody = \"ground\"\n", "the target is the attractor's ground"}}) {
        const test::TemporaryFolder folder;
        std::string text = c.text;
        if (const auto at = text.find("MAP"); at != std::string::npos)
            text.replace(at, 3, kLandings + "scene.toml");
        std::ofstream(folder / "s.toml")
            << "[scenario]\nbased_on = \"" + kLandings + "landing.toml\"\nname = \"s\"\n" + text;
        const auto s = read_scenario(folder / "s.toml");
        ASSERT_FALSE(s) << c.text;
        EXPECT_NE(s.error().text().find(c.error), std::string::npos) << c.text << s.error().text();
    }
}

TEST(LandingScenario, AThrottleNeedsAnEngine) {
    const test::TemporaryFolder folder;
    std::ofstream(folder / "s.toml") << "[scenario]\nbased_on = \"" + kLandings +
                                            "docking.toml\"\nname = \"s\"\n[[fault]]\nkind = \"throttle_stuck\"\n";
    const auto s = read_scenario(folder / "s.toml");
    ASSERT_FALSE(s);
    EXPECT_NE(s.error().text().find("there is no throttle"), std::string::npos) << s.error().text();
}

}  // namespace
}  // namespace narpa::rehearsal
