// Values of `--set`, and scenes that are based on others.
#include <gtest/gtest.h>

#include <filesystem>

#include "renderer/keys/shipped_file.h"
#include "renderer/keys/toml_override.h"
#include "renderer/scene_file/scene_file.h"
#include "renderer/scene_file/scene_inputs.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using test::MemoryFolder;

constexpr const char* kTwoCameras = R"([sun]
direction = [1, 0, 0]
[[body]]
name = "ball.v1"
sphere = {radius_m = 1}
[[camera]]
name = "nav"
position_m = [0, -9, 0]
resolution = [64, 48]
fov_horizontal_deg = 20
[camera.detector]
exposure_s = 1e-4
f_number = 8
[[camera]]
name = "wide"
resolution = [32, 24]
fov_horizontal_deg = 60
)";

Result<Scene> with(const std::vector<std::string>& sets, const std::string& text = kTwoCameras) {
    const MemoryFolder folder;
    return read_scene(folder.write("s.toml", text), sets);
}

TEST(SceneOverrides, ReplaceSingleKeys) {
    const auto s = with({"camera.nav.detector.exposure_s=2e-3", "camera.wide.resolution=[16, 12]",
                         "body.ball.v1.material.albedo=0.25", "body.ball.v1.material.kind=lambert",
                         "render.method=path", "scene.epoch=2026-03-01T12:00:00", "sun.irradiance_w_m2=1000",
                         "camera.wide.format=\"RGB24\"", "camera.nav.detector.shot_noise=true"});
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->cameras[0].detector->exposure_s, 2e-3);
    EXPECT_EQ(s->cameras[0].detector->f_number, 8) << "what is not set stays";
    EXPECT_TRUE(s->cameras[0].detector->shot_noise);
    EXPECT_FALSE(s->cameras[1].detector);
    EXPECT_EQ(s->cameras[1].width, 16);
    EXPECT_EQ(s->cameras[1].format, PixelFormat::rgb24);
    EXPECT_EQ(s->materials.at(0).diffuse.x, 0.25f) << "in a table that the file lacks; the name has a dot";
    EXPECT_EQ(s->render.method, RenderSettings::Method::path);
    EXPECT_EQ(s->epoch_unix_ns, 1'772'366'400'000'000'000);
    EXPECT_EQ(s->sun->irradiance_w_m2, 1000);
    EXPECT_EQ(s->overrides.size(), 9u);
}

TEST(SceneOverrides, LaterOnesWin) {
    const auto s = with({"camera.nav.detector.exposure_s=1e-3", "camera.nav.detector.exposure_s=3e-3"});
    ASSERT_TRUE(s);
    EXPECT_EQ(s->cameras[0].detector->exposure_s, 3e-3);
}

struct BadSet {
    std::string set, words;
};

TEST(SceneOverrides, ErrorsNameTheOptionAndTheNearestKey) {
    for (const auto& [set, words] : {
             BadSet{"camera.nav.detector.exposre_s=1",
                    "unknown key \"exposre_s\" in [detector]; did you mean \"exposure_s\"?"},
             {"camra.nav.rate_hz=1", "unknown key \"camra\" in the file; did you mean \"camera\"?"},
             {"camera.nab.rate_hz=1",
              "there is no [[camera]] \"nab\", expected one of nav, wide; did you mean \"nav\"?"},
             {"lidar.top.rate_hz=1", "there is no [[lidar]]"},
             {"camera.nav.rate_hz.x=1", "\"rate_hz\" in [[camera]] has no keys of its own"},
             {"camera.nav=1", "\"camera\" is a table, expected camera.NAME.KEY=VALUE"},
             {"scene.based_on=other.toml", "\"based_on\" belongs in the file"},
             {"sun=1", "\"sun\" is a table, expected sun.KEY=VALUE"},
             {"camera.nav.rate_hz", "expected KEY=VALUE"},
             {"camera.nav.rate_hz=", "expected KEY=VALUE"},
             {"camera.nav.rate_hz=fast", "rate_hz: got a text, expected a number in [0.001, 10000]"},
             {"camera.nav.rate_hz=0", "rate_hz: got 0, expected a number in [0.001, 10000]"},
             {"camera.nav.resolution=640", "expected [width, height] in pixels"},
             {"camera.nav.format=GRAY", "expected one of \"GREY\""},
             {"camera.nav.rate_hz=1,2", "2 values, expected one"},
             {"camera.nav.rate_hz=1\nx = 2", "rate_hz: got a text"},
             {"camera.nav.name=", "expected KEY=VALUE"},
             {"camera.nav.rate_hz=" + std::string(200, '['), "more than 32 arrays"},
         }) {
        const auto s = with({set});
        ASSERT_FALSE(s) << set;
        EXPECT_EQ(s.error().file, "--set " + set);
        EXPECT_EQ(s.error().line, 0) << "an option has no lines";
        EXPECT_NE(s.error().what.find(words), std::string::npos) << set << ": " << s.error().what;
        EXPECT_EQ(s.error().kind, ErrorKind::bad_input);
    }
}

TEST(SceneOverrides, AreSplitAtCommasOutsideOfBrackets) {
    const auto values = values_of_override("a.b=[1, 2],\"x,y\",{c = 1, d = 2},3");
    ASSERT_TRUE(values);
    EXPECT_EQ(*values, (std::vector<std::string>{"a.b=[1, 2]", "a.b=\"x,y\"", "a.b={c = 1, d = 2}", "a.b=3"}));
    EXPECT_FALSE(values_of_override("a.b=1,,2"));
    EXPECT_FALSE(values_of_override("=1"));
}

