// The scene's detector recovered from frames of a flat field alone, by the procedure of EMVA 1288 (release 4.0
// linear): two images at each of 20 levels of light, dark images at several exposure times, and means of 64 images
// in the dark and at half of saturation. Radiance is the only input; seeds are fixed.
//
// 512 x 512 pixels. Standard errors: a temporal variance of two images 0.28 %, so the gain by 14 levels 0.1 %; the
// read noise of four pairs 0.07 % and the gain's; PRNU and DSNU 0.14 % and the gain's; full well and dark current
// 0.1 %, which is the gain's. The bound of 1 % is more than four of each.
#include <gtest/gtest.h>

#include <array>

#include "renderer/detector/sensor_array.h"
#include "renderer/scene_file/scene_file.h"
#include "tests/renderer/detector/detector_support.h"
#include "tests/renderer/scene_file/scene_support.h"

namespace narpa {
namespace {

using namespace test;

constexpr int kFieldSide = 512;
constexpr double kFieldPixels = kFieldSide * kFieldSide;

Camera camera_of_scene(const std::string& detector) {
    const MemoryFolder folder;
    const auto scene = read_scene(folder.write("flat.toml", R"([ambient]
radiance = 1
[[body]]
name = "b"
sphere = {radius_m = 1}
[[camera]]
name = "flat"
resolution = [512, 512]
fov_diagonal_deg = 10
rate_hz = 0.2
format = "Y16"
[camera.detector]
)" + detector));
    EXPECT_TRUE(scene) << scene.error().text();
    return scene->cameras.at(0);
}

/// A camera in front of an evenly lit field.
class FlatFieldBench {
public:
    explicit FlatFieldBench(const Camera& camera) : camera_(camera), array_(SensorArray::create(camera, kSeed)) {}

    /// DN of the next image.
    std::vector<int> image(double radiance) {
        const auto level = static_cast<float>(radiance);
        std::fill(field_.pixels.begin(), field_.pixels.end(), Rgb{level, level, level});
        expose(camera_, field_, kSeed, frame_++, bytes_, array_.get());
        std::vector<int> dn(bytes_.size() / 2);
        for (std::size_t i = 0; i < dn.size(); ++i)
            dn[i] = (bytes_[2 * i] | bytes_[2 * i + 1] << 8) >> (16 - camera_.detector->bits);
        return dn;
    }
    /// Mean and temporal variance by two images.
    Moments pair(double radiance) {
        const std::vector<int> a = image(radiance), b = image(radiance);
        double sum = 0, difference = 0, squares = 0;
        for (std::size_t i = 0; i < a.size(); ++i) {
            sum += a[i] + b[i], difference += a[i] - b[i];
            squares += static_cast<double>((a[i] - b[i]) * (a[i] - b[i]));
        }
        difference /= kFieldPixels;
        return {sum / (2 * kFieldPixels), (squares / kFieldPixels - difference * difference) / 2};
    }
    /// Mean and spatial variance of the mean of 64 images, without what is left of the temporal variance.
    Moments spatial(double radiance) {
        constexpr int kImages = 64;
        std::vector<double> sum(field_.pixels.size()), squares(field_.pixels.size());
        for (int k = 0; k < kImages; ++k) {
            const std::vector<int> dn = image(radiance);
            for (std::size_t i = 0; i < dn.size(); ++i) sum[i] += dn[i], squares[i] += dn[i] * dn[i];
        }
        double mean = 0, of_means = 0, temporal = 0;
        for (std::size_t i = 0; i < sum.size(); ++i) {
            const double m = sum[i] / kImages;
            mean += m / kFieldPixels, of_means += m * m / kFieldPixels;
            temporal += (squares[i] / kImages - m * m) * kImages / (kImages - 1) / kFieldPixels;
        }
        return {mean, of_means - mean * mean - temporal / kImages};
    }
    Camera& camera() { return camera_; }

private:
    static constexpr std::uint64_t kSeed = 1288;
    Camera camera_;
    std::unique_ptr<SensorArray> array_;
    RadianceImage field_{kFieldSide, kFieldSide};
    std::vector<std::uint8_t> bytes_ = std::vector<std::uint8_t>(2 * kFieldSide * kFieldSide);
    std::uint32_t frame_ = 0;
};

/// Slope and offset of the least-squares line.
std::array<double, 2> line(const std::vector<double>& x, const std::vector<double>& y) {
    const auto n = static_cast<double>(x.size());
    double sx = 0, sy = 0, xx = 0, xy = 0;
    for (std::size_t i = 0; i < x.size(); ++i) sx += x[i], sy += y[i], xx += x[i] * x[i], xy += x[i] * y[i];
    const double slope = (n * xy - sx * sy) / (n * xx - sx * sx);
    return {slope, (sy - slope * sx) / n};
}

#define FLAT_FIELD_DETECTOR                                                                                     \
    "exposure_s = 0.01\npixel_pitch_m = 5e-6\nf_number = 8\nquantum_efficiency = 0.6\nbits = 12\nshot_noise = " \
    "true\n"                                                                                                    \
    "black_level_dn = 100\ngain_e_per_dn = 5\nread_noise_e = 12\nfull_well_e = 18000\n"

TEST(PhotonTransfer, FramesGiveTheScenesGainNoiseFullWellAndLinearity) {
    FlatFieldBench bench(camera_of_scene(FLAT_FIELD_DETECTOR "prnu = 0.01\ndsnu_e = 8\n"));
    const Detector scene = *bench.camera().detector;
    const double saturation = static_cast<double>(radiance_for(scene, scene.full_well_e).x);

    double dark_mean = 0, dark_variance = 0;
    for (int k = 0; k < 4; ++k) {
        const Moments m = bench.pair(0);
        dark_mean += m.mean / 4, dark_variance += m.variance / 4;
    }
    // The gain is the slope of the variance over the mean, up to 70 % of saturation.
    std::vector<double> light, signal, means, variances;
    for (int level = 1; level <= 20; ++level) {
        const double radiance = saturation * level / 20;
        const Moments m = bench.pair(radiance);
        if (level <= 14) means.push_back(m.mean - dark_mean), variances.push_back(m.variance - dark_variance);
        if (level <= 19) light.push_back(radiance), signal.push_back(m.mean - dark_mean);
    }
    double xy = 0, xx = 0;  // weighted by 1 / variance^2, through zero
    for (std::size_t i = 0; i < means.size(); ++i) {
        const double weight = 1 / (variances[i] * variances[i]);
        xy += weight * means[i] * variances[i], xx += weight * means[i] * means[i];
    }
    const double gain_e_per_dn = xx / xy;
    EXPECT_NEAR(gain_e_per_dn / scene.gain_e_per_dn, 1, 0.01);
    EXPECT_NEAR(gain_e_per_dn / scene.gain_e_per_dn, 1, 0.005) << "five standard errors";

    const double read_noise_e = std::sqrt(dark_variance - 1.0 / 12) * gain_e_per_dn;
    EXPECT_NEAR(read_noise_e / scene.read_noise_e, 1, 0.01);

    const double full_well_e = (bench.pair(3 * saturation).mean - dark_mean) * gain_e_per_dn;
    EXPECT_NEAR(full_well_e / scene.full_well_e, 1, 0.01);

    // Linearity error: deviations from the line of least squares between 5 % and 95 %, of each signal, in percent.
    const auto [slope, offset] = line(light, signal);
    double error = 0;
    for (std::size_t i = 0; i < light.size(); ++i)
        error += 100 * std::abs(signal[i] / (slope * light[i] + offset) - 1) / static_cast<double>(light.size());
    EXPECT_LT(error, 0.02) << "0.005 % is the standard error of the lowest mean";

    // Responsivity: electrons per radiance, hence the quantum efficiency.
    const double per_radiance = scene.full_well_e / saturation;
    EXPECT_NEAR(slope * gain_e_per_dn / per_radiance, 1, 0.01);
}

TEST(PhotonTransfer, FramesGiveTheScenesPrnuAndDsnu) {
    FlatFieldBench bench(camera_of_scene(FLAT_FIELD_DETECTOR "prnu = 0.012\ndsnu_e = 9\n"));
    const Detector scene = *bench.camera().detector;
    const double half = static_cast<double>(radiance_for(scene, scene.full_well_e / 2).x);
    // The gain is recovered above; here it is found the same way by one level.
    const Moments dark_pair = bench.pair(0);
    double gain_dn = 0;
    for (int k = 0; k < 4; ++k) {
        const Moments lit = bench.pair(half);
        gain_dn += (lit.variance - dark_pair.variance) / (lit.mean - dark_pair.mean) / 4;
    }
    const Moments dark = bench.spatial(0), lit = bench.spatial(half);
    const double dsnu_e = std::sqrt(dark.variance) / gain_dn;
    EXPECT_NEAR(dsnu_e / site_amounts(scene).dsnu_e, 1, 0.01);
    const double prnu = std::sqrt(lit.variance - dark.variance) / (lit.mean - dark.mean);
    EXPECT_NEAR(prnu / site_amounts(scene).prnu, 1, 0.01);
}

TEST(PhotonTransfer, FramesGiveTheScenesDarkCurrentAtItsTemperature) {
    // 80 e-/s at 20 degrees, 160 at 26: by the mean and by the variance over six exposure times, EMVA 1288
    // section 7.
    FlatFieldBench bench(camera_of_scene(
        FLAT_FIELD_DETECTOR
        "dark_current_e_s = 80\ntemperature_c = 26\ndark_doubling_c = 6\ndsnu_e = 8\nprnu = 0.01\n"));
    const Detector scene = *bench.camera().detector;
    std::vector<double> times, means, variances;
    for (const double exposure_s : {0.001, 0.8, 1.6, 2.4, 3.2, 4.0}) {
        bench.camera().detector->exposure_s = exposure_s;
        double mean = 0, variance = 0;
        for (int k = 0; k < 4; ++k) {
            const Moments m = bench.pair(0);
            mean += m.mean / 4, variance += m.variance / 4;
        }
        times.push_back(exposure_s), means.push_back(mean), variances.push_back(variance);
    }
    bench.camera().detector->exposure_s = scene.exposure_s;
    const Moments dark = bench.pair(0);
    double gain_dn = 0;
    for (int k = 0; k < 4; ++k) {
        const Moments lit = bench.pair(static_cast<double>(radiance_for(scene, 9000).x));
        gain_dn += (lit.variance - dark.variance) / (lit.mean - dark.mean) / 4;
    }
    EXPECT_NEAR(line(times, means)[0] / gain_dn / 160, 1, 0.01);
    EXPECT_NEAR(line(times, variances)[0] / (gain_dn * gain_dn) / 160, 1, 0.01);
}

TEST(PhotonTransfer, ExposureInStopsDoublesTheLight) {
    const auto mean_of = [](const std::string& stops) {
        FlatFieldBench bench(camera_of_scene(FLAT_FIELD_DETECTOR + stops));
        return bench.pair(1).mean - 100;  // 1720 e- without stops
    };
    const double once = mean_of("");
    for (const int stops : {1, 2, 3})
        EXPECT_NEAR(mean_of("exposure_stops = " + std::to_string(stops) + "\n") / once, std::exp2(stops),
                    0.005 * std::exp2(stops));
}

}  // namespace
}  // namespace narpa
