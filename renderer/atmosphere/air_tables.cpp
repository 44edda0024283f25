#include "renderer/atmosphere/air_tables.h"

#include <limits>

namespace narpa {

AirTables::AirTables(const Air& air, const AirResolution& resolution, double sun_radius_rad)
    : column_heights(static_cast<std::size_t>(resolution.column_heights)),
      column_angles(static_cast<std::size_t>(resolution.column_angles)),
      heights(static_cast<std::size_t>(resolution.heights)),
      suns(static_cast<std::size_t>(resolution.suns)),
      lanes(air.lanes()),
      ground_m(static_cast<float>(air.ground_radius_m())),
      top_m(static_cast<float>(air.top_radius_m())),
      horizon_m(static_cast<float>(
          std::sqrt((air.top_radius_m() - air.ground_radius_m()) * (air.top_radius_m() + air.ground_radius_m())))),
      sun_radius(static_cast<float>(std::max(sun_radius_rad, 1e-5))) {
    fill_columns(air);
    set_scattered(std::vector<float>(entry(heights, 0)), std::vector<float>(suns * lanes));
}

void AirTables::fill_columns(const Air& air) {
    const PanelRule rule(PanelRule::kMaxNodes);
    const double ground = air.ground_radius_m(), top = air.top_radius_m();
    const double full = std::sqrt((top - ground) * (top + ground));
    columns.assign(4 * column_heights * column_angles, 0);
    for (std::size_t i = 0; i < column_heights; ++i) {
        const double horizon = full * static_cast<double>(i) / static_cast<double>(column_heights - 1);
        const double r = std::sqrt(ground * ground + horizon * horizon);
        for (std::size_t j = 0; j < column_angles; ++j) {
            const double least = top - r, most = horizon + full;
            const double d =
                least + (most - least) * static_cast<double>(j) / static_cast<double>(column_angles - 1);
            // r^2 + d^2 + 2 r d mu = top^2
            double mu = d > 0 ? ((top - r) * (top + r) - d * d) / (2 * r * d) : 1;
            mu = std::clamp(mu, -horizon / r, 1.0);
            const Vec3 direction{std::sqrt((1 - mu) * (1 + mu)), 0, mu};
            const AirColumns c =
                columns_along(air, rule, {0, 0, r}, direction, std::numeric_limits<double>::infinity());
            float* const to = &columns[4 * (i * column_angles + j)];
            to[0] = c.gas, to[1] = c.aerosol, to[2] = c.ozone;
        }
    }
}

double AirTables::height_m(const Air& air, std::size_t i) const {
    const double ground = air.ground_radius_m(), top = air.top_radius_m();
    const double horizon =
        std::sqrt((top - ground) * (top + ground)) * static_cast<double>(i) / static_cast<double>(heights - 1);
    return horizon * horizon / (ground + std::sqrt(ground * ground + horizon * horizon));
}

double AirTables::sun_cosine(std::size_t j) const {
    const double y = 2 * static_cast<double>(j) / static_cast<double>(suns - 1) - 1;
    return y >= 0 ? y * y : -static_cast<double>(kLowestSun) * y * y;
}

Air::Spectrum AirTables::ground_irradiance(float sun_cosine) const noexcept {
    const auto [j, f] = axis_cell(sun_coordinate(sun_cosine), suns);
    Air::Spectrum out{};
    const float *const low = &irradiance[j * lanes], *const high = low + lanes;
    for (std::size_t l = 0; l < lanes; ++l) out[l] = low[l] + f * (high[l] - low[l]);
    return out;
}

void AirTables::set_scattered(std::vector<float> new_moments, std::vector<float> new_irradiance) {
    constexpr float kDark = 1e-25f;
    moments = std::move(new_moments);
    irradiance = std::move(new_irradiance);
    brightness.resize(2 * heights * suns);
    for (std::size_t i = 0; i < heights * suns; ++i) {
        float sum = 0;
        for (std::size_t l = 0; l < lanes; ++l) sum += moments[entry(0, i) + l];
        sum = std::max(sum, kDark);
        brightness[2 * i] = std::log(sum);
        brightness[2 * i + 1] = 1 / sum;
    }
}

}  // namespace narpa