TEST(BasedOn, ListsAreMergedByName) {
    const MemoryFolder folder;
    folder.write("base.toml", kTwoCameras);
    const auto s = read_scene(folder.write("over.toml", R"([scene]
based_on = "base.toml"
[[camera]]
name = "rear"
resolution = [8, 8]
fov_horizontal_deg = 30
[[camera]]
name = "nav"
[camera.detector]
exposure_s = 5e-4
)"));
    ASSERT_TRUE(s) << s.error().text();
    ASSERT_EQ(s->cameras.size(), 3u);
    EXPECT_EQ(s->cameras[0].name, "nav") << "in the order of the file below";
    EXPECT_EQ(s->cameras[0].detector->exposure_s, 5e-4);
    EXPECT_EQ(s->cameras[0].detector->f_number, 8);
    EXPECT_EQ(s->cameras[0].width, 64);
    EXPECT_EQ(s->cameras[1].name, "wide");
    EXPECT_EQ(s->cameras[2].name, "rear") << "new ones last";
    EXPECT_EQ(s->bodies.size(), 1u);
}

TEST(BasedOn, ReplacesTakesAListAsAWhole) {
    const MemoryFolder folder;
    folder.write("base.toml", kTwoCameras);
    const std::string rear = "[[camera]]\nname = \"rear\"\nresolution = [8, 8]\nfov_horizontal_deg = 30\n";
    const std::string head = "[scene]\nbased_on = \"base.toml\"\n";
    const auto s = read_scene(folder.write("over.toml", head + "replaces = [\"camera\"]\n" + rear));
    ASSERT_TRUE(s) << s.error().text();
    ASSERT_EQ(s->cameras.size(), 1u);
    EXPECT_EQ(s->cameras[0].name, "rear");
    const auto third = read_scene(folder.write("third.toml",
                                               "[scene]\nbased_on = \"over.toml\"\n[[camera]]\nname = \"far\"\n"
                                               "resolution = [8, 8]\nfov_horizontal_deg = 3\n"));
    ASSERT_TRUE(third) << third.error().text();
    EXPECT_EQ(third->cameras.size(), 2u) << "what a file replaces is no matter of those based on it";
    for (const auto& [replaces, column] : {std::pair{"[\"lidar\"]", 13}, {"[\"sun\"]", 13}, {"\"camera\"", 12}}) {
        const auto bad = read_scene(folder.write("bad.toml", head + "replaces = " + replaces + "\n" + rear));
        ASSERT_FALSE(bad);
        EXPECT_EQ(bad.error().line, 3) << bad.error().text();
        EXPECT_EQ(bad.error().column, column) << bad.error().text();
    }
    const auto alone = read_scene(folder.write("alone.toml", "[scene]\nreplaces = [\"camera\"]\n" + rear));
    ASSERT_FALSE(alone);
    EXPECT_NE(alone.error().what.find("belongs to based_on"), std::string::npos);
}

TEST(BasedOn, PathsAreRelativeToTheFileThatNamesThem) {
    const MemoryFolder folder;
    std::filesystem::create_directories(folder / "parts");
    folder.write("parts/t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    folder.write("parts/base.toml",
                 "[ambient]\nradiance = 1\n[[body]]\nname = \"t\"\nmesh = \"t.obj\"\n"
                 "[[camera]]\nname = \"c\"\nresolution = [8, 8]\nfov_horizontal_deg = 9\n");
    const auto s = read_scene(folder.write("over.toml", "[scene]\nbased_on = \"parts/base.toml\"\n"));
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->meshes.size(), 1u);
    const auto files = files_of(*s);
    EXPECT_EQ(files.size(), 3u) << "itself, the file below and its mesh";
}

TEST(BasedOn, TakesTheNameOfAShippedScene) {
    if (!find_shipped(FileKind::scene, "cornell")) GTEST_SKIP() << "no scenes lie beside the test";
    const MemoryFolder folder;
    const auto s = read_scene(folder.write("mine.toml", "[scene]\nbased_on = \"cornell\"\n[render]\nspp = 7\n"));
    ASSERT_TRUE(s) << s.error().text();
    EXPECT_EQ(s->render.spp, 7);
    EXPECT_FALSE(s->meshes.empty());
    const auto wrong = read_scene(folder.write("wrong.toml", "[scene]\nname = \"x\"\nbased_on = \"cornel\"\n"));
    ASSERT_FALSE(wrong);
    EXPECT_EQ(wrong.error().file, folder / "wrong.toml");
    EXPECT_EQ(wrong.error().line, 3);
    EXPECT_EQ(wrong.error().column, 12);
    EXPECT_NE(wrong.error().what.find("did you mean \"cornell\"?"), std::string::npos) << wrong.error().what;
}

TEST(BasedOn, AMissingFileIsNamedWithItsPlace) {
    const MemoryFolder folder;
    const auto s = read_scene(folder.write("s.toml", "[scene]\nbased_on = \"none.toml\"\n"));
    ASSERT_FALSE(s);
    EXPECT_EQ(s.error().text(),
              (folder / "s.toml") + ":2:12: based_on: " + (folder / "none.toml") + ": no such file");
}

}  // namespace
}  // namespace narpa
