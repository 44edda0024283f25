// Lens distortion: OpenCV's own functions agree with the models, and its calibration finds them in rendered frames.
#include <gtest/gtest.h>

#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "base/constants.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/detector/detector.h"
#include "renderer/frame/camera_image.h"
#include "tests/support/cameras.h"
#include "tests/support/shapes.h"

namespace narpa {
namespace {

using namespace test;

const Pinhole kIntrinsics{610, 605, 325.3, 236.8};
const ProjectionParameters kStrongBarrel{&kBrownConrady, kIntrinsics, {-0.35, 0.14, 1.2e-3, -8e-4, -0.025}};
const ProjectionParameters kRational{&kBrownConrady, kIntrinsics, {0.6, 0.05, 5e-4, 3e-4, 0.01, 0.95, 0.15, 0.02}};
const ProjectionParameters kThinPrism{
    &kBrownConrady, kIntrinsics, {-0.2, 0.05, 1e-3, 1e-3, 0, 0, 0, 0, 2e-3, -1e-3, -3e-3, 5e-4}};
const ProjectionParameters kFisheye{&kKannalaBrandt, kIntrinsics, {-0.02, 0.005, -0.003, 4e-4}};

cv::Matx33d matrix_of(const Pinhole& p) {
    return {p.fx, 0, p.cx, 0, p.fy, p.cy, 0, 0, 1};
}

ImagePoint by_opencv(const ProjectionParameters& projection, const Vec3& point) {
    const std::vector<cv::Point3d> points{{point.x, point.y, point.z}};
    std::vector<cv::Point2d> image;
    const cv::Vec3d none(0, 0, 0);
    if (projection.kind == &kKannalaBrandt)
        cv::fisheye::projectPoints(points, image, none, none, matrix_of(kIntrinsics), projection.values);
    else
        cv::projectPoints(points, none, none, matrix_of(kIntrinsics), projection.values, image);
    return {image[0].x, image[0].y};
}

TEST(Distortion, ProjectsAsOpenCvDoes) {
    std::mt19937_64 random(1);
    std::uniform_real_distribution<double> side(-0.6, 0.6), range(0.01, 1e4);
    const ProjectionParameters four{&kBrownConrady, kIntrinsics, {-0.1, 0.02, 0, 1e-3}};
    for (const ProjectionParameters& projection : {kStrongBarrel, kRational, kThinPrism, kFisheye, four}) {
        const auto model = make_projection(projection);
        ASSERT_TRUE(model);
        for (int i = 0; i < 2000; ++i) {
            const double z = range(random);
            const Vec3 p{z * side(random), z * side(random), z};
            const auto ours = model->project(p);
            ASSERT_TRUE(ours);
            const ImagePoint theirs = by_opencv(projection, p);
            EXPECT_NEAR(ours->x, theirs.x, 1e-9);
            EXPECT_NEAR(ours->y, theirs.y, 1e-9);
        }
    }
}

TEST(Distortion, ImagePointsOfTheWholeFrameComeBack) {
    for (const ProjectionParameters& p : {kStrongBarrel, kRational, kThinPrism, kFisheye}) {
        const auto model = make_projection(p);
        for (double y = -0.5; y < 480; y += 3.7)
            for (double x = -0.5; x < 640; x += 3.7) {
                ASSERT_TRUE(model->sees({x, y}));
                const auto back = model->project(model->direction({x, y}));
                ASSERT_TRUE(back);
                EXPECT_NEAR(back->x, x, 1e-9);
                EXPECT_NEAR(back->y, y, 1e-9);
            }
    }
}

TEST(Distortion, NothingIsSeenWhereTheImageWouldFold) {
    // r - 0.35 r^3 grows up to r = 0.976, where the image radius is 0.650: 397 px.
    const auto model = brown_conrady(kIntrinsics, {-0.35, 0, 0, 0});
    const auto at = [&](double r) { return ImagePoint{kIntrinsics.cx + kIntrinsics.fx * r, kIntrinsics.cy}; };
    EXPECT_TRUE(model->sees(at(0.648)));
    EXPECT_FALSE(model->sees(at(0.652)));
    EXPECT_TRUE(model->project({0.97, 0, 1}));
    EXPECT_FALSE(model->project({0.98, 0, 1}));
    EXPECT_FALSE(model->project({0.1, 0, -1}));
    for (double r = 0; r < 20; r += 0.01) EXPECT_NEAR(norm(model->direction(at(r))), 1, 1e-14) << r;
}

TEST(Distortion, AFisheyeSeesBehindItself) {
    const auto model = kannala_brandt(kIntrinsics, {0, 0, 0, 0});
    const auto image = model->project({1, 0, -1});
    ASSERT_TRUE(image);
    EXPECT_NEAR(image->x, kIntrinsics.cx + kIntrinsics.fx * 0.75 * kPi, 1e-9);
    EXPECT_LT(norm(model->direction(*image) - normalized(Vec3{1, 0, -1})), 1e-14);
}

/// Squares of `size_m`, black and white in turn, within a white border; all glow, so that no light is needed.
Scene chessboard(int squares, double size_m) {
    Scene scene;
    Material white = lambert(0), black = lambert(0);
    white.emission = {1, 1, 1};
    scene.materials = {white, black};
    const int cells = squares + 2;
    Mesh board = plate(cells * size_m, cells * size_m, cells);
    for (std::size_t f = 0; f < board.faces.size(); ++f) {
        const int cell = static_cast<int>(f) / 2, i = cell % cells, j = cell / cells;
        const bool border = i == 0 || j == 0 || i == cells - 1 || j == cells - 1;
        board.face_material[f] = !border && (i + j) % 2 == 0;
    }
    add_mesh(scene, board);
    return scene;
}

/// Corners of a board in rendered frames, as a user would find them.
class Calibration : public testing::Test {
protected:
    static constexpr int kCorners = 8;
    static constexpr double kSquare_m = 0.05;

