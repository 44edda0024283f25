// What calibration files and camera_info messages state: used, or named in a warning or an error.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <array>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <random>

#include "renderer/assets/calibration_file.h"
#include "renderer/assets/lidar_calibration.h"
#include "renderer/projection/brown_conrady.h"
#include "renderer/projection/kannala_brandt.h"
#include "renderer/projection/projection_kind.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/campaign.h"
#include "tests/support/expect_has.h"

namespace narpa {
namespace {

using test::MemoryFolder;

const std::string kPlain = R"(image_width: 640
image_height: 480
camera_matrix: {rows: 3, cols: 3, data: [300, 0, 320, 0, 310, 240, 0, 0, 1]}
)";

class CalibrationDeclarations : public testing::Test {
protected:
    Result<Calibration> read(const std::string& text) const {
        return read_calibration(folder.write("c.yaml", text));
    }
    std::string error_of(const std::string& text) const {
        const auto c = read(text);
        EXPECT_FALSE(c) << text;
        return c ? "" : c.error().text();
    }
    std::string warnings_of(const std::string& text) const {
        const auto c = read(text);
        EXPECT_TRUE(c) << c.error().text();
        return c ? fmt::format("{}", fmt::join(c->warnings, "\n")) : "";
    }
    const MemoryFolder folder;
};

TEST_F(CalibrationDeclarations, EachKeyOfTheModelCounts) {
    const std::string four = "distortion_coefficients: [-0.02, 0.004, -0.001, 0.0002]\n";
    for (const char* key : {"camera_model: equidistant\n", "distortion_model: fisheye\n", "fisheye_model: 1\n",
                            "camera_model: pinhole\ndistortion_model: equidistant\n"}) {
        const auto c = read(kPlain + key + four);
        ASSERT_TRUE(c) << c.error().text();
        EXPECT_EQ(c->model->parameters().kind, &kKannalaBrandt) << key;
        EXPECT_TRUE(c->warnings.empty());
    }
    EXPECT_HAS(warnings_of(kPlain + four), "distortion_model is missing; its 4 coefficients are read as");
    EXPECT_HAS(error_of(kPlain + "distortion_model: plumb_bob\nfisheye_model: 1\n" + four),
               "c.yaml:5:16: fisheye_model: expected the model that distortion_model names");
    EXPECT_HAS(error_of(kPlain + "camera_model: mei\n" + four), "camera_model \"mei\" is not known here");
    EXPECT_HAS(error_of(kPlain + "xi: 0.9\n" + four), "c.yaml:4:5: xi: is of an omnidirectional camera model");
    EXPECT_HAS(error_of(kPlain + kPlain), "c.yaml:4:1: \"image_width\" stands twice");
    EXPECT_HAS(warnings_of(kPlain + "shutter: rolling\n"), "its key \"shutter\" is not known and not used");
    EXPECT_EQ(warnings_of(kPlain + "camera_name: nav\nflags: 4\nsquare_size: 0.02\navg_reprojection_error: 0.2\n"),
              "");
}

TEST_F(CalibrationDeclarations, RectificationIsNamed) {
    const std::string identity = "rectification_matrix: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n";
    EXPECT_EQ(warnings_of(kPlain + identity + "projection_matrix: [280, 0, 318, 0, 0, 290, 236, 0, 0, 0, 1, 0]\n"),
              "");
    EXPECT_HAS(warnings_of(kPlain + "rectification_matrix: [0, -1, 0, 1, 0, 0, 0, 0, 1]\n"),
               "are of rectified images");
    EXPECT_HAS(
        warnings_of(kPlain + identity + "projection_matrix: [280, 0, 318, -28, 0, 290, 236, 0, 0, 0, 1, 0]\n"),
        "are of rectified images");
}

TEST_F(CalibrationDeclarations, MessagesOfRos1AndRos2AreRead) {
    const std::string ros2 = R"(header:
  stamp:
    sec: 12
    nanosec: 500
  frame_id: nav
height: 480
width: 640
distortion_model: plumb_bob
d:
- -0.2
- 0.05
- 0.001
- 0.002
- 0.0
k:
- 300.0
- 0.0
- 320.0
- 0.0
- 310.0
- 240.0
- 0.0
- 0.0
- 1.0
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [300.0, 0.0, 320.0, 0.0, 0.0, 310.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: false
---
)";
    const std::string ros1 =
        "header: \n  seq: 7\n  stamp: \n    secs: 1\n    nsecs: 2\n  frame_id: \"nav\"\nheight: 480\n"
        "width: 640\ndistortion_model: \"plumb_bob\"\nD: [-0.2, 0.05, 0.001, 0.002, 0.0]\n"
        "K: [300.0, 0.0, 320.0, 0.0, 310.0, 240.0, 0.0, 0.0, 1.0]\nbinning_x: 1\nbinning_y: 1\n---\n";
    std::string windows = ros2;
    for (std::size_t at = 0; (at = windows.find('\n', at)) != windows.npos; at += 2) windows.insert(at, "\r");
    for (const std::string& text : {ros2, ros1, "\xEF\xBB\xBF" + windows}) {
        const auto c = read(text);
        ASSERT_TRUE(c) << c.error().text();
        EXPECT_EQ(c->warnings.size(), 0u);
        EXPECT_EQ(c->width, 640);
        EXPECT_EQ(c->model->parameters().kind, &kBrownConrady);
        EXPECT_EQ(c->model->parameters().pinhole.fy, 310);
        EXPECT_EQ(c->model->parameters().values[3], 0.002);
    }
    EXPECT_HAS(warnings_of(ros1 + ros1), "it holds 2 documents; the first is used");
    EXPECT_HAS(error_of("width: 640\nheight: 480\nK: [0, 0, 0, 0, 0, 0, 0, 0, 0]\n"),
               "of a camera that is not calibrated");
}

TEST_F(CalibrationDeclarations, ReadOutPartsAndBinsAreThoseOfTheImage) {
    const auto binned = read(kPlain + "binning_x: 2\nbinning_y: 4\n");
    ASSERT_TRUE(binned) << binned.error().text();
    EXPECT_EQ(binned->width, 320);
    EXPECT_EQ(binned->height, 120);
    const Pinhole p = binned->model->parameters().pinhole;
    EXPECT_EQ(p.fx, 150);
    EXPECT_EQ(p.fy, 77.5);
    EXPECT_EQ(p.cx, 159.75);  // column 320 is the left half of column 160, whose middle is 320.5
    const auto part = read(kPlain + "roi: {x_offset: 20, y_offset: 40, width: 400, height: 200}\nbinning_x: 2\n");
    ASSERT_TRUE(part) << part.error().text();
    EXPECT_EQ(part->width, 200);
    EXPECT_EQ(part->height, 200);
    EXPECT_EQ(part->model->parameters().pinhole.cx, 149.75);
    EXPECT_EQ(part->model->parameters().pinhole.cy, 200);
    EXPECT_HAS(error_of(kPlain + "binning_x: 3\n"), "binning_x: expected a divisor of 640 pixels");
    EXPECT_HAS(error_of(kPlain + "roi: {x_offset: 300, width: 400, height: 480}\n"),
               "roi: expected a part of the image of 640 x 480");
}

TEST(LidarCalibrationDeclarations, CorrectionsThatAreNotUsedAreNamed) {
    const MemoryFolder folder;
    std::vector<std::string> warnings;
    const auto read = [&](const std::string& text) {
        warnings.clear();
        return read_lidar_calibration(folder.write("l.yaml", text), 2, &warnings);
    };
    ASSERT_TRUE(
        read("distance_resolution: 0.002\nlasers:\n- {laser_id: 0, focal_distance: 0, max_intensity: 255}\n- "
             "{laser_id: 1}\n"));
    EXPECT_TRUE(warnings.empty()) << warnings[0];
    ASSERT_TRUE(
        read("distance_resolution: 0.004\nlasers:\n- {laser_id: 0, two_pt_correction_available: true, colour: 1}\n"
             "- {laser_id: 1, focal_slope: 1.2, two_pt_correction_available: true}\n"));
    const std::string all = fmt::format("{}", fmt::join(warnings, "\n"));
    EXPECT_EQ(warnings.size(), 4u) << all;
    for (const char* what : {"distance_resolution is not used", "\"two_pt_correction_available\" of its lasers",
                             "\"focal_slope\" of its lasers", "\"colour\" is not known"})
        EXPECT_HAS(all, what);
    EXPECT_FALSE(read("num_lasers: 3\nlasers:\n- {laser_id: 0}\n- {laser_id: 1}\n"));
}

/// Random files as OpenCV and ROS lay them out; where a point appears is compared with OpenCV's projection.
class CalibrationTrial {
public:
    explicit CalibrationTrial(unsigned seed) : random_(seed) {}

