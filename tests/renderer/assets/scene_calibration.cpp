// Calibration files: what ROS and OpenCV write is read, what is written is read again, and errors name the line.
#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "renderer/assets/calibration_file.h"
#include "renderer/assets/lidar_calibration.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/projection/double_sphere.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/scene_file/scene_support.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

using test::MemoryFolder;

constexpr const char* kRos = R"(image_width: 640
image_height: 480
camera_name: nav
camera_matrix:
  rows: 3
  cols: 3
  data: [ 610.5,   0. , 325.3,
            0. , 605.2, 236.8,
            0. ,   0. ,   1. ]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.35, 0.14, 0.0012, -0.0008, -0.025]
)";

TEST(CalibrationFile, OfRosIsRead) {
    const MemoryFolder folder;
    const auto c = read_calibration(folder.write("nav.yaml", kRos));
    ASSERT_TRUE(c) << c.error().text();
    EXPECT_EQ(c->width, 640);
    EXPECT_EQ(c->height, 480);
    const ProjectionParameters p = c->model->parameters();
    EXPECT_EQ(p.pinhole.fy, 605.2);
    EXPECT_EQ(p.pinhole.cx, 325.3);
    EXPECT_EQ(p.kind, &kBrownConrady);
    EXPECT_EQ(p.values, (std::vector<double>{-0.35, 0.14, 0.0012, -0.0008, -0.025}));
}

TEST(CalibrationFile, OfOpenCvIsRead) {
    const MemoryFolder folder;
    const std::string path = folder.write("nav.yaml", "");
    cv::FileStorage file(path, cv::FileStorage::WRITE);
    file << "image_width" << 320 << "image_height" << 240;
    file << "camera_matrix" << cv::Mat(cv::Matx33d(250, 0, 160, 0, 248, 120, 0, 0, 1));
    file << "distortion_coefficients" << cv::Mat(cv::Matx41d(-0.03, 0.01, -0.004, 6e-4)) << "fisheye_model" << 1;
    file.release();
    const auto c = read_calibration(path);
    ASSERT_TRUE(c) << c.error().text();
    const ProjectionParameters p = c->model->parameters();
    EXPECT_EQ(p.pinhole.fx, 250);
    EXPECT_EQ(p.kind, &kKannalaBrandt);
    EXPECT_EQ(p.values, (std::vector<double>{-0.03, 0.01, -0.004, 6e-4}));
}

TEST(CalibrationFile, WhatIsWrittenIsReadByUsAndByOpenCv) {
    const MemoryFolder folder;
    const Pinhole pinhole{610.1, 605, 325.3, 1.0 / 7};
    const std::vector<ProjectionParameters> all{
        {&kPinhole, pinhole},
        {&kBrownConrady, pinhole, {0.1, -0.2, 0.001, 1.0 / 3}},
        {&kBrownConrady, pinhole, {0.6, 0.05, 5e-4, 3e-4, 0.01, 0.95, 0.15, 0.02}},
        {&kKannalaBrandt, pinhole, {-0.02, 0.005, -0.003, 4e-4}}};
    for (const ProjectionParameters& p : all) {
        const Calibration c{640, 480, make_projection(p)};
        const auto text = calibration_text("nav", c);
        ASSERT_TRUE(text) << text.error().text();
        const std::string path = folder.write("c.yaml", *text);
        const auto back = read_calibration(path);
        ASSERT_TRUE(back) << back.error().text();
        EXPECT_EQ(back->width, c.width);
        const ProjectionParameters found = back->model->parameters();
        EXPECT_EQ(found.pinhole.cy, pinhole.cy);
        EXPECT_EQ(found.kind, p.kind);
        EXPECT_EQ(found.values, p.values);
        const cv::FileStorage file(path, cv::FileStorage::READ);
        cv::Mat1d K, k;
        file["camera_matrix"] >> K;
        file["distortion_coefficients"] >> k;
        EXPECT_EQ(K(0, 0), pinhole.fx);
        EXPECT_EQ(std::vector<double>(k.begin(), k.end()), p.kind == &kPinhole ? std::vector<double>(5) : p.values);
    }
}

TEST(CalibrationFile, RefusesProjectionsThatOpenCvAndRosDoNotName) {
    const auto text = calibration_text(
        "nav", {640, 480, make_projection({&kDoubleSphere, {300, 300, 319.5, 239.5}, {-0.2, 0.6}})});
    ASSERT_FALSE(text);
    EXPECT_NE(text.error().what.find("cannot state its projection, double_sphere"), std::string::npos)
        << text.error().what;
}

