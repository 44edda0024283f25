// What errors and warnings of scene files hint at: bases of numbers, likely units, meshes that the build makes.
#include <gtest/gtest.h>

#include <filesystem>

#include "renderer/keys/shipped_file.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using test::MemoryFolder;

constexpr const char* kDetectorScene = R"([ambient]
radiance = 1
[[body]]
name = "ball"
sphere = {radius_m = 1}
[[camera]]
name = "nav"
resolution = [64, 48]
fov_horizontal_deg = 20
[camera.detector]
exposure_s = 1e-4
f_number = 8
)";

Result<Scene> read_with(const std::vector<std::string>& sets, const std::string& text = kDetectorScene) {
    const MemoryFolder folder;
    return read_scene(folder.write("s.toml", text), sets);
}

TEST(MeshOfAClone, IsSaidToBeMadeByTheBuild) {
    if (!std::filesystem::exists(shipped_folder() / "docking/station.obj"))
        GTEST_SKIP() << "the meshes of scenes are not made here";
    const MemoryFolder folder;
    std::filesystem::create_directories(folder / "clone/scenes/docking");
    const auto s =
        read_scene(folder.write("clone/scenes/docking/mine.toml",
                                "[[body]]\nname = \"x\"\nmesh = \"station.obj\"\n[ambient]\nradiance = 1\n"
                                "[[camera]]\nname = \"c\"\nresolution = [8, 8]\nfov_diagonal_deg = 9\n"));
    ASSERT_FALSE(s);
    EXPECT_EQ(s.error().line, 3);
    EXPECT_NE(s.error().what.find("no such file: it is made when narpa is built; expected the scene in " +
                                  shipped_folder().string()),
              std::string::npos)
        << s.error().what;
}

TEST(IntegersInErrors, AreInTheBaseOfTheFile) {
    const auto words = [](const std::string& id) {
        const auto s =
            read_with({}, "[[body]]\nname = \"x\"\nsphere = {radius_m = 1}\ncan_id = " + id +
                              "\n[ambient]\nradiance = 1\n[[camera]]\nname = \"c\"\nresolution = [8, 8]\n"
                              "fov_diagonal_deg = 9\n");
        return s ? std::string() : s.error().what;
    };
    EXPECT_EQ(words("0x600"), "can_id: got 0x600, expected an integer in [0x0, 0x5f0]");
    EXPECT_EQ(words("1536"), "can_id: got 1536, expected an integer in [0, 1520]");
    EXPECT_EQ(words("0o3000"), "can_id: got 0o3000, expected an integer in [0o0, 0o2760]");
    EXPECT_EQ(words("0b11000000000"), "can_id: got 0b11000000000, expected an integer in [0b0, 0b10111110000]");
    EXPECT_EQ(words("-1"), "can_id: got -1, expected an integer in [0, 1520]");
    EXPECT_EQ(words("\"a\""), "can_id: got a text, expected an integer in [0, 1520]");
}

TEST(DoubtfulUnits, AreNamedWithTheLikelyOne) {
    const auto warnings = [](const std::string& key) {
        const auto s = read_with({"camera.nav.rate_hz=0.001", "camera.nav." + key});
        EXPECT_TRUE(s) << s.error().text();
        return s->warnings;
    };
    for (const auto& [key, words] : {
             std::pair{"detector.pixel_pitch_m=5.5",
                       "camera nav: pixel_pitch_m = 5.5 is unusual, expected pixels of 0.2 um "
                       "to 0.5 mm; if it is in micrometres, write 5.5e-06"},
             {"detector.pixel_pitch_m=0.0055", "if it is in millimetres, write 5.5e-06"},
             {"detector.exposure_s=1e-9", "exposure_s = 1e-09 is unusual, expected 10 ns to a day"},
             {"detector.full_well_e=20", "if it is in thousands of electrons, write 20000"},
             {"detector.f_number=0.125", "f_number = 0.125 is unusual, expected 0.5 to 1000"},
             {"lens={aperture_diameter_m = 25.0, focus_distance_m = 10.0}", "if it is in millimetres, write 0.025"},
         }) {
        const auto all = warnings(key);
        ASSERT_EQ(all.size(), 1u) << key;
        EXPECT_NE(all[0].find(words), std::string::npos) << all[0];
    }
    for (const char* usual : {"detector.pixel_pitch_m=1e-6", "detector.pixel_pitch_m=5e-5",
                              "detector.exposure_s=900", "detector.full_well_e=1500", "detector.f_number=40"})
        EXPECT_TRUE(warnings(usual).empty()) << usual;
}

}  // namespace
}  // namespace narpa