    void run(const MemoryFolder& folder) {
        const bool fisheye = whole(0, 1) != 0;
        const int count = fisheye ? 4 : std::array{4, 5, 8}[static_cast<std::size_t>(whole(0, 2))];
        std::vector<double> k;
        for (int i = 0; i < count; ++i) k.push_back(real(-0.02, 0.02));
        const double fx = real(200, 400), fy = real(200, 400), cx = real(300, 340), cy = real(220, 260);
        const bool is_message = whole(0, 1) != 0;
        const int bin = is_message ? std::array{0, 1, 2, 4}[static_cast<std::size_t>(whole(0, 3))] : 1,
                  b = std::max(1, bin), x = is_message ? 4 * whole(0, 10) : 0,
                  y = is_message ? 4 * whole(0, 10) : 0, width = is_message ? 4 * whole(100, 150) : 640,
                  height = is_message ? 4 * whole(80, 110) : 480;
        const std::string name = fisheye ? "equidistant" : count == 8 ? "rational_polynomial" : "plumb_bob";
        std::vector<std::string> lines;
        const auto list = [](const auto& numbers) { return fmt::format("[{:.17g}]", fmt::join(numbers, ", ")); };
        const std::array matrix{fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0};
        if (is_message) {
            lines = {"width: 640",
                     "height: 480",
                     "k: " + list(matrix),
                     "d: " + list(k),
                     "distortion_model: " + name,
                     fmt::format("binning_x: {0}\nbinning_y: {0}", bin),
                     fmt::format("roi:\n  x_offset: {}\n  y_offset: {}\n  width: {}\n  height: {}", x, y, width,
                                 height)};
        } else {
            lines = {"image_width: 640", "image_height: 480",
                     "camera_matrix: {rows: 3, cols: 3, data: " + list(matrix) + "}",
                     fmt::format("distortion_coefficients: {{rows: 1, cols: {}, data: {}}}", count, list(k))};
            const int key = whole(0, fisheye ? 2 : 3);
            if (key == 0) lines.push_back("distortion_model: " + name);
            if (key == 1) lines.push_back(fmt::format("fisheye_model: {}", fisheye ? 1 : 0));
            if (key == 2) lines.push_back("camera_model: " + name);
        }
        std::ranges::shuffle(lines, random_);
        const std::string text = fmt::format("{}\n", fmt::join(lines, "\n"));
        const auto c = read_calibration(folder.write("c.yaml", text));
        ASSERT_TRUE(c) << text << c.error().text();
        ASSERT_EQ(c->width, width / b) << text;
        ASSERT_EQ(c->height, height / b) << text;
        for (int i = 0; i < 5; ++i) {
            const Vec3 point{real(-0.8, 0.8), real(-0.6, 0.6), 1};
            const std::vector<cv::Point3d> points{{point.x, point.y, point.z}};
            std::vector<cv::Point2d> seen;
            const cv::Matx33d K(fx, 0, cx, 0, fy, cy, 0, 0, 1);
            if (fisheye)
                cv::fisheye::projectPoints(points, seen, cv::Vec3d(), cv::Vec3d(), K, cv::Mat(k));
            else
                cv::projectPoints(points, cv::Vec3d(), cv::Vec3d(), K, k, seen);
            const auto at = c->model->project(point);
            ASSERT_TRUE(at) << text;
            EXPECT_NEAR(at->x, (seen[0].x - x + 0.5) / b - 0.5, 1e-6) << text;
            EXPECT_NEAR(at->y, (seen[0].y - y + 0.5) / b - 0.5, 1e-6) << text;
        }
    }

private:
    int whole(int low, int high) { return std::uniform_int_distribution(low, high)(random_); }
    double real(double low, double high) { return std::uniform_real_distribution(low, high)(random_); }
    std::mt19937 random_;
};

TEST(CalibrationTrials, PointsAppearWhereOpenCvProjectsThem) {
    const MemoryFolder folder;
    for (int seed = 0; seed < test::trials(200, 10'000) && !testing::Test::HasFailure(); ++seed) {
        SCOPED_TRACE(fmt::format("seed {}", seed));
        CalibrationTrial(static_cast<unsigned>(seed)).run(folder);
    }
}

}  // namespace
}  // namespace narpa
