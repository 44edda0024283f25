#include "tests/dataset/dataset_support.h"
#include "tests/support/expect_has.h"

namespace narpa::test {
namespace {

using Recipes = DatasetTest;

TEST_F(Recipes, TakeDefaultsForAllButNameAndScene) {
    const auto read = recipe("");
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(read->scene, folder_ / "balls.toml");
    EXPECT_FALSE(read->range_m || read->cone || read->phase_deg || read->albedo_factor);
    EXPECT_EQ(read->backdrops.size(), 1u);
    EXPECT_EQ(read->backdrops[0].kind, dataset::Backdrop::Kind::scene);
    EXPECT_EQ(read->outputs, (dataset::Outputs{true, true, true, false, false, true}));
}

TEST_F(Recipes, ReadEveryKey) {
    const auto read = recipe(R"(camera = "nav"
target = "ball"
attached = ["wall"]
seed = 7
set = ["render.spp=2"]
outputs = ["normals"]
[pose]
point_m = [0.1, 0.2, 0.3]
range_m = {kind = "log_uniform", between = [2.0, 8.0]}
attitude = {kind = "cone", axis = [0.0, 0.0, 2.0], half_angle_deg = 30.0, up = [1.0, 0.0, 0.0], roll_deg = {between = [-5.0, 5.0]}}
margin = -0.1
[illumination]
phase_deg = {kind = "choice", values = [10.0, 20.0]}
[exposure]
time_factor = {between = [0.5, 2.0]}
gain_factor = {between = [1.0, 1.0]}
[surface]
albedo_factor = {between = [0.5, 1.5]}
[[variant]]
name = "a"
[[variant]]
name = "b"
weight = 2.0
set = ["ambient.radiance=0"]
[[background]]
kind = "none"
[[background]]
kind = "body"
body = "moon"
weight = 3.0
[keypoints]
points_m = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
)");
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(read->target, "ball");
    EXPECT_EQ(read->seed, 7u);
    EXPECT_EQ(read->sets, std::vector<std::string>{"render.spp=2"});
    EXPECT_EQ(read->outputs, (dataset::Outputs{true, false, false, true, false, true}));
    EXPECT_EQ(read->point_m, (Vec3{0.1, 0.2, 0.3}));
    EXPECT_DOUBLE_EQ(read->range_m->at(0.5), 4.0);
    EXPECT_EQ(read->cone->axis, (Vec3{0, 0, 1}));
    EXPECT_DOUBLE_EQ(read->cone->roll_deg.at(0), -5.0);
    EXPECT_DOUBLE_EQ(read->margin, -0.1);
    EXPECT_DOUBLE_EQ(read->phase_deg->at(0.49), 10.0);
    EXPECT_DOUBLE_EQ(read->phase_deg->at(0.51), 20.0);
    EXPECT_EQ(read->variants[1].sets.size(), 1u);
    EXPECT_EQ(read->backdrops[1].body, "moon");
    EXPECT_EQ(read->keypoints_m.size(), 2u);
}

TEST_F(Recipes, ErrorsNameLineColumnAndWhatWasExpected) {
    EXPECT_HAS(refusal("sed = 3\n"), "recipe.toml:4:1: unknown key \"sed\"");
    EXPECT_HAS(refusal("[pose]\nrange_m = {between = [8.0, 2.0]}\n"), "recipe.toml:5:22: ");
    EXPECT_HAS(refusal("[pose]\nrange_m = {between = [8.0, 2.0]}\n"), "expected the lower number first");
    EXPECT_HAS(refusal("[pose]\nrange_m = {kind = \"log_uniform\", between = [0.0, 2.0]}\n"),
               "expected a number > 0");
    EXPECT_HAS(refusal("[pose]\nrange_m = {kind = \"gauss\", between = [1.0, 2.0]}\n"), "\"log_uniform\"");
    EXPECT_HAS(refusal("[pose]\nrange_m = {values = [1.0, 2.0]}\n"), "values");
    EXPECT_HAS(refusal("[pose]\nattitude = {kind = \"uniform\", axis = [1.0, 0.0, 0.0]}\n"), "axis");
    EXPECT_HAS(refusal("[illumination]\nphase_deg = {between = [0.0, 181.0]}\n"),
               "got 181, expected a number in [0, 180]");
    EXPECT_HAS(refusal("outputs = [\"masks\"]\n"),
               "expected some of \"mask\", \"depth\", \"normals\", \"radiance\"");
    EXPECT_HAS(refusal("[[background]]\nkind = \"body\"\n"), "the body that is behind the target");
    EXPECT_HAS(refusal("[[background]]\nkind = \"none\"\nbody = \"moon\"\n"), "body");
    EXPECT_HAS(refusal("[keypoints]\ncount = 3\npoints_m = [[0.0, 0.0, 0.0]]\n"), "without points_m");
    EXPECT_HAS(refusal("[[variant]]\nname = \"a\"\n[[variant]]\nname = \"a\"\n"), "\"a\"");
}

TEST_F(Recipes, SetChangesKeysOfTheRecipeAndOfTheScene) {
    const std::vector<std::string> sets{"dataset.seed=9", "sun.irradiance_w_m2=1000"};
    const auto read = recipe("", sets);
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(read->seed, 9u);
    EXPECT_EQ(read->sets, std::vector<std::string>{"sun.irradiance_w_m2=1000"});
    EXPECT_NE(read->text, recipe("")->text);
}

TEST_F(Recipes, AreCheckedAgainstTheScene) {
    const auto refused = [&](const std::string& text) {
        const auto set = dataset::SceneSet::create(*recipe(text), 1);
        return set ? "" : set.error().text();
    };
    EXPECT_HAS(refused("camera = \"nadir\"\n"), "has no camera \"nadir\", expected one of nav");
    EXPECT_HAS(refused("target = \"box\"\n"), "has no body \"box\", expected one of chaser, ball, wall, moon");
    EXPECT_HAS(refused("target = \"chaser\"\n"), "carries the camera");
    EXPECT_HAS(refused("attached = [\"ball\"]\n"), "expected another one to be attached");
    EXPECT_HAS(refused("[[background]]\nkind = \"stars\"\n"), "has no [stars]");
    EXPECT_HAS(refused("[[background]]\nkind = \"body\"\nbody = \"ball\"\n"),
               "expected another one for the background");
    EXPECT_HAS(refused("[exposure]\ngain_factor = {between = [1.0, 2.0]}\n"), "has no detector");
    EXPECT_HAS(
        refused(
            "[[variant]]\nname = \"a\"\n[[variant]]\nname = \"b\"\nset = [\"camera.nav.resolution=[32,32]\"]\n"),
        "expected the same in all images");
    EXPECT_HAS(refused("[[variant]]\nname = \"a\"\n[[variant]]\nname = \"b\"\nset = [\"sun.direction=[1,0,0]\"]\n"),
               "another direction of the Sun");
}

}  // namespace
}  // namespace narpa::test
