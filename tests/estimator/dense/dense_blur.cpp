// What residuals say about a nuisance: of noise a standard normal number; a blur raises it. The size of sampling
// noise. Which pixels hold the pose.
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "estimator/dense/nuisance_fit.h"
#include "estimator/dense/photometric_fit.h"
#include "estimator/dense/sampling_noise.h"

namespace narpa {
namespace {

constexpr int kSide = 40;
constexpr double kAll = std::numeric_limits<double>::infinity();

/// A bright disc before the dark, whose edge is `blur_px` wide, and how it changes with six motions of a plane.
struct Disc {
    SensorModel sensor{.top_dn = 4095, .read_dn2 = 25};
    std::vector<float> signal, measured;
    std::vector<PixelDerivative> derivative;

    static double light(double x, double y, double blur_px) {
        const double inside = 12 - std::hypot(x - 19.3, y - 19.8);
        return 150 * (1 + std::erf(inside / (std::sqrt(2.0) * blur_px))) * (1 + 0.02 * (x - 20));
    }
    Disc() {
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x) {
                signal.push_back(static_cast<float>(light(x, y, 0.4)));
                const double gx = light(x + 0.5, y, 0.4) - light(x - 0.5, y, 0.4),
                             gy = light(x, y + 0.5, 0.4) - light(x, y - 0.5, 0.4);
                const double u = (x - 20) / 20.0, v = (y - 20) / 20.0;
                Eigen::Matrix<double, 6, 1> motions;
                motions << gx, gy, u * gx + v * gy, v * gx - u * gy, u * v * gx + v * v * gy,
                    u * u * gx + u * v * gy;
                derivative.emplace_back(motions.cast<float>());
            }
    }
    [[nodiscard]] PhotometricImages images() const {
        return {.width = kSide,
                .height = kSide,
                .sensor = sensor,
                .measured = measured,
                .measured_variance = {},
                .signal = signal,
                .signal_variance = {},
                .derivative = derivative};
    }
    /// Of a frame with this blur, after a fit.
    double score(double blur_px, std::mt19937_64& random, double noise_dn = 5) {
        std::normal_distribution<double> normal(0, noise_dn);
        measured.clear();
        for (int y = 0; y < kSide; ++y)
            for (int x = 0; x < kSide; ++x)
                measured.push_back(static_cast<float>(light(x, y, blur_px) + normal(random)));
        const std::vector<float> unmoved = signal;
        const PhotometricEquations first = equations(images(), {}, {1, kAll, 0});
        const Eigen::Matrix<double, 8, 1> step = first.information.inverse() * first.gradient;
        for (std::size_t p = 0; p < signal.size(); ++p)
            signal[p] += static_cast<float>(derivative[p].cast<double>().dot(step.head<6>()));
        const Exposure exposure{1 + step[6], step[7]};
        const double found = fit_nuisance(images(), exposure, {1, kAll, 0}, {laplacian()}, 0, 1).sigmas;
        signal = unmoved;
        return found;
    }
    /// Change of the disc by a blur.
    [[nodiscard]] std::vector<float> laplacian() const {
        std::vector<float> out(signal.size());
        for (std::size_t p = kSide; p + kSide < out.size(); ++p)
            out[p] = signal[p - 1] + signal[p + 1] + signal[p - kSide] + signal[p + kSide] - 4 * signal[p];
        return out;
    }
};

TEST(InformativePixels, AreTheFewestWithThatPartOfTheInformation) {
    Disc disc;
    std::mt19937_64 random(5);
    (void)disc.score(0.4, random);  // a frame
    const PhotometricImages images = disc.images();
    const Eigen::Matrix<double, 6, 6> covariance = equations(images, {}, {1, kAll, 0}).pose_information().inverse();
    const auto held = [&](std::size_t p) {
        const Eigen::Matrix<double, 6, 1> J = disc.derivative[p].cast<double>();
        return J.dot(covariance * J) / images.sensor.variance_dn2(static_cast<double>(disc.signal[p]));
    };
    const auto inside = [](std::size_t p) {
        const std::size_t x = p % kSide, y = p / kSide;
        return x > 0 && y > 0 && x < kSide - 1 && y < kSide - 1;
    };
    for (const double part : {0.5, 0.85}) {
        const auto chosen = informative_pixels(images, {}, part);
        double all = 0, of_chosen = 0, least = kAll, max_left = 0;
        std::size_t n = 0;
        for (std::size_t p = 0; p < chosen.size(); ++p) {
            if (!inside(p)) continue;
            all += held(p);
            if (chosen[p] != 0)
                of_chosen += held(p), least = std::min(least, held(p)), ++n;
            else
                max_left = std::max(max_left, held(p));
        }
        EXPECT_GE(of_chosen, 0.999 * part * all);
        EXPECT_LT(of_chosen - least, part * all);
        EXPECT_LT(max_left, 1.001 * least);
        EXPECT_LT(n, chosen.size() / 4);
    }
}

/// Whatever the noise's size: the sensor's is 5 DN.
TEST(NuisanceFit, OfNoiseIsAStandardNormalNumber) {
    Disc disc;
    std::mt19937_64 random(5);
    constexpr int kFrames = 300;
    for (const double noise_dn : {5.0, 15.0}) {
        double sum = 0, squares = 0;
        for (int i = 0; i < kFrames; ++i) {
            const double c = disc.score(0.4, random, noise_dn);
            sum += c, squares += c * c;
            EXPECT_LT(std::abs(c), 4) << i;
        }
        EXPECT_NEAR(sum / kFrames, 0, 0.2);
        EXPECT_NEAR(squares / kFrames, 1, 0.25);
    }
}

TEST(NuisanceFit, ShowsABlurThatTheModelDoesNotHave) {
    Disc disc;
    std::mt19937_64 random(6);
    for (int i = 0; i < 20; ++i) EXPECT_GT(disc.score(1.2, random), 4) << i;
}

/// What a motion explains is no nuisance of its own, and one that a prior limits widens the pose by it.
TEST(NuisanceFit, OfAMotionHasNoUnknowns) {
    Disc disc;
    std::mt19937_64 random(7);
    (void)disc.score(0.4, random);
    std::vector<float> motion;
    for (const PixelDerivative& J : disc.derivative) motion.push_back(2 * J[0]);
    const NuisanceFit fit = fit_nuisance(disc.images(), {}, {1, kAll, 0}, {motion}, 0.1, 1);
    EXPECT_EQ(fit.unknowns, 0);
    EXPECT_NEAR(std::sqrt(fit.covariance(0, 0)), 0.2, 1e-3);
    EXPECT_NEAR(fit.covariance(1, 1), 0, 1e-6);
}

/// Noise of the render and of a frame with a third of its samples: four times the render's variance.
TEST(SamplingFactor, IsThatOfTheResiduals) {
    Disc disc;
    std::mt19937_64 random(8);
    (void)disc.score(0.4, random);
    std::vector<float> variance;
    for (int y = 0; y < kSide; ++y)
        for (int x = 0; x < kSide; ++x) {
            const double off = std::abs(std::hypot(x - 19.3, y - 19.8) - 12);
            variance.push_back(off < 1 ? 100.0F : 0.0F);
        }
    for (std::size_t p = 0; p < variance.size(); ++p)
        disc.measured[p] = disc.signal[p] + static_cast<float>(std::normal_distribution<double>(
                                                0, std::sqrt(25 + 4 * static_cast<double>(variance[p])))(random));
    PhotometricImages images = disc.images();
    images.signal_variance = variance;
    EXPECT_NEAR(sampling_factor(images, {}, 50), 4, 1.2);
    EXPECT_DOUBLE_EQ(sampling_factor(images, {}, 2), 2);
    disc.measured = disc.signal;
    EXPECT_DOUBLE_EQ(sampling_factor(images, {}, 50), kLeastSamplingFactor);
}

}  // namespace
}  // namespace narpa
