// Keys by the names that other tools give them.
#include <gtest/gtest.h>

#include "renderer/keys/other_names.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

/// What is said of the key in each table that a scene may have.
std::string said_of(std::string_view key, const test::MemoryFolder& folder) {
    const std::string camera = "[[camera]]\nname = \"c\"\nresolution = [64, 48]\nfov_diagonal_deg = 30\n";
    const std::string line = std::string(key) + " = 1\n";
    std::string all;
    for (const std::string& text :
         {line, "[sun]\ndirection = [1, 0, 0]\n" + line, "[render]\n" + line, "[[body]]\nname = \"b\"\n" + line,
          "[[body]]\nname = \"b\"\n[body.sphere]\n" + line, "[[body]]\nname = \"b\"\n[body.ellipsoid]\n" + line,
          "[[body]]\nname = \"b\"\n[body.material]\n" + line,
          "[[body]]\nname = \"b\"\n[body.material.texture]\n" + line,
          "[[light]]\nname = \"l\"\nkind = \"rectangle\"\n" + line, camera + line,
          camera + "[camera.detector]\n" + line, camera + "[camera.lens]\n" + line}) {
        const auto scene = read_scene(folder.write("scene.toml", text));
        if (!scene) all += scene.error().what + "\n";
    }
    return all;
}

TEST(OtherNames, EachStandsForKeysThatSomeTableHas) {
    const test::MemoryFolder folder;
    for (const OtherName& other : other_names()) {
        const std::string said = said_of(other.name, folder);
        EXPECT_NE(said.find("unknown key \"" + std::string(other.name) + "\""), said.npos) << said;
        std::string hints;
        for (std::size_t at = 0; (at = said.find("; did you mean", at)) != said.npos; ++at)
            hints += said.substr(at, said.find('\n', at) - at);
        for (const std::string_view key : other.keys)
            EXPECT_NE(hints.find("\"" + std::string(key) + "\""), hints.npos)
                << other.name << " for " << key << ": " << said;
    }
}

TEST(OtherNames, DoNotDependOnCapitalsAndUnderscores) {
    const std::vector<std::string> known{"rate_hz", "exposure_s"};
    for (const char* name : {"FrameRate", "frame_rate", "frame-rate"})
        EXPECT_EQ(key_meant(name, known), "; did you mean \"rate_hz\"?") << name;
    EXPECT_EQ(key_meant("exposure_time", known), "; did you mean \"exposure_s\"?");
    EXPECT_EQ(key_meant("rate_ha", known), "; did you mean \"rate_hz\"?") << "and misspelt ones are found";
    EXPECT_EQ(key_meant("width", known), "") << "a key that the table does not have is not named";
}

}  // namespace
}  // namespace narpa
