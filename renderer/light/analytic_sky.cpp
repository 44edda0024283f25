#include "renderer/light/analytic_sky.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/constants.h"
#include "renderer/atmosphere/scattering/scattered_light.h"
#include "renderer/keys/toml_reader.h"

namespace narpa {
namespace {

constexpr int kSkyBands = 4, kSkySteps = 32;

constexpr TableKey kHosekWilkieRows[]{
    {"turbidity", rows::number({.low = 1, .high = 10})},
    {"ground_albedo", rows::number(kUnit)},
    {"up", rows::direction()},
};

std::shared_ptr<const Sky> read_analytic_sky(TableReader& table) {
    AnalyticSky sky;
    sky.up = table.direction("up").value_or(sky.up);
    table.read("turbidity", sky.turbidity);
    table.read("ground_albedo", sky.ground_albedo);
    return std::make_shared<AnalyticSky>(sky);
}

double elevation_of(const AnalyticSky& sky, const Sun& sun) {
    return std::asin(std::clamp(dot(normalized(sky.up), normalized(sun.direction)), 0.0, 1.0));
}

}  // namespace

constinit const SkyKind kHosekWilkie{"hosek-wilkie", kHosekWilkieRows, read_analytic_sky};

std::string AnalyticSky::problem(const Scene& scene) const {
    if (!scene.sun) return "a sky is lit by the Sun, expected a [sun]";
    if (dot(up, normalized(scene.sun->direction)) < 0)
        return "the Sun stands below this sky's horizon, where its model ends; expected a Sun above, or an "
               "[atmosphere], which has twilight";
    return {};
}

SkyLight AnalyticSky::make(const Scene& scene) const {
    if (!scene.sun) return {};
    return {std::make_unique<AnalyticSkyBackground>(*this, *scene.sun),
            std::make_unique<SunThroughAir>(*this, *scene.sun)};
}

Rgb sunlight_transmittance(double turbidity, double sun_elevation_rad) {
    const Air air(earth_air(turbidity), kSkyBands);
    const Vec3 direction{std::cos(sun_elevation_rad), 0, std::sin(sun_elevation_rad)};
    return transmittance_of(
        air, columns_along(air, PanelRule(kSkySteps), {0, 0, air.ground_radius_m()}, direction, kInfinity));
}

AnalyticSkyBackground::AnalyticSkyBackground(const AnalyticSky& given, const Sun& sun)
    : frame_(normalized(given.up)),
      model_(given.turbidity, given.ground_albedo, elevation_of(given, sun)),
      irradiance_(static_cast<float>(sun.irradiance_w_m2)),
      to_sun_(frame_.to_local(normalized(sun.direction))),
      row_end_(kRows),
      column_end_(kRows * kColumns),
      density_(kRows * kColumns) {
    constexpr double kCell = 2 * std::numbers::pi / (kRows * kColumns);  // solid angle
    double all = 0;
    Rgb horizontal{};
    for (std::size_t i = 0; i < kRows; ++i) {
        double row = 0;
        const double z = (static_cast<double>(i) + 0.5) / kRows, r = std::sqrt(1 - z * z);
        for (std::size_t j = 0; j < kColumns; ++j) {
            const Rgb light = sky(direction_at(r, z, (static_cast<double>(j) + 0.5) / kColumns));
            horizontal += static_cast<float>(z * kCell) * light;
            // A small floor keeps the density positive in every direction.
            density_[i * kColumns + j] =
                static_cast<double>(mean_band(light)) + 1e-9 * static_cast<double>(irradiance_);
            row += density_[i * kColumns + j];
            column_end_[i * kColumns + j] = row;
        }
        for (std::size_t j = 0; j < kColumns; ++j) column_end_[i * kColumns + j] /= row;
        all += row;
        row_end_[i] = all;
    }
    for (double& end : row_end_) end /= all;
    for (double& d : density_) d /= all * kCell;
    constexpr auto kInvPi = static_cast<float>(std::numbers::inv_pi);
    ambient_ = kInvPi * horizontal;
    const double elevation = elevation_of(given, sun);
    const Rgb direct =
        static_cast<float>(std::sin(elevation)) * irradiance_ * sunlight_transmittance(given.turbidity, elevation);
    ground_ = static_cast<float>(given.ground_albedo) * kInvPi * (horizontal + direct);
}

Rgb AnalyticSkyBackground::sky(const Vec3& local) const noexcept {
    return irradiance_ * model_.radiance(local.z, dot(local, to_sun_));
}

Rgb AnalyticSkyBackground::radiance(const Vec3& direction) const noexcept {
    const Vec3 local = frame_.to_local(direction);
    return local.z > 0 ? sky(local) : ground_;
}

BackgroundSample AnalyticSkyBackground::sample(double u, double v) const noexcept {
    const auto choose = [](const double* begin, std::size_t n, double& x) {
        const auto i = std::min(static_cast<std::size_t>(std::upper_bound(begin, begin + n, x) - begin), n - 1);
        const double from = i == 0 ? 0 : begin[i - 1];
        x = std::clamp((x - from) / std::max(begin[i] - from, 1e-300), 0.0, 1 - 1e-12);
        return i;
    };
    const std::size_t i = choose(row_end_.data(), kRows, u), j = choose(&column_end_[i * kColumns], kColumns, v);
    const double z = (static_cast<double>(i) + u) / kRows;
    const Vec3 local = direction_at(std::sqrt(1 - z * z), z, (static_cast<double>(j) + v) / kColumns);
    return {frame_.to_world(local), sky(local), density_[i * kColumns + j]};
}

double AnalyticSkyBackground::pdf(const Vec3& direction) const noexcept {
    const Vec3 local = frame_.to_local(direction);
    if (local.z <= 0) return 0;
    const auto i = std::min(static_cast<std::size_t>(local.z * kRows), kRows - 1);
    double turns = std::atan2(local.y, local.x) / (2 * std::numbers::pi);
    if (turns < 0) turns += 1;
    const auto j = std::min(static_cast<std::size_t>(turns * kColumns), kColumns - 1);
    return density_[i * kColumns + j];
}

SunThroughAir::SunThroughAir(const AnalyticSky& sky, const Sun& sun)
    : to_sun_(normalized(sun.direction)),
      cosine_(std::cos(0.5 * sun.angular_diameter_rad) - 1e-9),
      transmittance_(sunlight_transmittance(sky.turbidity, elevation_of(sky, sun))) {}

Rgb SunThroughAir::transmittance_of_ray(const Ray& ray, double range_m) const noexcept {
    if (range_m != kInfinity || dot(ray.direction, to_sun_) < cosine_) return {1, 1, 1};
    return transmittance_;
}

}  // namespace narpa