TEST(CalibrationFile, ErrorsNameTheLine) {
    const MemoryFolder folder;
    const auto expect_error = [&](const std::string& from, const std::string& to, int line, const char* what) {
        std::string text = kRos;
        text.replace(text.find(from), from.size(), to);
        const auto c = read_calibration(folder.write("bad.yaml", text));
        ASSERT_FALSE(c) << to;
        EXPECT_EQ(c.error().line, line) << c.error().text();
        EXPECT_NE(c.error().what.find(what), std::string::npos) << c.error().text();
    };
    expect_error("image_width: 640", "image_width: wide", 1, "expected an integer in [1, 16384]");
    expect_error("610.5", "-1", 5, "camera_matrix: expected [fx, 0, cx");
    expect_error("605.2", ".nan", 8, "camera_matrix: expected finite numbers");
    expect_error("plumb_bob", "fov", 10, "distortion_model \"fov\" is not known here");
    expect_error("-0.025]", "-0.025, 1]", 14, "data has 6 numbers, expected rows * cols = 5");
    expect_error("cols: 5\n  data: [", "data: [1, ", 12, "got 6, expected 4, 5, 8 or 12");
    expect_error("[-0.35", "[-0.35: {", 14, "is not YAML");
    expect_error("camera_matrix", "kamera_matrix", 0, "expected camera_matrix");
}

TEST(SceneCalibration, GivesSizeIntrinsicsAndDistortion) {
    const MemoryFolder folder;
    folder.write("nav.yaml", kRos);
    const std::string path =
        folder.write("scene.toml",
                     "[ambient]\nradiance = 1\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n"
                     "[[camera]]\nname = \"nav\"\ncalibration = \"nav.yaml\"\n");
    const auto scene = read_scene(path);
    ASSERT_TRUE(scene) << scene.error().text();
    const Camera& c = scene->cameras[0];
    EXPECT_EQ(c.width, 640);
    ASSERT_TRUE(c.model);
    EXPECT_EQ(c.model->parameters().pinhole.fx, 610.5);
    EXPECT_EQ(c.model->pinhole(), nullptr);
    const auto principal = c.model->project({0, 0, 1});
    ASSERT_TRUE(principal);
    EXPECT_NEAR(principal->x, 325.3, 1e-12);
}

TEST(SceneCalibration, LeavesNoRoomForAnotherDistortionOrSize) {
    const MemoryFolder folder;
    folder.write("nav.yaml", kRos);
    for (const auto& [key, what] :
         {std::pair("distortion = {model = \"fisheye\", coefficients = [0, 0, 0, 0]}", "expected one of the two"),
          std::pair("resolution = [64, 48]", "expected that of the calibration, 640 x 480")}) {
        const auto scene = read_scene(folder.write(
            "scene.toml", std::string("[ambient]\nradiance = 1\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n"
                                      "[[camera]]\nname = \"nav\"\ncalibration = \"nav.yaml\"\n") +
                              key + "\n"));
        ASSERT_FALSE(scene);
        EXPECT_NE(scene.error().text().find(what), std::string::npos) << scene.error().text();
    }
}

TEST(SceneDistortion, FieldsOfViewAreThoseOfTheDistortedImage) {
    const MemoryFolder folder;
    for (const char* field : {"fov_horizontal_deg = 100", "fov_diagonal_deg = 130"}) {
        const std::string path = folder.write(
            "scene.toml", std::string("[ambient]\nradiance = 1\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n"
                                      "[[camera]]\nname = \"nav\"\nresolution = [640, 480]\n") +
                              field +
                              "\ndistortion = {model = \"fisheye\", coefficients = [-0.03, 0.01, -0.004, 6e-4]}\n");
        const auto scene = read_scene(path);
        ASSERT_TRUE(scene) << scene.error().text();
        const CameraModel* model = scene->cameras[0].model.get();
        const bool diagonal = std::string(field).starts_with("fov_diagonal");
        const Vec3 a = model->direction({-0.5, diagonal ? -0.5 : 239.5}),
                   b = model->direction({639.5, diagonal ? 479.5 : 239.5});
        EXPECT_NEAR(std::acos(dot(a, b)) * 180 / 3.14159265358979, diagonal ? 130 : 100, 1e-6);
    }
}

/// As velodyne_pointcloud of ROS has it: by laser_id, in any order.
TEST(LidarCalibrationFile, OfRosIsRead) {
    const MemoryFolder folder;
    const auto beams =
        read_lidar_calibration(folder.write("unit.yaml",
                                            "lasers:\n- {laser_id: 1, vert_correction: 0.2, rot_correction: 0.03}\n"
                                            "- {laser_id: 0, vert_correction: -0.1, dist_correction: 0.004, "
                                            "vert_offset_correction: 0.011}\nnum_lasers: 2\n"),
                               2);
    ASSERT_TRUE(beams) << beams.error().text();
    ASSERT_EQ(beams->size(), 2u);
    EXPECT_EQ((*beams)[0].elevation_rad, -0.1);
    EXPECT_EQ((*beams)[0].range_offset_m, 0.004);
    EXPECT_EQ((*beams)[0].height_m, 0.011);
    EXPECT_EQ((*beams)[1].elevation_rad, 0.2);
    EXPECT_EQ((*beams)[1].azimuth_rad, -0.03);
}

