/// tests/dataset/dataset_support.h - a small scene with recipes.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <string_view>

#include "dataset/scene/scene_set.h"
#include "tests/support/temporary_folder.h"

namespace narpa::test {

/// A ball of 1 m, a wall, a moon behind, and a camera on a small craft.
inline constexpr std::string_view kDatasetScene = R"([scene]
name = "balls"
[sun]
direction = [0.3, -0.8, -0.6]
[ambient]
radiance = 3.0
[[body]]
name = "chaser"
sphere = {radius_m = 0.02}
position_m = [0.0, -20.0, 0.0]
[[body]]
name = "ball"
sphere = {radius_m = 1.0}
position_m = [5.0, 2.0, -3.0]
material = {kind = "lambert", albedo = 0.5}
[[body]]
name = "wall"
ellipsoid = {semi_axes_m = [0.2, 3.0, 3.0]}
position_m = [8.0, 2.0, -3.0]
[[body]]
name = "moon"
sphere = {radius_m = 100.0}
position_m = [0.0, 1000.0, 0.0]
[[camera]]
name = "nav"
mount = "chaser"
position_m = [0.03, 0.0, 0.05]
resolution = [64, 48]
fov_horizontal_deg = 40.0
format = "GREY"
)";

class DatasetTest : public testing::Test {
protected:
    /// A recipe of the scene: `text` comes after `scene = ...` of [dataset].
    Result<dataset::Recipe> recipe(const std::string& text, std::span<const std::string> sets = {}) {
        folder_.write("balls.toml", kDatasetScene);
        return dataset::read_recipe(
            folder_.write("recipe.toml", "[dataset]\nname = \"r\"\nscene = \"balls.toml\"\n" + text), sets);
    }
    /// What is wrong with it.
    std::string refusal(const std::string& text) {
        const auto read = recipe(text);
        return read ? "" : read.error().text();
    }
    std::unique_ptr<dataset::SceneSet> scenes(const std::string& text) {
        const auto read = recipe(text);
        EXPECT_TRUE(read) << read.error().text();
        auto set = dataset::SceneSet::create(*read, 1);
        EXPECT_TRUE(set) << set.error().text();
        return *std::move(set);
    }

    TemporaryFolder folder_;
};

}  // namespace narpa::test
