// The displacement of a target between render and frame, and its uncertainty: images of which the truth is known.
#include "estimator/view/image_shift.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace narpa {
namespace {

constexpr int kSide = 140;
constexpr double kShown = 0.5 * kSide, kRadius = 40;

using Light = std::function<double(double x, double y)>;

/// A ball lit from the left, with bumps of about ten pixels.
double ball(double x, double y) {
    const double u = (x - kShown) / kRadius, v = (y - kShown) / kRadius, r2 = u * u + v * v;
    if (r2 >= 1) return 0;
    const double shade = std::max(0.0, 0.8 * std::sqrt(1 - r2) - 0.6 * u);
    return 1000 * shade * (1 + 0.15 * std::sin(0.6 * x + 0.2 * y) * std::cos(0.5 * y - 0.1 * x));
}

std::vector<double> image_of(const Light& light, double noise, std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::normal_distribution<double> normal(0, noise);
    std::vector<double> out;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            double sum = 0;  // the mean over the pixel
            for (const double dy : {-0.25, 0.25})
                for (const double dx : {-0.25, 0.25}) sum += 0.25 * light(x + dx, y + dy);
            out.push_back(sum + (noise > 0 ? normal(random) : 0));
        }
    return out;
}

std::optional<ImageShift> found(const Light& frame, const Light& render, double noise = 0, std::uint64_t seed = 1) {
    const std::vector<double> of_frame = image_of(frame, noise, seed), of_render = image_of(render, 0, 1);
    std::vector<std::uint8_t> lit;
    for (const double v : of_render) lit.push_back(v > 20);
    return find_shift({of_frame, of_render, lit, kSide, kSide});
}

Light moved(const Light& light, double dx, double dy) {
    return [=](double x, double y) { return light(x - dx, y - dy); };
}

/// Squared error in units of the stated variances.
double squared_error(const ImageShift& s, double dx, double dy) {
    return std::pow((s.x_px - dx) / s.sigma_x_px, 2) + std::pow((s.y_px - dy) / s.sigma_y_px, 2);
}

TEST(ImageShift, IsWithinItsUncertaintyOfNoise) {
    double squares = 0;
    constexpr int kFrames = 20;
    for (int k = 0; k < kFrames; ++k) {
        const double dx = 0.37 * k - 4, dy = 3 - 0.29 * k;
        const auto s = found(moved(ball, dx, dy), ball, 500, 5 + static_cast<std::uint64_t>(k));
        ASSERT_TRUE(s && s->not_determined.empty() && !s->is_at_limit);
        EXPECT_LT(std::max(s->sigma_x_px, s->sigma_y_px), 1);
        EXPECT_LT(squared_error(*s, dx, dy), 30) << k;
        squares += squared_error(*s, dx, dy) / 2;
    }
    EXPECT_GT(squares / kFrames, 0.2);
    EXPECT_LT(squares / kFrames, 2);
}

/// A model whose brightness is wrong over whole regions, as of another law of reflection or albedo: its largest
/// correlation is beside the truth, and its detail is not.
TEST(ImageShift, OfAModelWithAnotherBrightnessIsThatOfTheDetail) {
    for (const double strength : {0.3, 0.6, 0.9}) {
        const Light other = [=](double x, double y) {
            return ball(x, y) * (1 + strength * std::sin((x + 2 * y) / 45)) *
                   (1 - 0.4 * strength * (x - kShown) / kRadius);
        };
        const auto s = found(moved(other, -3, 2), ball, 5);
        ASSERT_TRUE(s);
        if (!s->not_determined.empty()) continue;
        EXPECT_LT(squared_error(*s, -3, 2), 12)
            << strength << ": " << s->x_px << " +- " << s->sigma_x_px << ", " << s->y_px << " +- " << s->sigma_y_px;
        EXPECT_LT(std::hypot(s->x_px + 3, s->y_px - 2), 1.5);
    }
}

/// Wholly other detail, brightness and edge: nothing tells the shift but the coarse outline.
TEST(ImageShift, OfAnotherBodyIsUncertain) {
    const Light other = [](double x, double y) {
        const double u = (x - kShown) / 46, v = (y - kShown) / 33, r2 = u * u + v * v;
        if (r2 >= 1) return 0.0;
        return 1000 * std::max(0.0, 0.7 * std::sqrt(1 - r2) + 0.6 * v) *
               (1 + 0.3 * std::sin(0.3 * x) * std::cos(0.4 * y));
    };
    const auto s = found(moved(other, 2, -1), ball, 5);
    ASSERT_TRUE(s);
    if (s->not_determined.empty()) {
        EXPECT_GT(std::max(s->sigma_x_px, s->sigma_y_px), 0.5);
        EXPECT_LT(squared_error(*s, 2, -1), 25);
    }
}

/// A straight edge tells the shift across it alone; a ramp and noise tell none.
TEST(ImageShift, IsNotDeterminedWhereTheImageDoesNotSay) {
    const Light edge = [](double x, double) { return 500 / (1 + std::exp((x - kShown) / 3)); };
    const Light ramp = [](double x, double y) { return 400 + x + 0.5 * y; };
    for (const Light& light : {edge, ramp}) {
        const auto s = found(light, light, 20);
        ASSERT_TRUE(s);
        EXPECT_NE(s->not_determined.find("parts of the image differ by"), std::string::npos)
            << s->x_px << " +- " << s->sigma_x_px << ", " << s->y_px << " +- " << s->sigma_y_px;
    }
    EXPECT_FALSE(found(
        ball, [](double, double) { return 300.0; }, 5))
        << "a uniform render";
}

}  // namespace
}  // namespace narpa