TEST(LidarCalibrationFile, SaysWhereAndWhatIsWrong) {
    const MemoryFolder folder;
    const std::pair<const char*, const char*> cases[]{
        {"beams: 3\n", "expected lasers: a list of 2"},
        {"lasers: 3\n", "expected lasers: a list of 2"},
        {"lasers:\n- {laser_id: 0}\n", "expected lasers: a list of 2"},
        {"lasers:\n- {laser_id: 0}\n- {laser_id: 0}\n", "bad.yaml:3:3: laser_id: expected each of 0 to 1 once"},
        {"lasers:\n- {laser_id: 0}\n- {laser_id: 2}\n", "bad.yaml:3:3: laser_id"},
        {"lasers:\n- {laser_id: 0, vert_correction: up}\n- {laser_id: 1}\n", "vert_correction: expected a number"},
        {"lasers:\n- {laser_id: 0, horiz_offset_correction: 0.026}\n- {laser_id: 1}\n", "expected 0"},
        {"- 1\n", "expected a LiDAR's calibration in YAML"},
        {"lasers: [\n", "is not YAML"},
    };
    for (const auto& [text, expected] : cases) {
        const auto beams = read_lidar_calibration(folder.write("bad.yaml", text), 2);
        ASSERT_FALSE(beams) << text;
        EXPECT_NE(beams.error().text().find(expected), std::string::npos) << beams.error().text();
    }
    EXPECT_FALSE(read_lidar_calibration(folder.write("gone", "") + ".yaml", 2));
}

/// A damaged file of a unit, as the scene's reader refuses it: where it is named, its own place, what was expected.
TEST(LidarCalibrationFile, DamageIsRefusedByTheScene) {
    const MemoryFolder folder;
    std::string yaml = "lasers:\n", angles;
    for (int laser = 0; laser < 16; ++laser) {
        yaml += "- {laser_id: " + std::to_string(laser) + ", vert_correction: 0.1}\n";
        angles += (laser > 0 ? ", " : "") + std::to_string(8 - laser);
    }
    const std::string metadata = "{\n\"beam_altitude_angles\": [" + angles + "],\n\"beam_azimuth_angles\": [" +
                                 angles + "],\n\"lidar_mode\": \"1024x10\"}";
    const auto damaged = [](std::string text, const std::string& part, const std::string& with) {
        const auto at = text.find(part);
        EXPECT_NE(at, text.npos) << part;
        return text.replace(at, part.size(), with);
    };
    struct Case {
        const char *model, *file;
        std::string text;
        const char* expected;  ///< after the file's name
    };
    const Case cases[]{
        {"VLP-16", "unit.yaml", yaml, nullptr},
        {"VLP-16", "unit.yaml", yaml.substr(0, yaml.size() / 2), ":2:1: expected lasers: a list of 16"},
        {"VLP-16", "unit.yaml", yaml.substr(0, yaml.rfind('-')), ":2:1: expected lasers: a list of 16"},
        {"VLP-16", "unit.yaml", damaged(yaml, "laser_id: 7", "laser_id: 6"),
         ":9:3: laser_id: expected each of 0 to 15 once"},
        {"VLP-16", "unit.yaml", damaged(yaml, "7, vert_correction: 0.1", "7, vert_correction: 0.1.1"),
         ":9:34: vert_correction: expected a number in [-1.6, 1.6]"},
        {"VLP-16", "unit.yaml", damaged(yaml, "7, vert_correction: 0.1", "7, vert_correction: .nan"),
         ":9:34: vert_correction: expected a number in [-1.6, 1.6]"},
        {"VLP-16", "unit.yaml", damaged(yaml, "7, vert_correction: 0.1", "7, vert_correction: 100"),
         ":9:34: vert_correction: expected a number in [-1.6, 1.6]"},
        {"VLP-16", "unit.yaml", std::string("\0\xff\x01", 3), ""},
        {"os1-16", "unit.json", metadata, nullptr},
        {"os1-16", "unit.json", metadata.substr(0, metadata.size() / 2), ":3: not JSON"},
        {"os1-16", "unit.json", damaged(metadata, "8, 7", "8, 700"),
         ":2: beam_altitude_angles: expected numbers from -90"},
        {"os1-16", "unit.json", damaged(metadata, "azimuth_angles\": [8, ", "azimuth_angles\": ["),
         ":3: beam_azimuth_angles: expected as many angles as beam_altitude_angles has"},
        {"os1-16", "unit.json", damaged(metadata, "1024x10", "1024x"),
         ":4: lidar_mode: expected columns and turns a second, as 1024x10"},
        {"os1-16", "unit.json", "", ": is empty"},
    };
    for (const Case& c : cases) {
        const std::string file = folder.write(c.file, c.text);
        const std::string scene = folder.write(
            "scene.toml", std::string("[ambient]\nradiance = 1\n[[body]]\nname = \"b\"\nsphere = {radius_m = 1}\n"
                                      "[[lidar]]\nname = \"l\"\nmodel = \"") +
                              c.model + "\"\ncalibration = \"" + c.file + "\"\n");
        const auto read = read_scene(scene);
        if (!c.expected) {
            EXPECT_TRUE(read) << read.error().text();
            continue;
        }
        ASSERT_FALSE(read) << c.text;
        EXPECT_EQ(read.error().file, scene);
        EXPECT_EQ(read.error().line, 9) << read.error().text();
        EXPECT_NE(read.error().what.find(file + c.expected), std::string::npos) << read.error().what;
    }
}

}  // namespace
}  // namespace narpa