    void SetUp() override {
        camera.width = 480, camera.height = 360;
        camera.format = PixelFormat::grey;
        camera.white_radiance = 1.1;
        camera.optics.point_spread = PointSpreadFunction{.sigma_px = 1};
    }

    void take_views(const std::shared_ptr<const CameraModel>& model, int views) {
        camera.model = model;
        const Scene scene = chessboard(kCorners + 1, kSquare_m);
        auto render_scene = RenderScene::create(scene);
        ASSERT_TRUE(render_scene);
        std::vector<cv::Point3f> board;
        for (int j = 0; j < kCorners; ++j)
            for (int i = 0; i < kCorners; ++i)
                board.emplace_back(static_cast<float>(kSquare_m * i), static_cast<float>(kSquare_m * j), 0.0f);
        std::mt19937_64 random(3);
        std::uniform_real_distribution<double> tilt(-0.45, 0.45), place(-0.5, 0.5), range(0.75, 1.1);
        for (int view = 0; view < views; ++view) {
            // The board turns and shifts before a camera at rest: its plane faces the camera at no tilt.
            const double z = range(random);
            const Rigid3 T_camera_board{
                exp_rotation({tilt(random), tilt(random), 3 * tilt(random)}) * Quat{0, 1, 0, 0},
                {z * place(random) * 0.5, z * place(random) * 0.4, z}};
            BodyPoses at = placed(scene);
            FrameSettings settings;
            settings.spp = 16;
            settings.seed = 7;
            settings.frame = static_cast<std::uint32_t>(view);
            RadianceImage image(camera.width, camera.height);
            render_radiance(*render_scene, at, camera, inverse(T_camera_board), settings, image);
            cv::Mat1b frame(camera.height, camera.width);
            expose(camera, image, 0, 0, {frame.data, frame.total()});
            std::vector<cv::Point2f> found;
            if (!cv::findChessboardCornersSB(frame, {kCorners, kCorners}, found, cv::CALIB_CB_ACCURACY)) continue;
            cv::cornerSubPix(frame, found, {4, 4}, {-1, -1},
                             {cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 1e-4});
            corners.push_back(found);
            boards.push_back(board);
        }
        ASSERT_GE(corners.size(), 10u) << "views in which the board was found";
    }

