// The elevation model of the terrain scene: cratered ground.
#include <png.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "renderer/terrain/crater_profile.h"
#include "scenes/generate/noise.h"
#include "scenes/generate/scenes.h"
#include "scenes/generate/shapes.h"

namespace narpa::scenes {
namespace {

/// Craters above the diameter D, per square metre: k D^-2, a quarter of the equilibrium of small lunar ones (N.
/// Trask, JPL TR 32-800, 1966).
constexpr double kHighlandCraters = 0.02;
constexpr double kSmallestCrater_m = 2 * kHighlandSpacing_m, kLargestCrater_m = 500;

class HighlandPosts {
public:
    HighlandPosts() : metres_(static_cast<std::size_t>(kHighlandPosts) * kHighlandPosts) {
        for (int row = 0; row < kHighlandPosts; ++row)
            for (int column = 0; column < kHighlandPosts; ++column) at(column, row) = hills_m(column, row);
    }

    void add_crater(double column, double row, double diameter_m, double freshness) {
        const double radius = 0.5 * diameter_m / kHighlandSpacing_m, reach = kCraterReach * radius;
        const auto from = [&](double middle) { return std::max(0, static_cast<int>(std::ceil(middle - reach))); };
        const auto to = [&](double middle) {
            return std::min(kHighlandPosts - 1, static_cast<int>(middle + reach));
        };
        for (int j = from(row); j <= to(row); ++j)
            for (int i = from(column); i <= to(column); ++i) {
                const double r = std::hypot(i - column, j - row) / radius;
                if (r < kCraterReach) at(i, j) += freshness * diameter_m * crater_profile(r);
            }
    }
    /// 16 bits from 0 at -kHighlandZero_m on, in steps of kHighlandStep_m.
    void write(const std::string& path) const {
        std::vector<png_uint_16> numbers;
        numbers.reserve(metres_.size());
        for (const double h : metres_)
            numbers.push_back(static_cast<png_uint_16>(
                std::lround(std::clamp((h + kHighlandZero_m) / kHighlandStep_m, 0.0, 65535.0))));
        png_image image{};
        image.version = PNG_IMAGE_VERSION;
        image.width = image.height = kHighlandPosts;
        image.format = PNG_FORMAT_LINEAR_Y;
        if (!png_image_write_to_file(&image, path.c_str(), 0, numbers.data(), 0, nullptr))
            throw std::runtime_error(path + ": " + image.message);
    }

private:
    double& at(int column, int row) {
        return metres_[static_cast<std::size_t>(row) * kHighlandPosts + static_cast<std::size_t>(column)];
    }
    static double hills_m(int column, int row) {
        double sum = 0, height = 60, wavelength = 1800;
        for (std::uint64_t octave = 0; octave < 8; ++octave, height *= 0.42, wavelength *= 0.5)
            sum += height * value_noise(column * kHighlandSpacing_m / wavelength,
                                        row * kHighlandSpacing_m / wavelength, 1500 + octave);
        return sum;
    }

    std::vector<double> metres_;
};

}  // namespace

void write_highland(const std::string& path) {
    HighlandPosts heights;
    Random random(31);
    const double side_m = kHighlandPosts * kHighlandSpacing_m, area_m2 = side_m * side_m;
    const int count =
        static_cast<int>(kHighlandCraters * area_m2 *
                         (1 / (kSmallestCrater_m * kSmallestCrater_m) - 1 / (kLargestCrater_m * kLargestCrater_m)));
    for (int i = 0; i < count; ++i) {
        const double share = random.uniform(std::pow(kSmallestCrater_m / kLargestCrater_m, 2), 1);
        const double column = random.uniform(0, kHighlandPosts), row = random.uniform(0, kHighlandPosts);
        heights.add_crater(column, row, kSmallestCrater_m / std::sqrt(share), std::pow(random.uniform(), 2));
    }
    heights.write(path);
}

}  // namespace narpa::scenes
