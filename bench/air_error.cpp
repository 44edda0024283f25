#include "bench/air_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/constants.h"
#include "bench/statistics.h"
#include "renderer/atmosphere/refraction/ray_bundle.h"
#include "renderer/atmosphere/refraction/refraction.h"
#include "renderer/atmosphere/scattering/hosek_wilkie.h"
#include "renderer/atmosphere/scattering/path_traced_air.h"
#include "renderer/atmosphere/scattering/scattered_light.h"

namespace narpa {
namespace {

constexpr double kSunRadius_rad = 0.00465, kArcsec = 3600 * kDegPerRad;

constexpr std::array kSunElevations_deg{60.0, 20.0, 5.0, -2.0, -6.0};

struct AirView {
    Vec3 from, direction, to_sun;
};

Vec3 sky_direction(double zenith_deg, double azimuth_deg) {
    const double z = zenith_deg * kRadPerDeg, a = azimuth_deg * kRadPerDeg;
    return {std::sin(z) * std::cos(a), std::sin(z) * std::sin(a), std::cos(z)};
}

std::vector<AirView> sky_views(const AirDescription& air) {
    std::vector<AirView> views;
    for (const double elevation : kSunElevations_deg)
        for (const double azimuth : {20.0, 100.0, 180.0}) {
            const Vec3 to_sun = sky_direction(90 - elevation, 0);
            for (const double zenith : {5.0, 45.0, 70.0, 84.0})
                views.push_back({{0, 0, air.ground_radius_m + 2}, sky_direction(zenith, azimuth), to_sun});
            views.push_back({{0, 0, air.ground_radius_m + 10'000}, sky_direction(80, azimuth), to_sun});
            // The limb from 400 km, and the ground below.
            const double r = air.ground_radius_m + 400'000;
            for (const double height : {5000.0, 25'000.0}) {
                const double dip = std::asin((air.ground_radius_m + height) / r) * kDegPerRad;
                views.push_back({{0, 0, r}, sky_direction(180 - dip, azimuth), to_sun});
            }
            views.push_back({{0, 0, r}, sky_direction(160, azimuth), to_sun});
        }
    return views;
}

std::vector<Rgb> seen(const ScatteredLight& light, const std::vector<AirView>& views) {
    std::vector<Rgb> out;
    for (const AirView& v : views)
        out.push_back(bands_of(light.air(), light.along(v.from, v.direction, kInfinity, v.to_sun).in_scattering));
    return out;
}

/// Views fainter than this part of the brightest are left out: a camera exposed for that one would not show them.
/// The night side of the limb goes down to 1e-8.
constexpr double kFaintest = 1e-3;

/// The views are grouped by elevation of the Sun.
void set_error(AirErrorRow& row, const std::vector<Rgb>& found, const std::vector<Rgb>& exact) {
    const std::size_t of_sun = exact.size() / kSunElevations_deg.size();
    double squares = 0;
    std::size_t n = 0;
    float brightest = 0;
    for (std::size_t i = 0; i < exact.size(); ++i) {
        if (i % of_sun == 0) {
            brightest = 0;
            for (const Rgb& view : std::span(exact).subspan(i, of_sun))
                brightest = std::max({brightest, view.x, view.y, view.z});
        }
        for (int band = 0; band < 3; ++band) {
            const double truth = static_cast<double>(exact[i][band]);
            if (truth < kFaintest * static_cast<double>(brightest)) continue;
            const double error = static_cast<double>(found[i][band]) / truth - 1;
            squares += error * error;
            row.most = std::max(row.most, std::abs(error));
            ++n;
        }
    }
    row.rms = std::sqrt(squares / static_cast<double>(n));
}

double ray_time_s(const ScatteredLight& light, const std::vector<AirView>& views) {
    constexpr int kRounds = 20;
    const double start = cpu_s(CLOCK_THREAD_CPUTIME_ID);
    for (int round = 0; round < kRounds; ++round) (void)seen(light, views);
    return (cpu_s(CLOCK_THREAD_CPUTIME_ID) - start) / (kRounds * static_cast<double>(views.size()));
}

std::vector<AirErrorRow> shell_rows() {
    std::vector<AirErrorRow> rows;
    const LapseAtmosphere air(281.85e-6, 283.15);
    const auto arcsec = [&](int count, double degrees) {
        return kArcsec * bend(shells_of(air, 6'371'000, 0, 80'000, count), degrees * kRadPerDeg).refraction_rad;
    };
    for (const int count : {10, 25, 50, 100, 200, 400, 800}) {
        AirErrorRow row{.setting = count, .is_default = count == 400};
        row.rms = std::abs(arcsec(count, 85) - arcsec(20'000, 85));
        row.most = std::abs(arcsec(count, 89) - arcsec(20'000, 89));
        const auto shells = shells_of(air, 6'371'000, 0, 80'000, count);
        const double start = cpu_s(CLOCK_THREAD_CPUTIME_ID);
        double sum = 0;
        for (int i = 0; i < 1000; ++i) sum += bend(shells, 1e-3 * i).refraction_rad;
        row.time_s = (cpu_s(CLOCK_THREAD_CPUTIME_ID) - start) / 1000 + 0 * sum;
        rows.push_back(row);
    }
    return rows;
}

/// A view is 4 x 4 tiles of 8 x 8 pixels, each a tenth of a degree wide, about a direction.
constexpr std::size_t kTilePixels = 64, kTilesAcross = 4, kViewPixels = kTilePixels * kTilesAcross * kTilesAcross;
std::array<RayBundle::Ray, kTilePixels> tile_of(const Vec3& direction, std::size_t column, std::size_t row) {
    const Vec3 across = normalized(cross(direction, Vec3{0, 0, 1})), upright = cross(across, direction);
    std::array<RayBundle::Ray, kTilePixels> rays;
    for (std::size_t i = 0; i < kTilePixels; ++i) {
        const double x = (static_cast<double>(8 * column + i % 8) - 15.5) * 0.1 * kRadPerDeg,
                     y = (static_cast<double>(8 * row + i / 8) - 15.5) * 0.1 * kRadPerDeg;
        rays[i] = {normalized(direction + x * across + y * upright), kInfinity};
    }
    return rays;
}

std::vector<Rgb> seen_in_tiles(const ScatteredLight& light, const std::vector<AirView>& views, float tolerance) {
    std::vector<Rgb> out;
    std::array<AirLight, kTilePixels> found;
    AirCache cells;
    for (const AirView& v : views)
        for (std::size_t tile = 0; tile < kTilesAcross * kTilesAcross; ++tile) {
            RayBundle(light, v.from, &v.to_sun, cells, tolerance)
                .trace(tile_of(v.direction, tile % kTilesAcross, tile / kTilesAcross), found);
            for (const AirLight& l : found) out.push_back(l.in_scattering);
        }
    return out;
}

std::vector<AirErrorRow> bundle_rows(const ScatteredLight& light, const std::vector<AirView>& views) {
    std::vector<AirErrorRow> rows;
    const auto exact = seen_in_tiles(light, views, 0);
    const long usual = std::lround(1e4 * static_cast<double>(RayBundle::kTolerance));
    for (const int ten_thousandths : {0, 2, 5, 7, 10, 20, 50}) {
        AirErrorRow row{.setting = ten_thousandths, .is_default = ten_thousandths == usual};
        const double start = cpu_s(CLOCK_THREAD_CPUTIME_ID);
        const auto found = seen_in_tiles(light, views, 1e-4f * static_cast<float>(ten_thousandths));
        row.time_s = (cpu_s(CLOCK_THREAD_CPUTIME_ID) - start) / (kViewPixels * static_cast<double>(views.size()));
        set_error(row, found, exact);
        rows.push_back(row);
    }
    return rows;
}

}  // namespace

AirErrors measure_air_errors(const std::function<void(const std::string&)>& progress) {
    AirErrors out;
    progress("shells");
    out.shells = shell_rows();
    const AirDescription earth = earth_air();
    const std::vector<AirView> views = sky_views(earth);
    const AirResolution usual;
    // Steps, with the same tables.
    const Air three(earth, 1);
    AirResolution fine = usual;
    fine.steps = 32;
    progress("steps");
    const auto exact_steps = seen(ScatteredLight(three, fine, kSunRadius_rad), views);
    for (const int steps : {4, 6, 8, 12, 16, 24}) {
        progress(fmt::format("{} steps", steps));
        AirResolution r = usual;
        r.steps = steps;
        const ScatteredLight light(three, r, kSunRadius_rad);
        AirErrorRow row{.setting = steps, .is_default = steps == usual.steps};
        set_error(row, seen(light, views), exact_steps);
        row.time_s = ray_time_s(light, views);
        out.steps.push_back(row);
    }
    // Tables.
    AirResolution finest = usual;
    finest.heights = 32, finest.suns = 96, finest.directions = 12;
    progress("the finest tables");
    const auto exact_tables = seen(ScatteredLight(three, finest, kSunRadius_rad), views);
    for (const int heights : {8, 12, 16, 24}) {
        progress(fmt::format("tables of {} heights", heights));
        AirResolution r = usual;
        r.heights = heights, r.suns = 2 * heights;
        const double start = cpu_s(CLOCK_PROCESS_CPUTIME_ID);
        const ScatteredLight light(three, r, kSunRadius_rad);
        AirErrorRow row{.setting = heights, .is_default = heights == usual.heights && r.suns == usual.suns};
        row.time_s = cpu_s(CLOCK_PROCESS_CPUTIME_ID) - start;
        row.bytes = light.bytes();
        set_error(row, seen(light, views), exact_tables);
        out.tables.push_back(row);
    }
    progress("tiles");
    out.bundles = bundle_rows(ScatteredLight(Air(earth, 2), usual, kSunRadius_rad), views);
    // Wavelengths.
    progress("8 wavelengths a band");
    const auto exact_bands = seen(ScatteredLight(Air(earth, 8), usual, kSunRadius_rad), views);
    for (const int per_band : {1, 2, 3, 4}) {
        progress(fmt::format("{} wavelengths a band", per_band));
        const ScatteredLight light(Air(earth, per_band), usual, kSunRadius_rad);
        AirErrorRow row{.setting = per_band, .is_default = per_band == 2};
        set_error(row, seen(light, views), exact_bands);
        row.time_s = ray_time_s(light, views);
        row.bytes = light.bytes();
        out.bands.push_back(row);
    }
    return out;
}

std::vector<SkyComparison> compare_skies(std::size_t paths,
                                         const std::function<void(const std::string&)>& progress) {
    constexpr double kGreen_m = 534.6e-9;
    std::vector<SkyComparison> out;
    for (const double turbidity : {1.5, 3.0, 6.0}) {
        progress(fmt::format("skies of turbidity {}", turbidity));
        const AirDescription air = earth_air(turbidity);
        const ScatteredLight light(Air(air, kGreen_m), {}, kSunRadius_rad);
        for (const double elevation : {60.0, 30.0, 10.0, 5.0, 3.0, 1.0}) {
            const HosekWilkieSky sky(turbidity, air.ground_albedo, elevation * kRadPerDeg);
            const Vec3 to_sun = sky_direction(90 - elevation, 0), from{0, 0, air.ground_radius_m + 2};
            const double sun_zenith = 90 - elevation;
            for (const auto& [zenith, azimuth] : {std::pair{sun_zenith - 1, 0.0},
                                                  {sun_zenith - 4, 0.0},
                                                  {sun_zenith, 8.0},
                                                  {0.0, 0.0},
                                                  {45.0, 90.0},
                                                  {45.0, 180.0},
                                                  {75.0, 90.0},
                                                  {87.0, 180.0}}) {
                const Vec3 d = sky_direction(zenith, azimuth);
                SkyComparison c{turbidity, elevation, zenith, azimuth};
                c.aureole = dot(d, to_sun) > std::cos(9 * kRadPerDeg);
                c.physical = static_cast<double>(light.along(from, d, kInfinity, to_sun).in_scattering[0]);
                c.hosek_wilkie = static_cast<double>(sky.radiance(d.z, dot(d, to_sun)).y);
                const PathTracedLight brute = path_traced_air(air, kGreen_m, from, d, to_sun, paths);
                c.path_traced = brute.radiance, c.path_traced_error = brute.error;
                out.push_back(c);
            }
        }
    }
    return out;
}

}  // namespace narpa
