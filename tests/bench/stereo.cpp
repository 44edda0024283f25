// The paper's stereo experiment: 100 points of cratered ground, by whole pixels and by subpixel matches.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <filesystem>

#include "bench/estimation/stereo.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/support/image_files.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace narpa {
namespace {

const std::string kDescent = test::build_path("scenes/descent/descent.toml");

void quietly(const std::string&) {}

std::string all(const std::vector<std::string>& faults) {
    std::string text;
    for (const std::string& f : faults) text += f + "\n";
    return text;
}

TEST(StereoBench, SubpixelErrorsAreFiveTimesSmallerAndAsPredicted) {
    const auto scene = read_scene(kDescent);
    ASSERT_TRUE(scene) << scene.error().text();
    const auto bench = measure_stereo(*scene, 100, quietly);
    ASSERT_TRUE(bench) << bench.error().text();
    EXPECT_EQ(all(stereo_faults(*bench, 100)), "") << to_text(*bench);

    // The paper's geometry: f of 500 x 500 pixels and 30 degrees from corner to corner, t = -(30, 0, 50) m.
    EXPECT_NEAR(paraxial_pinhole(*bench->pair.left.model).fx, 1319.479, 1e-3);
    EXPECT_NEAR(norm(bench->pair.T_right_left.t - Vec3{-30, 0, -50}), 0, 1e-9);
    // Rounding a column is 0.29 px RMS; a pixel is 16 to 30 m of depth over the frame, here by the right pixel
    // alone.
    const Spread whole = bench->errors(false, 2, false);
    EXPECT_GT(whole.rms, 0.2 * 16);
    EXPECT_LT(whole.rms, 0.4 * 22);
    for (const StereoBenchPoint& p : bench->points) {
        EXPECT_LT(std::abs(p.fine_error_m.z()), 6 * p.sigma_depth_m) << p.left_px.transpose();
        // The left pixel is exact, so the error lies along its ray.
        EXPECT_LT(p.fine_error_m.cross(p.truth_m.normalized()).norm(), 1e-3);
    }
}

TEST(StereoBench, SpreadFollowsTukey) {
    const Spread s = spread({1, -2, 3, -4, 5, 6, 7, 8, -100});
    EXPECT_EQ(s.median, 5);
    EXPECT_EQ(s.lower_quartile, 3);
    EXPECT_EQ(s.upper_quartile, 7);
    EXPECT_EQ(s.whiskers[0], 1);
    EXPECT_EQ(s.whiskers[1], 8) << "the last within 7 + 1.5 * 4";
    EXPECT_EQ(s.largest, 100);
    EXPECT_EQ(s.outliers, 1);
    EXPECT_NEAR(s.rms, std::sqrt((204 + 10000) / 9.0), 1e-12);
}

StereoBench made_up(double whole_m, double fine_m, double sigma_m) {
    StereoBench b;
    b.scene = "made up";
    b.left = {8, 8, std::vector<float>(64, 0.5f)};
    for (int i = 0; i < 100; ++i) {
        StereoBenchPoint p;
        const double s = (i % 2 ? 1.0 : -1.0) * (1 + 0.001 * i);
        p.left_px = {1.0 * (i % 8), 2}, p.right_px = {3, 2};
        p.truth_m = {10, 20, 800};
        p.whole_error_m = s * whole_m * Eigen::Vector3d(0.1, 0.2, 1);
        p.fine_error_m = s * fine_m * Eigen::Vector3d(0.1, 0.2, 1);
        p.sigma_depth_m = sigma_m;
        p.epipolar_sigmas = 1;
        b.points.push_back(p);
    }
    return b;
}

TEST(StereoBench, NamesItsFaults) {
    EXPECT_EQ(all(stereo_faults(made_up(5, 0.5, 0.5), 100)), "");
    EXPECT_EQ(all(stereo_faults(made_up(5, 0.5, 0.5), 120)), "100 points, expected 120\n");
    EXPECT_EQ(all(stereo_faults(made_up(2, 0.5, 0.5), 100)),
              "depth errors 4.0 times below those of whole pixels, expected 5\n");
    for (const double sigma_m : {0.2, 2.0})
        EXPECT_NE(all(stereo_faults(made_up(5, 0.5, sigma_m), 100)).find("predicted variances"), std::string::npos);
    EXPECT_EQ(stereo_faults({}, 1).size(), 1u);
}

TEST(StereoBench, PlotsItsMatches) {
    const test::TemporaryFolder folder;
    const std::string path = folder / "stereo.png";
    ASSERT_TRUE(plot_stereo(path, made_up(5, 0.5, 0.5)));
    EXPECT_FALSE(test::read_image_file(path).empty());
    EXPECT_FALSE(plot_stereo(folder / "nowhere/stereo.png", made_up(5, 0.5, 0.5)));
}

TEST(StereoBench, ScenesItCannotMeasureAreErrors) {
    auto scene = read_scene(kDescent);
    ASSERT_TRUE(scene);
    auto changed = *scene;
    changed.cameras[1].name = "other";
    auto bench = measure_stereo(changed, 100, quietly);
    ASSERT_FALSE(bench);
    EXPECT_NE(bench.error().what.find("no camera named \"right\""), std::string::npos);
    changed = *scene;
    changed.cameras[0].T_mount_camera.q = {};  // up, to the sky
    bench = measure_stereo(changed, 100, quietly);
    ASSERT_FALSE(bench);
    EXPECT_NE(bench.error().what.find("sees no surface"), std::string::npos);
}

/// A real digital elevation model, one metre a post, of one colour.
Scene gale(const cv::Mat& height_mm, const Scene& like) {
    Scene scene = like;
    scene.name = "mars_gale";
    scene.textures.clear();
    scene.materials.resize(1);
    scene.materials[0].texture = -1;
    scene.materials[0].diffuse = {0.22f, 0.22f, 0.22f};
    Mesh m;
    m.name = "gale";
    const int w = height_mm.cols, h = height_mm.rows;
    const double mean = cv::mean(height_mm)[0];
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)  // rows run from north to south
            m.positions.push_back(vec_cast<float>(
                Vec3{x - 0.5 * w, 0.5 * h - y - 15, 1e-3 * (height_mm.at<std::uint16_t>(y, x) - mean)}));
    std::vector<Vec3> normals(m.positions.size());
    const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
        const auto p = [&](std::uint32_t i) { return vec_cast<double>(m.positions[i]); };
        for (const std::uint32_t i : {a, b, c}) normals[i] += cross(p(b) - p(a), p(c) - p(a));
        m.faces.push_back({a, b, c});
    };
    for (int y = 0; y + 1 < h; ++y)
        for (int x = 0; x + 1 < w; ++x) {
            const auto i = static_cast<std::uint32_t>(y * w + x), below = i + static_cast<std::uint32_t>(w);
            add(i, below, i + 1), add(i + 1, below, below + 1);
        }
    for (const Vec3& n : normals) m.normals.push_back(vec_cast<float>(normalized(n)));
    m.face_material.assign(m.faces.size(), 0);
    scene.meshes = {m};
    // Only shading gives contrast: the Sun 12 degrees above the horizon, and twice the exposure.
    scene.sun->direction = normalized(Vec3{-0.70, 0.58, 0.20});
    for (Camera& c : scene.cameras) c.detector->exposure_s *= 2;
    return scene;
}

TEST(StereoBench, ErrorsOnRealGroundAreAsPredicted) {
    const std::string file = test::source_path("../shared/assets/dem/mars_gale/missionDEM_u16_mm.png");
    if (!std::filesystem::exists(file))
        GTEST_SKIP() << "no elevation model beside the project: ../shared/assets/dem/mars_gale";
    const auto descent = read_scene(kDescent);
    ASSERT_TRUE(descent);
    const auto bench = measure_stereo(gale(test::read_image_file(file), *descent), 100, quietly);
    ASSERT_TRUE(bench) << bench.error().text();
    EXPECT_EQ(all(stereo_faults(*bench, 100)), "") << to_text(*bench);
}

}  // namespace
}  // namespace narpa
