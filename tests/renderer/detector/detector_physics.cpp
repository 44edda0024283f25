// Photons to digital numbers to bytes.
#include <gtest/gtest.h>

#include <numbers>

#include "renderer/detector/detector.h"
#include "renderer/detector/solar_bands.h"
#include "tests/renderer/detector/detector_support.h"

namespace narpa {
namespace {

using namespace test;

TEST(SolarBands, AreThoseOfABlackbodyAt5772K) {
    const double k = 1.380649e-23, sigma = 5.670374419e-8, T = kSolarTemperature_k;
    const double hc = kPlanck_j_s * kLightSpeed_m_s;
    for (const SolarBand& band : kSolarBands) {
        double power = 0, moment = 0;
        constexpr int steps = 2000;  // midpoint rule
        const double step = (band.high_m - band.low_m) / steps;
        for (int i = 0; i < steps; ++i) {
            const double l = band.low_m + (i + 0.5) * step;
            const double planck = 2 * hc * kLightSpeed_m_s / std::pow(l, 5) / std::expm1(hc / (l * k * T));
            power += planck * step;
            moment += planck * l * step;
        }
        EXPECT_NEAR(band.fraction, power * std::numbers::pi / (sigma * std::pow(T, 4)), 1e-8);
        EXPECT_NEAR(band.mean_wavelength_m, moment / power, 1e-15);
    }
}

TEST(Detector, ElectronsFollowThePhotonEquation) {
    Detector d;
    d.exposure_s = 0.002;
    d.pixel_pitch_m = 5.5e-6;
    d.f_number = 8;
    d.quantum_efficiency = 0.6;
    // 100 W/m2/sr, green: by hand, 100 pi 0.116191498 / (4 64) = 0.142588 W/m2 on the pixel; x 3.025e-11 m2 x 2 ms
    // = 8.62659e-15 J; a photon of 534.644 nm has 3.71549e-19 J: 23217.9 photons, 13930.7 electrons.
    EXPECT_NEAR(100 * electrons_per_radiance(d, 1), 13930.7, 1.0);
}

TEST(Detector, WithoutNoiseEveryPixelIsTheRoundedTruth) {
    Camera c = sensor(64, 16, PixelFormat::y16);
    c.detector->black_level_dn = 64;
    c.detector->full_well_e = 20000;
    const double gain = gain_e_per_dn(*c.detector);
    EXPECT_DOUBLE_EQ(gain, 20000.0 / (4095 - 64));
    for (const double electrons : {0.0, 3.3, 17.0, 1234.5, 19999.0}) {
        const auto dn = dn_of(c, radiance_for(*c.detector, electrons));
        for (const int v : dn) ASSERT_EQ(v, static_cast<int>(std::floor(64 + electrons / gain + 0.5))) << electrons;
    }
    EXPECT_EQ(bytes_of(c, {1, 2, 3}, 1, 1), bytes_of(c, {1, 2, 3}, 2, 9));  // nothing random is left
}

TEST(Detector, ClipsAtTheFullWellAndAtTheTopOfTheScale) {
    Camera c = sensor(8, 8, PixelFormat::y16);
    c.detector->bits = 10;
    c.detector->full_well_e = 5000;
    c.detector->gain_e_per_dn = 10;
    c.detector->black_level_dn = 20;
    for (const int v : dn_of(c, radiance_for(*c.detector, 1e6))) EXPECT_EQ(v, 520);  // the well is full first
    c.detector->gain_e_per_dn = 2;
    for (const int v : dn_of(c, radiance_for(*c.detector, 1e6))) EXPECT_EQ(v, 1023);  // the ADC is
    const float nan = std::numeric_limits<float>::quiet_NaN();
    for (const int v : dn_of(c, {nan, nan, nan})) EXPECT_EQ(v, 20);
    for (const int v : dn_of(c, {-5, -5, -5})) EXPECT_EQ(v, 20);
    const float infinity = std::numeric_limits<float>::infinity();
    for (const int v : dn_of(c, {infinity, 0, 0})) EXPECT_EQ(v, 1023);
    c.detector->shot_noise = true;
    for (const int v : dn_of(c, {infinity, infinity, infinity})) EXPECT_EQ(v, 1023);
    for (const int v : dn_of(c, {nan, -1, 0})) EXPECT_EQ(v, 20);
}

TEST(Detector, MeanOfNoisyPixelsIsTheTruthFromOneDnUp) {
    Camera c = sensor(1000, 1000, PixelFormat::y16);
    c.detector->black_level_dn = 64;
    c.detector->shot_noise = true;
    c.detector->read_noise_e = 8;
    const double gain = gain_e_per_dn(*c.detector);
    for (const double signal_dn : {1.0, 2.5, 4.0, 20.0, 300.0, 3000.0}) {
        const Rgb radiance = radiance_for(*c.detector, signal_dn * gain);
        std::vector<int> dn = dn_of(c, radiance);
        const Moments all = moments(dn);
        // A million pixels tell the signal alone from the truth to 5 standard errors, under 1 % at 1 DN ...
        const double standard_error = std::sqrt(all.variance / 1e6);
        EXPECT_NEAR(all.mean - 64, signal_dn, 5 * standard_error) << signal_dn;
        EXPECT_LT(standard_error, 1.1e-2 * signal_dn);
        // ... and 1e5 of them give level and pedestal to 0.1 %.
        dn.resize(100'000);
        EXPECT_NEAR(moments(dn).mean, 64 + signal_dn, 1e-3 * (64 + signal_dn)) << signal_dn;
    }
}

TEST(Detector, QuantisationBiasesFaintLightByLessThanOnePerMille) {
    // Rounding alone loses a signal of 1 DN or doubles it; 0.7 DN of noise before it carry the signal
    // through. The standard error of a frame of 1e5 pixels is 0.0025 DN, of the mean of all a quarter of 0.1 %.
    Camera c = sensor(500, 200, PixelFormat::y16);
    c.detector->full_well_e = 4e6;
    c.detector->gain_e_per_dn = 1000;
    c.detector->black_level_dn = 64;
    c.detector->shot_noise = true;
    c.detector->read_noise_e = 700;
    for (const auto& [signal_dn, frames] : {std::pair{1.0, 100u}, {2.5, 16u}}) {
        const Rgb radiance = radiance_for(*c.detector, signal_dn * 1000);
        double mean = 0;
        for (std::uint32_t frame = 0; frame < frames; ++frame) {
            const double one = moments(dn_of(c, radiance, 5, frame)).mean - 64;
            EXPECT_NEAR(one, signal_dn, 1e-3 * signal_dn + 5 * 0.0025);
            mean += one / frames;
        }
        EXPECT_NEAR(mean / signal_dn, 1, 1e-3);
    }
}

TEST(Detector, PhotonTransferCurveHasTheSlopeOfTheGain) {
    // variance[DN^2] = signal / gain + (read / gain)^2 + 1/12 (EMVA 1288, section 2.4).
    Camera c = sensor(500, 500, PixelFormat::y16);
    c.detector->shot_noise = true;
    c.detector->read_noise_e = 15;
    c.detector->gain_e_per_dn = 4;
    c.detector->full_well_e = 16000;
    c.detector->black_level_dn = 100;
    const double read_dn = 15.0 / 4;
    for (const double electrons : {0.0, 10.0, 31.0, 33.0, 100.0, 1000.0, 12000.0}) {
        const Moments m = moments(dn_of(c, radiance_for(*c.detector, electrons), 3));
        const double expected = electrons / 16 + read_dn * read_dn + 1.0 / 12;
        EXPECT_NEAR(m.variance / expected, 1, 5 * std::sqrt(2 / 250'000.0)) << electrons;
        EXPECT_NEAR(m.mean, 100 + electrons / 4, 5 * std::sqrt(expected / 250'000)) << electrons;
    }
}

TEST(Detector, SeedFrameAndBandGiveIndependentNoise) {
    Camera c = sensor(200, 200, PixelFormat::rgb24);
    c.detector->shot_noise = true;
    c.detector->exposure_s *= 0.1;
    const Rgb grey{30, 30, 30};
    const auto a = bytes_of(c, grey, 1, 1);
    EXPECT_EQ(a, bytes_of(c, grey, 1, 1));
    EXPECT_NE(a, bytes_of(c, grey, 1, 2));
    EXPECT_NE(a, bytes_of(c, grey, 2, 1));
    EXPECT_NE(a, bytes_of(c, grey, std::uint64_t{1} << 32 | 1, 1));
    double rg = 0, rr = 0, gg = 0, next = 0, mean_r = 0, mean_g = 0;
    const std::size_t n = a.size() / 3;
    for (std::size_t i = 0; i < n; ++i) mean_r += a[3 * i], mean_g += a[3 * i + 1];
    mean_r /= static_cast<double>(n), mean_g /= static_cast<double>(n);
    for (std::size_t i = 0; i + 1 < n; ++i) {
        const double r = a[3 * i] - mean_r, g = a[3 * i + 1] - mean_g;
        rg += r * g, rr += r * r, gg += g * g, next += r * (a[3 * i + 3] - mean_r);
    }
    ASSERT_GT(rr, 0);
    EXPECT_LT(std::abs(rg / std::sqrt(rr * gg)), 5 / std::sqrt(static_cast<double>(n)));
    EXPECT_LT(std::abs(next / rr), 5 / std::sqrt(static_cast<double>(n)));
}

TEST(Detector, FormatsCarryTheSameNumbers) {
    Camera c = sensor(4, 2, PixelFormat::y16);
    c.detector->bits = 12;
    const Rgb radiance = radiance_for(*c.detector, 9876);
    const int dn = dn_of(c, radiance)[0];
    c.format = PixelFormat::grey;
    EXPECT_EQ(bytes_of(c, radiance)[0], dn >> 4);
    // One band alone in colour is that band's own ideal pixel.
    c.format = PixelFormat::rgb24;
    const double green_e = 7000;
    const float l = static_cast<float>(green_e / electrons_per_radiance(*c.detector, 1));
    const auto rgb = bytes_of(c, {0, l, 0});
    EXPECT_EQ(rgb[0], 0);
    EXPECT_EQ(rgb[1], static_cast<int>(green_e / gain_e_per_dn(*c.detector) + 0.5) >> 4);
    EXPECT_EQ(rgb[2], 0);
}

TEST(IdealSensor, MapsWhiteToFullScale) {
    Camera c = camera(4, 1, 10);
    c.white_radiance = 200;
    c.format = PixelFormat::grey;
    EXPECT_EQ(bytes_of(c, {200, 200, 200})[0], 255);
    EXPECT_EQ(bytes_of(c, {500, 500, 500})[0], 255);
    EXPECT_EQ(bytes_of(c, {330, 0, 0})[0], 140);  // the mean of the bands, 140.25
    EXPECT_EQ(bytes_of(c, {0, 0, 0})[0], 0);
    c.format = PixelFormat::y16;
    const auto half = bytes_of(c, {100, 100, 100});
    EXPECT_EQ(half[0] | half[1] << 8, 32768);
    c.format = PixelFormat::rgb24;
    const auto rgb = bytes_of(c, {200, 100, 50});
    EXPECT_EQ((std::vector<int>{rgb[0], rgb[1], rgb[2]}), (std::vector<int>{255, 128, 64}));
}

TEST(IdealSensor, YuyvIsBt601LimitedRange) {
    Camera c = camera(2, 1, 10);
    c.white_radiance = 1;
    c.format = PixelFormat::yuyv;
    const auto yuyv = [&](const Rgb& a) {
        const auto b = bytes_of(c, a);
        EXPECT_EQ(b[0], b[2]);
        return std::vector<int>{b[0], b[1], b[3]};
    };
    // ITU-R BT.601 colour bars, 8 bits.
    EXPECT_EQ(yuyv({1, 1, 1}), (std::vector<int>{235, 128, 128}));
    EXPECT_EQ(yuyv({0, 0, 0}), (std::vector<int>{16, 128, 128}));
    EXPECT_EQ(yuyv({1, 0, 0}), (std::vector<int>{81, 90, 240}));
    EXPECT_EQ(yuyv({0, 1, 0}), (std::vector<int>{145, 54, 34}));
    EXPECT_EQ(yuyv({0, 0, 1}), (std::vector<int>{41, 240, 110}));
    // A red and a blue pixel share their chroma.
    RadianceImage image(2, 1);
    image.pixels = {{1, 0, 0}, {0, 0, 1}};
    std::vector<std::uint8_t> out(4);
    expose(c, image, 0, 0, out);
    EXPECT_EQ((std::vector<int>{out[0], out[1], out[2], out[3]}), (std::vector<int>{81, 165, 41, 175}));
}

}  // namespace
}  // namespace narpa
