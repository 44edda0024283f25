// A frame against a render: made-up images, of which everything is known.
#include "estimator/view/frame_comparison.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace narpa {
namespace {

constexpr int kWidth = 120, kHeight = 90;

/// A bright ball with a smooth edge, a disc of another body, and nothing else.
class Comparison : public testing::Test {
protected:
    static double light(double x, double y) {
        const double r = std::hypot(x - 60, y - 45);
        return r > 20 ? 0 : (1 + 0.3 * std::sin(x / 3) + 0.2 * std::cos(y / 4)) * std::min(1.0, (20 - r) / 3);
    }
    static std::size_t at(int x, int y) { return static_cast<std::size_t>(y * kWidth + x); }

    void SetUp() override {
        sensor.dn_per_radiance = {10, 10, 10};
        sensor.black_dn = 20, sensor.top_dn = 4095, sensor.clips_dn = 4095;
        sensor.read_dn2 = 9;
        render.signal.assign(at(0, kHeight), 0);
        render.body.assign(at(0, kHeight), -1);
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x) {
                const auto L = static_cast<float>(30 * light(x, y));
                render.signal[at(x, y)] = 30 * L;
                if (L > 0) render.body[at(x, y)] = 1;
            }
    }
    /// The same, moved, `gain` times as bright, above this black.
    MeasuredImage frame_of(double dx, double dy, double gain, double black_dn, bool noisy = true) {
        std::mt19937_64 random(3);
        std::normal_distribution<double> noise(0, noisy ? 3 : 0);
        MeasuredImage frame{kWidth, kHeight, {}};
        for (int y = 0; y < kHeight; ++y)
            for (int x = 0; x < kWidth; ++x)
                frame.dn.push_back(
                    static_cast<float>(black_dn + gain * 900 * light(x - dx, y - dy) + noise(random)));
        return frame;
    }
    FrameComparison compared(const MeasuredImage& frame) {
        const auto c = compare_frame(frame, sensor, render, 1);
        EXPECT_TRUE(c) << c.error().text();
        return c ? *c : FrameComparison{};
    }

    SensorModel sensor;
    ExpectedFrame render;
};

TEST_F(Comparison, TheSameFitsToItsNoise) {
    const FrameComparison c = compared(frame_of(0, 0, 1, 20));
    EXPECT_NEAR(c.black_dn, 20, 0.2);
    EXPECT_NEAR(c.gain, 1, 1e-3);
    ASSERT_TRUE(c.correlation);
    EXPECT_GT(*c.correlation, 0.9999);
    EXPECT_GT(c.overlap(), 0.99);
    ASSERT_TRUE(c.residual_noise);
    EXPECT_NEAR(*c.residual_noise, 1, 0.05);
    EXPECT_NEAR(c.residual_dn, 3, 0.15);
    ASSERT_TRUE(c.shift);
    EXPECT_LT(std::hypot(c.shift->x_px, c.shift->y_px), 0.02);
}

/// A narpa frame of one sample per pixel: each either shows the surface or not.
TEST_F(Comparison, NoiseOfTheFramesSamplesIsNoDifference) {
    MeasuredImage frame = frame_of(0, 0, 1, 20);
    std::mt19937_64 random(7);
    constexpr double kCovered = 0.8;
    std::bernoulli_distribution shows(kCovered);
    render.variance.assign(render.signal.size(), 0);
    for (std::size_t p = 0; p < frame.dn.size(); ++p) {
        const float full = render.signal[p];
        if (full <= 0) continue;
        render.variance[p] = static_cast<float>(kCovered * (1 - kCovered)) * full * full / 64;
        render.signal[p] = static_cast<float>(kCovered) * full;
        if (!shows(random)) frame.dn[p] -= full;
    }
    EXPECT_LT(compared(frame).overlap_beyond_noise(), 0.85) << "of a camera, whose pixels are not sampled";
    render.frame_variance_ratio = 64;
    const FrameComparison c = compared(frame);
    EXPECT_LT(c.overlap(), 0.85);
    EXPECT_GT(c.overlap_beyond_noise(), 0.99);
    ASSERT_TRUE(c.residual_noise);
    EXPECT_NEAR(*c.residual_noise, 1, 0.1);
}

TEST_F(Comparison, FindsBrightnessBlackAndShift) {
    const FrameComparison c = compared(frame_of(5.3, -2.6, 1.7, 35));
    EXPECT_NEAR(c.black_dn, 35, 0.2);
    ASSERT_TRUE(c.shift);
    EXPECT_NEAR(c.shift->x_px, 5.3, 0.1);
    EXPECT_NEAR(c.shift->y_px, -2.6, 0.1);
    EXPECT_FALSE(c.shift->is_at_limit);
    EXPECT_GT(c.shift->correlation, 0.99) << "at the nearest whole pixel";
    EXPECT_NEAR(c.gain, 1.7, 0.02) << "of a frame that is displaced too";
    EXPECT_LT(c.overlap(), 0.8);
    EXPECT_LT(c.overlap_beyond_noise(), 0.9) << "no noise explains a shift";
    EXPECT_NEAR(compared(frame_of(0, 0, 1.7, 35)).gain, 1.7, 2e-3);
}

