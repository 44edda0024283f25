#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>

#include "base/constants.h"
#include "base/write_file.h"
#include "dataset/folder/dataset_folder.h"
#include "dataset/gather/annotations.h"
#include "dataset/gather/statistics.h"
#include "dataset/image/run_length.h"
#include "dataset/image/visibility.h"
#include "dataset/scene/keypoints.h"
#include "dataset/verify/verify.h"
#include "tests/dataset/dataset_support.h"
#include "tests/support/expect_has.h"

namespace narpa::test {
namespace {

using namespace dataset;
using nlohmann::json;

/// Reads the text as run_length.h describes it.
std::vector<std::uint32_t> decoded(const std::string& text) {
    std::vector<std::uint32_t> runs;
    for (std::size_t at = 0; at < text.size();) {
        std::int64_t number = 0;
        int bits = 0;
        std::int64_t group = 0;
        do {
            group = text[at++] - 48;
            number |= (group & 31) << bits;
            bits += 5;
        } while ((group & 32) != 0);
        if ((group & 16) != 0) number -= std::int64_t{1} << bits;
        runs.push_back(static_cast<std::uint32_t>(number + (runs.size() > 2 ? runs[runs.size() - 2] : 0)));
    }
    return runs;
}

TEST(RunLength, GoesDownColumnsAndStartsOutside) {
    const std::vector<std::int32_t> mask{7, 0, 0,  //
                                         7, 7, 1};
    EXPECT_EQ(runs_of(mask, 3, 2, 7), (std::vector<std::uint32_t>{0, 2, 1, 1, 2}));
    EXPECT_EQ(runs_of(mask, 3, 2, 1), (std::vector<std::uint32_t>{5, 1}));
    EXPECT_EQ(runs_of(mask, 3, 2, 9), (std::vector<std::uint32_t>{6}));
}

TEST(RunLength, TextHoldsAllNumbers) {
    // 0 is "0"; 5 and 1 need one group; 40 = 8 + 32: "X1"; the fourth number is stored as 1 - 40 = -39, "iN".
    EXPECT_EQ(run_length_text(std::vector<std::uint32_t>{0, 40, 1, 1}), "0X11iN");
    std::vector<std::uint32_t> runs;
    for (std::uint32_t i = 0; i < 2000; ++i) runs.push_back(i % 7 == 0 ? 1u << (i % 29) : i * 37 % 1013);
    EXPECT_EQ(decoded(run_length_text(runs)), runs);
}

TEST(Shards, DivideTheImages) {
    std::multiset<std::uint32_t> images;
    for (const char* text : {"1/3", "2/3", "3/3"})
        for (std::uint32_t i = 0; i < 100; ++i)
            if (shard_from(text)->has(i)) images.insert(i);
    EXPECT_EQ(images.size(), 100u);
    EXPECT_EQ(std::set<std::uint32_t>(images.begin(), images.end()).size(), 100u);
    for (const char* text : {"0/3", "4/3", "1", "1/", "/3", "a/b", "1/3x", "-1/3", ""}) {
        const auto shard = shard_from(text);
        ASSERT_FALSE(shard) << text;
        EXPECT_HAS(shard.error().text(), "expected K/M with 1 <= K <= M");
    }
}

TEST(Shards, AreListedWhereTheyHaveAnItem) {
    const std::vector<Shard> shards = shards_with({1, 9, 4, 5}, 4);
    std::vector<std::string> texts;
    for (const Shard& s : shards) texts.push_back(s.text());
    EXPECT_EQ(texts, (std::vector<std::string>{"1/4", "2/4"}));
    EXPECT_TRUE(shards_with({}, 4).empty());
    EXPECT_EQ(shards_with({0, 1, 2}, 1).size(), 1u);
}

TEST(DatasetFolders, KnowWhatIsMissing) {
    const TemporaryFolder folder;
    const std::string path = folder / "set";
    const Manifest manifest{6, {true, true, false, false, false, true}, "recipe", "abc"};
    ASSERT_TRUE(open_dataset(path, manifest));
    const auto put = [&](std::size_t output, std::uint32_t image) {
        ASSERT_TRUE(write_whole_text(path + "/" + image_file(output, image), "x"));
    };
    for (const std::uint32_t image : {0u, 3u, 4u})
        for (const std::size_t output : {kImageOutput, kMaskOutput, kLabelOutput}) put(output, image);
    put(kLabelOutput, 1);  // without its image and mask
    put(kImageOutput, 7);  // beyond the data set
    EXPECT_EQ(plan_shard(path, {})->missing, (std::vector<std::uint32_t>{1, 2, 5}));
    EXPECT_EQ(plan_shard(path, {1, 2})->missing, (std::vector<std::uint32_t>{1, 5}));
    EXPECT_EQ(plan_shard(path, {0, 2})->images, 3u);
}

TEST(DatasetFolders, RefuseAnotherRecipeAndFewerImages) {
    const TemporaryFolder folder;
    Manifest manifest{6, {true, true, false, false, false, true}, "recipe", "abc"};
    ASSERT_TRUE(open_dataset(folder / "set", manifest));
    EXPECT_TRUE(open_dataset(folder / "set", manifest));
    manifest.images = 5;
    EXPECT_HAS(open_dataset(folder / "set", manifest).error().text(), "is of 6 images, expected -n 6 or more");
    manifest.images = 9;
    EXPECT_TRUE(open_dataset(folder / "set", manifest));
    EXPECT_EQ(read_manifest(folder / "set")->images, 9u);
    manifest.recipe = "other";
    EXPECT_HAS(open_dataset(folder / "set", manifest).error().text(), "is of another recipe");
    manifest = {9, manifest.outputs, "recipe", "abd"};
    EXPECT_HAS(open_dataset(folder / "set", manifest).error().text(), "another version of the scene's files");
    EXPECT_HAS(read_manifest(folder / "none").error().text(), "expected the folder of a data set");
}

TEST(DatasetFolders, HoldWholeFilesOnly) {
    const TemporaryFolder folder;
    const std::string path = folder / "set";
    ASSERT_TRUE(open_dataset(path, {4, {true, false, false, false, false, true}, "recipe", "abc"}));
    const std::string file = path + "/" + image_file(kImageOutput, 2);
    const auto files = [&] {
        const std::filesystem::directory_iterator all(path + "/images");
        return std::distance(begin(all), end(all));
    };
    const Status failed = write_whole(file, [&](const std::string& part) -> Status {
        EXPECT_TRUE(part.ends_with(".png"));
        (void)write_file(part, "half");
        EXPECT_FALSE(std::filesystem::exists(file));
        return Error{"no"};
    });
    EXPECT_FALSE(failed);
    EXPECT_EQ(files(), 0);
    folder.write("set/images/.part-host-1-000001.png", "x");
    folder.write("set/images/.part-host-1-000002.png", "x");
    EXPECT_EQ(plan_shard(path, {})->missing.size(), 4u);
    remove_leftovers(path, {1, 2});
    EXPECT_EQ(files(), 1) << "that of the other shard stays";
}

TEST(FarthestPoints, OfAGridAreItsCorners) {
    std::vector<Vec3> grid;
    for (int x = 0; x < 5; ++x)
        for (int y = 0; y < 5; ++y) grid.push_back({1.0 * x, 1.0 * y, 0});
    const auto corners = farthest_points(grid, 4, [](const Vec3&) { return true; });
    ASSERT_EQ(corners.size(), 4u);
    for (const Vec3& c : corners) EXPECT_TRUE((c.x == 0 || c.x == 4) && (c.y == 0 || c.y == 4));
    const auto good = farthest_points(grid, 100, [](const Vec3& p) { return p.x > 0; });
    EXPECT_EQ(good.size(), 20u) << "each once, and none that is not good";
    EXPECT_TRUE(std::ranges::all_of(good, [](const Vec3& p) { return p.x > 0; }));
    EXPECT_TRUE(farthest_points({}, 3, [](const Vec3&) { return true; }).empty());
}

using Visibility = DatasetTest;

TEST_F(Visibility, OfASphereIsItsDiscWithinTheImage) {
    const auto set = scenes("target = \"ball\"\n[[background]]\nkind = \"none\"\n");
    const auto scene = *set->shared(0, 0);
    ImageDraw d;
    d.q_world_camera = {};
    const auto part_at = [&](double x_px) {
        d.T_camera_target.t = 100.0 * set->camera().model->direction({x_px, 23.5});
        return visible_part(*scene, scene->place(d));
    };
    EXPECT_DOUBLE_EQ(part_at(31.5), 1.0);
    EXPECT_NEAR(part_at(63.5), 0.5, 0.02) << "its middle is on the image's border";
    EXPECT_DOUBLE_EQ(part_at(80), 0.0);
    d.T_camera_target.t = {0, 0, 0.5};
    const double inside = visible_part(*scene, scene->place(d));  // the image's solid angle over 4 pi
    EXPECT_NEAR(inside, 0.0279, 0.006);
}

TEST_F(Visibility, KnowsWhatHidesThePointsOfTheTarget) {
    const auto set = scenes("target = \"ball\"\n");
    const auto scene = *set->shared(0, 0);
    ImageDraw d;
    d.q_world_camera = {};
    d.T_camera_target = {{}, {0, 0, 10}};
    const auto views = view_keypoints(*scene, scene->place(d), {{0, 0, -1}, {0, 0, 1}, {9, 0, 0}, {0, 0, -20}});
    using State = KeypointView::State;
    EXPECT_EQ(views[0].state, State::visible);
    EXPECT_EQ(views[1].state, State::occluded);
    EXPECT_EQ(views[2].state, State::outside);
    EXPECT_TRUE(views[2].px.has_value());
    EXPECT_EQ(views[3].state, State::outside);
    EXPECT_FALSE(views[3].px.has_value()) << "behind the camera";
    EXPECT_NEAR(views[0].px->x, 31.5, 1e-9);
}

TEST(SpeedLabels, TakeCameraAxesToTargetAxes) {
    // As a passive direction cosine matrix (scalar first), C takes a vector's components in the camera's axes to
    // those in the target's: p_camera = C^T p_target + r.
    const Quat q = normalized(Quat{-0.3, 0.5, -0.7, 0.4});
    const Vec3 r{0.1, -0.2, 5}, p{0.4, 0.5, -0.6};
    const json entry = speed_entry(
        {{"file", "images/000003.png"},
         {"T_camera_target", {{"position_m", {r.x, r.y, r.z}}, {"attitude_wxyz", {q.w, q.x, q.y, q.z}}}}});
    EXPECT_EQ(entry.at("filename"), "000003.png");
    const json& s = entry.at("q_vbs2tango_true");
    const double w = s[0], x = s[1], y = s[2], z = s[3];
    EXPECT_GE(w, 0);
    const double C[3][3] = {{2 * w * w - 1 + 2 * x * x, 2 * (x * y + w * z), 2 * (x * z - w * y)},
                            {2 * (x * y - w * z), 2 * w * w - 1 + 2 * y * y, 2 * (y * z + w * x)},
                            {2 * (x * z + w * y), 2 * (y * z - w * x), 2 * w * w - 1 + 2 * z * z}};
    const Vec3 expected = q * p + r;
    for (int i = 0; i < 3; ++i)
        EXPECT_NEAR(C[0][i] * p.x + C[1][i] * p.y + C[2][i] * p.z +
                        entry.at("r_Vo2To_vbs_true")[static_cast<std::size_t>(i)].get<double>(),
                    expected[i], 1e-12);
}

TEST(Statistics, CountEachValueOnce) {
    const std::vector<double> values{1, 2, 4, 8, 16};
    const Histogram1d h = histogram_of(values, 4, true);
    EXPECT_EQ(h.counts, (std::vector<std::uint64_t>{1, 1, 1, 2}));
    EXPECT_NEAR(h.edges[2], 4, 1e-12);
    const std::vector<double> same{3, 3};
    EXPECT_EQ(histogram_of(same, 2).counts, (std::vector<std::uint64_t>{2, 0}));
    EXPECT_TRUE(histogram_of({}, 2).counts.empty());
}

TEST(Verification, SamplesEvenly) {
    EXPECT_EQ(sampled_images(10, 4), (std::vector<std::uint32_t>{0, 2, 5, 7}));
    EXPECT_EQ(sampled_images(3, 9), (std::vector<std::uint32_t>{0, 1, 2}));
}

}  // namespace
}  // namespace narpa::test
