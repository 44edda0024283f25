#include "renderer/atmosphere/scattering/scattered_light.h"

#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/each_isa.h"
#include "renderer/atmosphere/fast_exp.h"
#include "renderer/atmosphere/scattering/panel_scattering.h"

namespace narpa {
namespace {

constexpr float kSqrt4Pi = 3.5449077f;
constexpr AirColumns kBlocked{1e12f, 1e12f, 0};  ///< of a ray that the ground stops

/// Adds the irradiance of a surface, whose normal has the components nz along the zenith and nx towards the Sun.
NARPA_EACH_ISA void add_cosine_lobe(const AirTables::Corners& c, std::size_t lanes, float nz, float nx,
                                    Air::Spectrum& out) noexcept {
    // Coefficients of the clamped cosine by degree: pi, 2/3 pi, pi / 4, 0, -pi / 24, 0, pi / 64 (R. Ramamoorthi, P.
    // Hanrahan, SIGGRAPH 2001).
    constexpr std::array kLobe{3.14159265f, 2.09439510f, 0.78539816f, 0.0f, -0.13089969f, 0.0f, 0.04908739f};
    static_assert(kLobe.size() <= kMaxDegree + 1);
    Harmonics y;
    harmonics(nz, nx, kLobe.size() - 1, y);
    Air::Spectrum sum = out;
    std::size_t i = 0;
    for (std::size_t degree = 0; degree < kLobe.size(); ++degree) {
        if (kLobe[degree] == 0) {
            i += degree + 1;
            continue;
        }
        for (std::size_t m = 0; m <= degree; ++m, ++i)
            for (std::size_t l = 0; l < lanes; ++l) {
                const std::size_t at = i * lanes + l;
                sum[l] += kLobe[degree] * y[i] *
                          (c.weight[0] * c.at[0][at] + c.weight[1] * c.at[1][at] + c.weight[2] * c.at[2][at] +
                           c.weight[3] * c.at[3][at]);
            }
    }
    out = sum;
}

/// Adds direct light that the aerosol scatters into its forward peak, times `facing`.
NARPA_EACH_ISA void add_forward_peak(const Air& air, const SunBeam& beam, float facing,
                                     Air::Spectrum& out) noexcept {
    const float w = facing * beam.visible;
    const auto [gas, aerosol, ozone] = beam.columns;
    for (std::size_t l = 0; l < air.lanes(); l += 8) {
        Vector8 of_gas, of_ozone, scaled, whole, with_peak, without, sum;
        load(&air.gas[l], of_gas), load(&air.ozone[l], of_ozone);
        load(&air.scaled_extinction[l], scaled), load(&air.aerosol_extinction[l], whole), load(&out[l], sum);
        const Vector8 depth = of_gas * gas + of_ozone * ozone;
        exp_of_negative(-(depth + scaled * aerosol), with_peak);
        exp_of_negative(-(depth + whole * aerosol), without);
        sum += w * (with_peak - without);
        store(sum, &out[l]);
    }
}

/// exp(-optical depth).
NARPA_EACH_ISA void pass(const Air& air, const AirColumns& columns, Air::Spectrum& out) noexcept {
    for (std::size_t l = 0; l < air.lanes(); l += 8) {
        Vector8 of_gas, of_aerosol, of_ozone, passes;
        load(&air.gas[l], of_gas), load(&air.aerosol_extinction[l], of_aerosol), load(&air.ozone[l], of_ozone);
        exp_of_negative(-(of_gas * columns.gas + of_aerosol * columns.aerosol + of_ozone * columns.ozone), passes);
        store(passes, &out[l]);
    }
}

}  // namespace

ScatteredLight::ScatteredLight(const Air& air, const AirResolution& resolution, double sun_radius_rad, int threads)
    : air_(air), rule_(static_cast<std::size_t>(resolution.steps)), tables_(air, resolution, sun_radius_rad) {
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    arena.execute([&] { solve(resolution); });
}

double distance_to_horizon_m(const Air& air, double height_m) noexcept {
    return std::sqrt(std::max(0.0, height_m * (2 * air.ground_radius_m() + height_m)));
}

ScatteredLight::Segment ScatteredLight::along(const Vec3& origin, const Vec3& direction, double range_m,
                                              const Vec3& to_sun) const noexcept {
    Segment s;
    const PanelEnds ends = panel_ends(air_, origin, direction, range_m, &to_sun);
    if (ends.n < 2) return s;
    const AirTables& t = tables_;
    // Starts where the ray enters the air: a distant origin would cost precision.
    const double entry = ends.t_m[0];
    const Vec3 start = origin + entry * direction;
    const double r = norm(start);
    const AirRay ray{static_cast<float>(r), static_cast<float>(dot(start, direction) / r),
                     static_cast<float>(dot(start, to_sun) / r), static_cast<float>(dot(direction, to_sun))};
    AerosolPhase phase;
    set_phase(air_, ray.sun_nu, true, phase);
    AirPanel panel;
    PanelTransmittance through;
    for (std::size_t k = 0; k + 1 < ends.n; ++k) {
        fill_panel(air_, rule_, start, direction, ends.t_m[k] - entry, ends.t_m[k + 1] - entry, s.columns, panel);
        attenuate(air_, panel, through);
        add_single_scattering(t, air_, panel, through, ray, phase, s.in_scattering);
        add_multiple_scattering(t, air_, panel, through, ray, s.in_scattering);
    }
    for (float& x : s.in_scattering) x = std::max(x, 0.0f);
    return s;
}

AirColumns ScatteredLight::columns(const Vec3& origin, const Vec3& direction, double range_m) const noexcept {
    if (range_m == std::numeric_limits<double>::infinity()) return columns_to_space(origin, direction);
    return columns_along(air_, rule_, origin, direction, range_m);
}

AirColumns ScatteredLight::columns_to_space(const Vec3& origin, const Vec3& direction) const noexcept {
    const double r = norm(origin);
    if (r > air_.top_radius_m()) return columns_across(origin, direction);
    const double h = std::max(0.0, r - air_.ground_radius_m());
    const double cosine = dot(origin, direction) / r, horizon = distance_to_horizon_m(air_, h);
    if (cosine < -horizon / r - 2e-3) return kBlocked;
    const auto mu = static_cast<float>(std::max(cosine, -horizon / r + 4e-6));
    return tables_.to_space(tables_.ground_m + static_cast<float>(h), static_cast<float>(horizon), mu);
}

AirColumns ScatteredLight::columns_across(const Vec3& origin, const Vec3& direction) const noexcept {
    const double lowest_t = -dot(origin, direction), lowest = norm(origin + lowest_t * direction);
    if (lowest_t <= 0 || lowest >= air_.top_radius_m()) return {};
    if (lowest < air_.ground_radius_m() - kBelowGround_m) return kBlocked;
    return columns_along(air_, rule_, origin, direction, std::numeric_limits<double>::infinity());
}

ScatteredLight::Spectrum ScatteredLight::scalar_irradiance(double height_m, double sun_cosine) const noexcept {
    const AirTables& t = tables_;
    const AirTables::Corners c =
        t.corners(static_cast<float>(distance_to_horizon_m(air_, height_m)), static_cast<float>(sun_cosine));
    Spectrum out{};
    for (std::size_t k = 0; k < 4; ++k)
        for (std::size_t l = 0; l < t.lanes; ++l) out[l] += c.weight[k] * kSqrt4Pi * c.at[k][l];
    return out;
}

ScatteredLight::Spectrum ScatteredLight::skylight(const Vec3& position, const Vec3& normal,
                                                  const Vec3& to_sun) const noexcept {
    Spectrum out{};
    const double r = norm(position);
    if (r > air_.top_radius_m()) return out;
    const double h = std::max(0.0, r - air_.ground_radius_m());
    const Vec3 up = position / r;
    const double sun = std::clamp(dot(up, to_sun), -1.0, 1.0), sun_sine = std::sqrt(std::max(1e-8, 1 - sun * sun));
    const auto nz = static_cast<float>(dot(normal, up));
    const auto nx = static_cast<float>((dot(normal, to_sun) - static_cast<double>(nz) * sun) / sun_sine);
    const AirTables& t = tables_;
    const auto horizon = static_cast<float>(distance_to_horizon_m(air_, h));
    const AirTables::Corners c = t.corners(horizon, static_cast<float>(sun));
    add_cosine_lobe(c, t.lanes, std::clamp(nz, -1.0f, 1.0f), nx, out);
    const auto facing = static_cast<float>(std::max(0.0, dot(normal, to_sun)));
    if (facing > 0) {
        const SunBeam beam = t.sun_beam(t.ground_m + static_cast<float>(h), horizon, static_cast<float>(sun));
        if (beam.visible > 0) add_forward_peak(air_, beam, facing, out);
    }
    for (float& x : out) x = std::max(x, 0.0f);
    return out;
}

ScatteredLight::Spectrum ScatteredLight::ground_irradiance(double sun_cosine) const noexcept {
    return tables_.ground_irradiance(static_cast<float>(sun_cosine));
}

ScatteredLight::Spectrum ScatteredLight::sunlight(double height_m, double sun_cosine, bool scaled) const noexcept {
    const AirTables& t = tables_;
    const SunBeam beam =
        t.sun_beam(t.ground_m + static_cast<float>(height_m),
                   static_cast<float>(distance_to_horizon_m(air_, height_m)), static_cast<float>(sun_cosine));
    Spectrum out{};
    if (beam.visible == 0) return out;
    const Spectrum& extinction = scaled ? air_.scaled_extinction : air_.aerosol_extinction;
    for (std::size_t l = 0; l < t.lanes; ++l)
        out[l] =
            beam.visible * exp_of_negative(-(air_.gas[l] * beam.columns.gas + extinction[l] * beam.columns.aerosol +
                                             air_.ozone[l] * beam.columns.ozone));
    return out;
}

Rgb bands_of(const Air& air, const Air::Spectrum& light) noexcept {
    Rgb out{};
    for (std::size_t l = 0; l < air.lanes(); ++l) {
        out.x += air.red[l] * light[l];
        out.y += air.green[l] * light[l];
        out.z += air.blue[l] * light[l];
    }
    return out;
}

Rgb transmittance_of(const Air& air, const AirColumns& columns) noexcept {
    Air::Spectrum through;
    pass(air, columns, through);
    return bands_of(air, through);
}

}  // namespace narpa