    Camera camera;
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<std::vector<cv::Point3f>> boards;
};

/// Each within three of its own standard deviations.
void expect_found(const std::vector<double>& found, const std::vector<double>& truth,
                  const std::vector<double>& sigma) {
    for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], truth[i], 3 * sigma[i]) << "number " << i;
}

TEST_F(Calibration, OfOpenCvFindsBrownConrady) {
    const Pinhole truth{430, 427, 243.1, 176.4};
    take_views(brown_conrady(truth, {-0.28, 0.09, 8e-4, -6e-4}), 20);
    cv::Matx33d K = cv::Matx33d::eye();
    std::vector<double> k(5);
    cv::Mat1d sigma;
    cv::Mat none, errors;
    std::vector<cv::Mat> rotations, translations;
    const double rms = cv::calibrateCamera(boards, corners, {480, 360}, K, k, rotations, translations, sigma, none,
                                           errors, cv::CALIB_FIX_K3);
    EXPECT_LT(rms, 0.05);
    expect_found({K(0, 0), K(1, 1), K(0, 2), K(1, 2), k[0], k[1], k[2], k[3]},
                 {truth.fx, truth.fy, truth.cx, truth.cy, -0.28, 0.09, 8e-4, -6e-4},
                 {sigma.begin(), sigma.begin() + 8});
}

/// Of fx, fy, cx, cy, k1 .. k4, which fisheye::calibrate does not give: the views' poses are eliminated.
std::vector<double> fisheye_sigmas(const std::vector<std::vector<cv::Point3d>>& points, const cv::Matx33d& K,
                                   const cv::Vec4d& k, const std::vector<cv::Vec3d>& rotations,
                                   const std::vector<cv::Vec3d>& translations, double rms) {
    cv::Mat information = cv::Mat::zeros(8, 8, CV_64F);
    for (std::size_t i = 0; i < points.size(); ++i) {
        std::vector<cv::Point2d> image;
        cv::Mat J;
        cv::fisheye::projectPoints(points[i], image, rotations[i], translations[i], K, k, 0, J);
        const cv::Mat camera = J.colRange(0, 8), pose = J.colRange(8, 14), crossed = camera.t() * pose;
        information += camera.t() * camera - crossed * cv::Mat(pose.t() * pose).inv() * crossed.t();
    }
    const cv::Mat covariance = 0.5 * rms * rms * information.inv();
    std::vector<double> sigma;
    for (int i = 0; i < 8; ++i) sigma.push_back(std::sqrt(covariance.at<double>(i, i)));
    return sigma;
}

TEST_F(Calibration, OfOpenCvFindsTheFisheye) {
    const Pinhole truth{250, 248, 241.2, 177.7};
    take_views(kannala_brandt(truth, {-0.03, 0.01, -0.004, 6e-4}), 20);
    std::vector<std::vector<cv::Point3d>> points;
    std::vector<std::vector<cv::Point2d>> images;
    for (std::size_t i = 0; i < corners.size(); ++i) {
        points.emplace_back(boards[i].begin(), boards[i].end());
        images.emplace_back(corners[i].begin(), corners[i].end());
    }
    cv::Matx33d K = cv::Matx33d::eye();
    cv::Vec4d k;
    std::vector<cv::Vec3d> rotations, translations;
    const double rms = cv::fisheye::calibrate(points, images, {480, 360}, K, k, rotations, translations,
                                              cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW);
    EXPECT_LT(rms, 0.05);
    expect_found({K(0, 0), K(1, 1), K(0, 2), K(1, 2), k[0], k[1], k[2], k[3]},
                 {truth.fx, truth.fy, truth.cx, truth.cy, -0.03, 0.01, -0.004, 6e-4},
                 fisheye_sigmas(points, K, k, rotations, translations, rms));
}

}  // namespace
}  // namespace narpa
