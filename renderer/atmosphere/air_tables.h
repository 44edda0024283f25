/// renderer/atmosphere/air_tables.h - two-dimensional tables over height and direction, read by the ray march.
///
/// The height axis is the distance to the horizon, m, in equal steps.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "renderer/atmosphere/air_path.h"
#include "renderer/atmosphere/fast_exp.h"
#include "renderer/atmosphere/scattering/spherical_harmonics.h"

namespace narpa {

/// Resolution of the tables and of the ray march.
struct AirResolution {
    int steps = 12;               ///< quadrature nodes per panel of a ray (PanelRule)
    int heights = 16, suns = 32;  ///< of the table of scattered light
    int directions = 10;          ///< above and below the horizon each, times 9 azimuths
    int column_heights = 64, column_angles = 256;
    int max_orders = 40;
};

/// Direct sunlight at a point: the air columns that it crosses.
struct SunBeam {
    AirColumns columns;
    float visible;  ///< part of the disc above the horizon
};

class AirTables {
public:
    /// Fills the table of columns; the table of scattered light is zero. `sun_radius_rad`: half of its angular
    /// diameter.
    AirTables(const Air& air, const AirResolution& resolution, double sun_radius_rad);

    /// Columns to space. `horizon_m`: to the horizon; `cosine` of the zenith angle, not below the horizon's.
    [[nodiscard]] AirColumns to_space(float radius_m, float horizon_m, float cosine) const noexcept;
    [[nodiscard]] SunBeam sun_beam(float radius_m, float horizon_m, float sun_cosine) const noexcept;

    /// The four entries of the table of scattered light around a height and a solar elevation, with interpolation
    /// weights.
    struct Corners {
        const float* at[4];  ///< [harmonic][lane]
        float weight[4];
    };
    [[nodiscard]] Corners corners(float horizon_m, float sun_cosine) const noexcept;
    /// Irradiance of the ground, interpolated between two solar elevations.
    [[nodiscard]] Air::Spectrum ground_irradiance(float sun_cosine) const noexcept;

    /// Height and cosine of the solar zenith angle of the entries of the table of scattered light.
    [[nodiscard]] double height_m(const Air& air, std::size_t i) const;
    [[nodiscard]] double sun_cosine(std::size_t j) const;
    /// Offset of an entry in `moments`.
    [[nodiscard]] std::size_t entry(std::size_t height, std::size_t sun) const {
        return kHarmonics * lanes * (height * suns + sun);
    }
    /// Replaces the scattered light.
    void set_scattered(std::vector<float> new_moments, std::vector<float> new_irradiance);

    [[nodiscard]] std::size_t bytes() const {
        return sizeof(float) * (columns.size() + moments.size() + brightness.size() + irradiance.size());
    }

    std::size_t column_heights, column_angles, heights, suns, lanes;
    float ground_m, top_m, horizon_m;  ///< radii, and the distance from the horizon to the top
    float sun_radius;
    std::vector<float> columns;     ///< [height][angle][gas, aerosol, ozone, 0]
    std::vector<float> moments;     ///< [height][sun][harmonic][lane]
    std::vector<float> brightness;  ///< [height][sun][2]: log and inverse of the mean radiance summed over lanes
    std::vector<float> irradiance;  ///< [sun][lane]: of the ground

private:
    void fill_columns(const Air& air);
};

/// Position on an axis of `n` equally spaced entries from 0 to 1.
struct AxisCell {
    std::size_t index;
    float fraction;
};
inline AxisCell axis_cell(float x, std::size_t n) noexcept {
    const float clamped = std::min(std::max(x, 0.0f), 1.0f) * static_cast<float>(n - 1);
    const auto i = std::min(static_cast<std::size_t>(clamped), n - 2);
    return {i, clamped - static_cast<float>(i)};
}

/// Minus the lowest tabulated cosine of the Sun's zenith angle: 23.6 degrees below the horizon.
constexpr float kLowestSun = 0.4f;
/// Table coordinate of a solar elevation, 0 to 1; entries are dense at the horizon.
inline float sun_coordinate(float sun_cosine) noexcept {
    return sun_cosine >= 0 ? 0.5f + 0.5f * std::sqrt(sun_cosine)
                           : 0.5f - 0.5f * std::sqrt(-sun_cosine / kLowestSun);
}

/// Part of the Sun's disc above a horizon that stands `x` radii below its centre.
inline float disc_above(float x) noexcept {
    if (x >= 1) return 1;
    if (x <= -1) return 0;
    return 0.5f + (x * std::sqrt(1 - x * x) + std::asin(x)) * static_cast<float>(std::numbers::inv_pi);
}

/// Parametrised by the distance to the top (E. Bruneton, F. Neyret, EGSR 2008).
inline AirColumns AirTables::to_space(float radius_m, float from_horizon_m, float cosine) const noexcept {
    const float rise = (top_m - radius_m) * (top_m + radius_m), b = radius_m * cosine;
    const float root = std::sqrt(std::max(0.0f, b * b + rise));
    const float to_top = b < 0 ? root - b : rise / (b + root + 1e-3f);  // both free of cancellation
    const float least = top_m - radius_m, most = from_horizon_m + horizon_m;
    const auto [i, fi] = axis_cell(from_horizon_m / horizon_m, column_heights);
    const auto [j, fj] = axis_cell((to_top - least) / (most - least), column_angles);
    const float* const low = columns.data() + 4 * (i * column_angles + j);
    const float* const high = low + 4 * column_angles;
    std::array<float, 4> c;
    for (std::size_t k = 0; k < 4; ++k) {
        const float below = low[k] + fj * (low[k + 4] - low[k]), above = high[k] + fj * (high[k + 4] - high[k]);
        c[k] = below + fi * (above - below);
    }
    return {c[0], c[1], c[2]};
}

inline SunBeam AirTables::sun_beam(float radius_m, float from_horizon_m, float sun_cosine) const noexcept {
    const float horizon_cosine = -from_horizon_m / radius_m;
    SunBeam beam{};
    beam.visible = disc_above((sun_cosine - horizon_cosine) / (sun_radius * ground_m / radius_m));
    if (beam.visible > 0) beam.columns = to_space(radius_m, from_horizon_m, std::max(sun_cosine, horizon_cosine));
    return beam;
}

/// In twilight the light falls by orders of magnitude between entries: brightness is interpolated geometrically,
/// and radiance relative to the brightness linearly.
inline AirTables::Corners AirTables::corners(float from_horizon_m, float sun_cosine) const noexcept {
    const auto [i, fi] = axis_cell(from_horizon_m / horizon_m, heights);
    const auto [j, fj] = axis_cell(sun_coordinate(sun_cosine), suns);
    const std::size_t size = kHarmonics * lanes, low = i * suns + j, high = low + suns;
    const float* const m = moments.data();
    Corners c{{m + size * low, m + size * (low + 1), m + size * high, m + size * (high + 1)},
              {(1 - fi) * (1 - fj), (1 - fi) * fj, fi * (1 - fj), fi * fj}};
    const float *const of_low = brightness.data() + 2 * low, *const of_high = brightness.data() + 2 * high;
    const float* const b[4]{of_low, of_low + 2, of_high, of_high + 2};
    float mean = 0;
    for (std::size_t k = 0; k < 4; ++k) mean += c.weight[k] * b[k][0];
    constexpr float kShift = 8, kExpShift = 2980.958f;
    const float level = kExpShift * exp_of_negative(mean - kShift);
    for (std::size_t k = 0; k < 4; ++k) c.weight[k] *= level * b[k][1];
    return c;
}

}  // namespace narpa