/// What the frame shows in front of other bodies is theirs, and clipped pixels say nothing of brightness.
TEST_F(Comparison, LeavesOutOtherBodiesAndClippedPixels) {
    MeasuredImage frame = frame_of(0, 0, 1, 20);
    frame.clipped.assign(frame.dn.size(), 0);
    for (int y = 0; y < kHeight; ++y)
        for (int x = 0; x < 20; ++x) {
            render.body[at(x, y)] = 0;
            render.signal[at(x, y)] = 6000;
            frame.dn[at(x, y)] = 3000;
        }
    for (int x = 55; x < 62; ++x) frame.dn[at(x, 45)] = 500, frame.clipped[at(x, 45)] = 1;
    const FrameComparison c = compared(frame);
    EXPECT_NEAR(c.gain, 1, 1e-3);
    ASSERT_TRUE(c.correlation);
    EXPECT_GT(*c.correlation, 0.9999);
    EXPECT_GT(c.overlap(), 0.99);
}

/// A photograph shows a room behind the target.
TEST_F(Comparison, OfTheTargetAloneIgnoresWhatIsBehindIt) {
    MeasuredImage frame = frame_of(0, 0, 1.2, 20);
    for (std::size_t p = 0; p < frame.dn.size(); ++p)
        if (render.body[p] < 0) frame.dn[p] = 1500;
    render.knows_background = false;
    const FrameComparison c = compared(frame);
    EXPECT_NEAR(c.gain, 1.2, 2e-3);
    EXPECT_EQ(c.black_dn, 20) << "that of the sensor";
    ASSERT_TRUE(c.correlation);
    EXPECT_GT(*c.correlation, 0.9999);
    EXPECT_GT(c.overlap(), 0.99);
}

/// Bytes of a converter of twelve bits: their background is a number on an edge between two of them.
TEST_F(Comparison, KnowsTheBlackOfTruncatedNumbers) {
    sensor.black_dn = 64, sensor.rounding_dn2 = 16.0 * 16.0 / 12;
    for (int y = 0; y < kHeight; ++y)  // a small target
        for (int x = 0; x < kWidth; ++x)
            if (std::hypot(x - 60, y - 45) > 4) render.signal[at(x, y)] = 0, render.body[at(x, y)] = -1;
    std::mt19937_64 random(5);
    std::normal_distribution<double> noise(0, 3);
    MeasuredImage frame{kWidth, kHeight, {}};
    for (const float signal : render.signal)
        frame.dn.push_back(
            static_cast<float>(16 * std::floor((64 + static_cast<double>(signal) + noise(random)) / 16) + 7.5));
    const FrameComparison c = compared(frame);
    EXPECT_NEAR(c.black_dn, 64, 1);
    EXPECT_NEAR(c.gain, 1, 0.01);
    EXPECT_GT(c.overlap(), 0.97);
}

/// A few pixels that a glint saturates, and read noise takes below what counts as clipped.
TEST_F(Comparison, GlintsDoNotCount) {
    MeasuredImage frame = frame_of(0, 0, 1, 20);
    for (int x = 58; x < 62; ++x) render.signal[at(x, 45)] = 400'000, frame.dn[at(x, 45)] = 4094;
    const FrameComparison c = compared(frame);
    EXPECT_NEAR(c.gain, 1, 2e-3);
    ASSERT_TRUE(c.correlation);
    EXPECT_GT(*c.correlation, 0.999);
}

/// A wall that fills the view has neither correlation nor shift.
TEST_F(Comparison, OfAUniformView) {
    render.signal.assign(render.signal.size(), 500);
    render.body.assign(render.body.size(), 1);
    MeasuredImage frame{kWidth, kHeight, std::vector<float>(render.signal.size(), 520)};
    const FrameComparison c = compared(frame);
    EXPECT_NEAR(c.gain, 1, 1e-6);
    EXPECT_FALSE(c.correlation);
    EXPECT_FALSE(c.shift);
}

/// The render's own sampling noise is noise too.
TEST_F(Comparison, CountsTheNoiseOfTheRender) {
    render.variance.assign(render.signal.size(), 27);  // three times the sensor's
    const FrameComparison c = compared(frame_of(0, 0, 1, 20));
    EXPECT_NEAR(*c.residual_noise, 0.5, 0.03);
}

/// A camera without a detector has no noise to compare with; without background the black is the sensor's.
TEST_F(Comparison, WithoutNoiseAndWithoutBackground) {
    sensor.read_dn2 = 0;
    render.body.assign(render.body.size(), 1);
    const FrameComparison c = compared(frame_of(0, 0, 1, 20, false));
    EXPECT_FALSE(c.residual_noise);
    EXPECT_EQ(c.black_dn, 20);
    EXPECT_NEAR(c.gain, 1, 1e-6);
}

TEST_F(Comparison, ErrorsSayWhatIsDark) {
    const auto refusal = [&](const MeasuredImage& frame) {
        const auto c = compare_frame(frame, sensor, render, 1);
        return c ? std::string() : c.error().what;
    };
    EXPECT_NE(refusal(frame_of(0, 0, 0, 20)).find("nothing in it is brighter than its background"),
              std::string::npos);
    MeasuredImage white = frame_of(0, 0, 1, 20);
    white.clipped.assign(white.dn.size(), 1);
    EXPECT_NE(refusal(white).find("0 of its lit pixels are not clipped"), std::string::npos);
    render.signal.assign(render.signal.size(), 0);
    EXPECT_NE(refusal(frame_of(0, 0, 1, 20)).find("the render shows the target lit in 0 pixels"),
              std::string::npos);
}

}  // namespace
}  // namespace narpa
