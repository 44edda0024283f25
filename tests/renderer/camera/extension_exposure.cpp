// The exposure joint: a camera that moves, and rows that are exposed one after another, against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/camera_pose.h"
#include "tests/renderer/camera/camera_support.h"
#include "tests/support/cameras.h"

namespace narpa {
namespace {

using namespace test;

TEST(CameraPose, PassesThroughItsEndsAtAConstantRate) {
    const Rigid3 start{exp_rotation({0.1, 0.2, -0.3}), {1, 2, 3}};
    const Rigid3 end{exp_rotation({0, 0, 0.4}) * start.q, {2, 0, 3}};
    const CameraPose pose(start, end);
    EXPECT_EQ(pose.at(0).t, start.t);
    EXPECT_EQ(pose.at(1).t, end.t);
    EXPECT_LT(angle_between(pose.at(0.25).q, exp_rotation({0, 0, 0.1}) * start.q), 1e-14);
    EXPECT_LT(norm(pose.at(0.25).t - Vec3{1.25, 1.5, 3}), 1e-15);
    EXPECT_EQ(pose.middle(), pose.at(0.5));
    EXPECT_EQ(CameraPose(start).at(0.7), start);
    EXPECT_EQ(CameraPose(start, start).middle(), start);
}

TEST(CameraPose, RowsOfARollingShutterStartOneRowTimeApart) {
    EXPECT_EQ(CameraPose({}, {}).time(70, 101, 0.3), 0.3);
    const CameraPose half({}, {}, 0.005);  // each row is exposed for half of the time
    EXPECT_EQ(half.time(0, 101, 0), 0);
    EXPECT_NEAR(half.time(1, 101, 0.5) - half.time(0, 101, 0.5), 0.005, 1e-15);
    EXPECT_NEAR(half.time(100, 101, 1), 1, 1e-15);
}

constexpr int kWidth = 96, kHeight = 64;
constexpr double kFocal_px = 100, kShift_px = 30;  ///< by which the image moves to the left
const Camera kCamera = camera(kWidth, kHeight, kFocal_px);

/// A bright half-plane 1 m from the camera, whose left edge is at x = 0. It emits 1 W m^-2 sr^-1 in each band.
Scene bright_edge() {
    Scene s;
    Material m = lambert(0);
    m.emission = {1, 1, 1};
    s.materials.push_back(m);
    add_mesh(s, box(4, 4, 1e-6), {{}, {2, 0, 1}});
    return s;
}
/// Moves past the edge, which is on the axis at mid-exposure.
CameraPose passing(double row_time = 0) {
    const double half_m = 0.5 * kShift_px / kFocal_px;
    return {{{}, {-half_m, 0, 0}}, {{}, {half_m, 0, 0}}, row_time};
}

double value(const RadianceImage& image, int x, int y) {
    return static_cast<double>(image.pixels[static_cast<std::size_t>(y * image.width + x)].y);
}

/// Mean of column x of the blurred edge: the part of the pixel that the edge has passed, averaged over the time.
double blurred_edge(int x) {
    const double end = pinhole_of(kCamera).cx - 0.5 * kShift_px;
    const auto integral = [&](double at) {  // of the ramp from `end` over kShift_px, from -infinity on
        const double s = (at - end) / kShift_px;
        return kShift_px * (s < 0 ? 0 : s < 1 ? 0.5 * s * s : s - 0.5);
    };
    return std::clamp(integral(x + 0.5) - integral(x - 0.5), 0.0, 1.0);
}

void expect_blurred_edge(const RadianceImage& image, int spp) {
    for (int x = 0; x < kWidth; ++x) {
        double mean = 0;
        for (int y = 0; y < kHeight; ++y) mean += value(image, x, y) / kHeight;
        const double p = blurred_edge(x);
        EXPECT_NEAR(mean, p, 4 * std::sqrt(p * (1 - p) / (spp * kHeight)) + 1e-9) << x;
    }
}

TEST(MovingCamera, BlursAnEdgeToARamp) {
    const Scene scene = bright_edge();
    expect_blurred_edge(rendered(scene, kCamera, passing(), {.spp = 64}), 64);
}

TEST(MovingCamera, BlursAsMuchAsABodyThatMovesTheOtherWay) {
    const Scene scene = bright_edge();
    const Rigid3 T = scene.bodies[0].initial.T_world_body;
    const Vec3 half{0.5 * kShift_px / kFocal_px, 0, 0};
    BodyPoses at(1);
    at.set(0, {T.q, T.t + half}, {T.q, T.t - half});
    FrameSettings settings;
    settings.spp = 64;
    expect_blurred_edge(rendered(scene, at, kCamera, CameraPose({}, {}), settings), 64);
    // A picture of one moment shows the body where it is at mid-exposure.
    EXPECT_EQ(rendered(scene, at, kCamera, {}, settings).pixels, rendered(scene, kCamera, {}, {.spp = 64}).pixels);
}

TEST(MovingCamera, BlursFramesWithinABudget) {
    const Scene scene = bright_edge();
    FrameSettings settings;
    settings.budget = {.kind = FrameBudget::Kind::rays, .rays = 32 * kWidth * kHeight};
    expect_blurred_edge(rendered(scene, kCamera, passing(), settings), 16);
}

/// Place of the edge in each row, from the row's light.
std::vector<double> edge_by_row(const RadianceImage& image) {
    std::vector<double> edge;
    for (int y = 0; y < kHeight; ++y) {
        double light = 0;
        for (int x = 0; x < kWidth; ++x) light += value(image, x, y);
        edge.push_back(kWidth - 0.5 - light);
    }
    return edge;
}
/// Of the straight line that fits best.
double slope(const std::vector<double>& values) {
    const double middle = 0.5 * static_cast<double>(values.size() - 1);
    double along = 0, squares = 0;
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double x = static_cast<double>(i) - middle;
        along += x * values[i], squares += x * x;
    }
    return along / squares;
}

TEST(RollingShutter, SlantsAnUprightEdgeByVelocityTimesRowTime) {
    const Scene scene = bright_edge();
    constexpr double kRowTime = 1.0 / (kHeight - 1);  // each row shows one moment: sharp
    const std::vector<double> edge = edge_by_row(rendered(scene, kCamera, passing(kRowTime), {.spp = 64}));
    for (int y = 0; y < kHeight; ++y)
        EXPECT_NEAR(edge[static_cast<std::size_t>(y)], pinhole_of(kCamera).cx - kShift_px * (y * kRowTime - 0.5),
                    1.0 / 32)
            << y;
    EXPECT_NEAR(slope(edge), -kShift_px * kRowTime, 2e-4);
    // One sample a pixel meets the edge in whole pixels.
    EXPECT_NEAR(slope(edge_by_row(rendered(scene, kCamera, passing(kRowTime), {.spp = 1}))), -kShift_px * kRowTime,
                5e-3);
}

TEST(RollingShutter, BlursEachRowOverItsOwnExposure) {
    const Scene scene = bright_edge();
    constexpr double kRowTime = 0.5 / (kHeight - 1);
    const RadianceImage image = rendered(scene, kCamera, passing(kRowTime), {.spp = 256});
    EXPECT_NEAR(slope(edge_by_row(image)), -kShift_px * kRowTime, 1e-3);
    const auto row_end = [&](int y) {
        return pinhole_of(kCamera).cx + 0.5 * kShift_px - kShift_px * (y * kRowTime + 0.5);
    };
    for (int y = 0; y < kHeight; y += 9) {
        const int middle = static_cast<int>(std::lround(row_end(y) + 0.25 * kShift_px));
        EXPECT_NEAR(value(image, middle, y), (middle - row_end(y)) / (0.5 * kShift_px), 0.1) << y;
        EXPECT_EQ(value(image, static_cast<int>(row_end(y)) - 2, y), 0) << y;
    }
}

TEST(MovingCamera, SeesTheMeanOfManyMoments) {
    Scene scene;
    scene.materials.push_back(lambert(0.6f));
    add_mesh(scene, bumpy(3, 1, 0.3), {{}, {0.2, 0, 4}});
    add_sphere(scene, 0.01, {-0.9, 0.5, 4});  // half a pixel wide
    add_mesh(scene, box(6, 6, 0.1), {{}, {0, 0, 6}});
    add_sun(scene, {0.4, -0.5, -1});
    const auto moved = [&](std::size_t body) {
        Rigid3 T = scene.bodies[body].initial.T_world_body;
        return Rigid3{exp_rotation({0, 0.3, 0.2}) * T.q, T.t + Vec3{0.2, 0.1, -0.2}};
    };
    BodyPoses moving(3);
    for (std::size_t b = 0; b < 3; ++b) moving.set(b, scene.bodies[b].initial.T_world_body);
    for (std::size_t b = 0; b < 2; ++b) moving.set(b, moving.T_world_body[b], moved(b));
    const CameraPose pose({exp_rotation({0.02, -0.05, 0}), {-0.1, 0, 0}},
                          {exp_rotation({0, 0.05, 0.1}), {0.1, 0, 0.2}});
    FrameSettings settings;
    settings.method = RenderSettings::Method::path;
    settings.max_depth = 3;
    settings.spp = 128;
    Aovs aovs;
    const RadianceImage blurred = rendered(scene, moving, kCamera, pose, settings, &aovs);
    constexpr int kMoments = 32;
    settings.spp = 8;
    std::vector<double> mean(blurred.pixels.size());
    for (int k = 0; k < kMoments; ++k) {
        const double time = (k + 0.5) / kMoments;
        BodyPoses at(3);
        for (std::size_t b = 0; b < 3; ++b) at.set(b, moving.T_world_body_at(b, time));
        settings.frame = static_cast<std::uint32_t>(k);
        const RadianceImage moment = rendered(scene, at, kCamera, CameraPose(pose.at(time)), settings);
        for (std::size_t i = 0; i < mean.size(); ++i) mean[i] += static_cast<double>(moment.pixels[i].y) / kMoments;
    }
    constexpr int kBlock = 8;
    double light = 0, expected = 0, squared_error = 0, squares = 0;
    for (int y = 0; y < kHeight; y += kBlock)
        for (int x = 0; x < kWidth; x += kBlock) {
            double of_block = 0, expected_of_block = 0;
            for (int i = 0; i < kBlock * kBlock; ++i) {
                const int px = x + i % kBlock, py = y + i / kBlock;
                of_block += value(blurred, px, py);
                expected_of_block += mean[static_cast<std::size_t>(py * kWidth + px)];
            }
            light += of_block, expected += expected_of_block;
            squared_error += (of_block - expected_of_block) * (of_block - expected_of_block);
            squares += expected_of_block * expected_of_block;
        }
    EXPECT_NEAR(light / expected, 1, 1e-3);
    EXPECT_LT(std::sqrt(squared_error / squares), 0.003);
    // The outputs beside it are of mid-exposure.
    BodyPoses middle(3);
    for (std::size_t b = 0; b < 3; ++b) middle.set(b, moving.T_world_body[b]);
    Aovs of_moment;
    settings.spp = 1;
    rendered(scene, middle, kCamera, CameraPose(pose.middle()), settings, &of_moment);
    EXPECT_EQ(aovs.body, of_moment.body);
    for (std::size_t i = 0; i < aovs.depth_m.size(); ++i)
        if (aovs.body[i] >= 0) {
            EXPECT_NEAR(aovs.depth_m[i], of_moment.depth_m[i], 1e-9);
        }
}

TEST(MovingCamera, AtRestAmongBodiesAtRestRendersTheSameBytesAsOneMoment) {
    Scene scene;
    scene.materials.push_back(lambert(0.6f));
    add_mesh(scene, bumpy(3, 1, 0.3), {{}, {0.2, 0, 4}});
    add_sphere(scene, 0.01, {-0.9, 0.5, 4});
    add_sun(scene, {0.4, -0.5, -1});
    const Rigid3 T{exp_rotation({0.02, -0.05, 0}), {-0.1, 0, 0}};
    FrameSettings settings;
    for (const int spp : {1, 4})
        for (const auto method : {RenderSettings::Method::direct, RenderSettings::Method::path}) {
            settings.spp = spp;
            settings.method = method;
            EXPECT_EQ(rendered(scene, kCamera, CameraPose(T, T, 0.01), settings).pixels,
                      rendered(scene, kCamera, T, settings).pixels);
        }
}

}  // namespace
}  // namespace narpa
