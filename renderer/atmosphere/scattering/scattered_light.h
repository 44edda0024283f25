/// renderer/atmosphere/scattering/scattered_light.h - sunlight that the air scatters, once and many times.
///
/// Single scattering is integrated along a ray with the aerosol's full phase function. Multiple scattering comes
/// from a table: at each height and elevation of the Sun the radiance from all directions, as spherical harmonics
/// to degree 8 about the zenith, even in azimuth from the Sun. Rayleigh's phase function needs degree 2 only; the
/// part of the aerosol's beyond degree 8 counts as unscattered light (delta-M: W. Wiscombe, J. Atmos. Sci. 34,
/// 1977). Single scattering is corrected for this truncation, and for repeated scattering by the forward peak: the
/// peak is convolved with itself, and the number of scatterings is Poisson-distributed with the peak's optical
/// depth along the path. T. Nakajima and M. Tanaka (JQSRT 40, 1988) have the first two terms of this, for small
/// angles. The table is the fixed point of the equation of transfer, found by iteration: one more order of
/// scattering and of reflection by the ground each time. The layout, two tables of two dimensions and a march at
/// run time, is that of S. Hillaire, EGSR 2020.
///
/// Positions are metres from the planet's centre, directions unit. The Sun's irradiance is 1.
#pragma once

#include "renderer/atmosphere/air_tables.h"

namespace narpa {

class ScatteredLight {
public:
    using Spectrum = Air::Spectrum;

    /// `threads` 0: all. `sun_radius_rad`: half of its angular diameter.
    ScatteredLight(const Air& air, const AirResolution& resolution, double sun_radius_rad, int threads = 0);

    [[nodiscard]] const Air& air() const { return air_; }

    struct Segment {
        Spectrum in_scattering{};  ///< light that reaches the ray's start
        AirColumns columns{};
    };
    /// Along a ray as far as range_m, which may be infinite. `to_sun`: unit.
    [[nodiscard]] Segment along(const Vec3& origin, const Vec3& direction, double range_m,
                                const Vec3& to_sun) const noexcept;
    /// The columns alone.
    [[nodiscard]] AirColumns columns(const Vec3& origin, const Vec3& direction, double range_m) const noexcept;
    /// To space, infinite where the ground is in the way: from the table where the ray starts in the air; from
    /// above it, integrated along the ray.
    [[nodiscard]] AirColumns columns_to_space(const Vec3& origin, const Vec3& direction) const noexcept;

    /// Irradiance of a surface by light from sky and ground, unshadowed; includes direct sunlight that the aerosol
    /// scatters into its forward peak.
    [[nodiscard]] Spectrum skylight(const Vec3& position, const Vec3& normal, const Vec3& to_sun) const noexcept;

    /// Mean of the radiance from all directions, scattered once or more, times 4 pi: what the air absorbs is this
    /// times its absorption. `height_m` in the air; `sun_cosine` of the Sun's zenith angle.
    [[nodiscard]] Spectrum scalar_irradiance(double height_m, double sun_cosine) const noexcept;
    /// Scattered light on the ground from above.
    [[nodiscard]] Spectrum ground_irradiance(double sun_cosine) const noexcept;
    /// Irradiance by direct sunlight of a surface that faces the Sun, with (`scaled`) or without the light in the
    /// aerosol's forward peak.
    [[nodiscard]] Spectrum sunlight(double height_m, double sun_cosine, bool scaled) const noexcept;

    /// Bytes of the tables.
    [[nodiscard]] std::size_t bytes() const { return tables_.bytes(); }

private:
    struct Moments;
    /// The columns of a ray that starts above the air: the table holds those from inside.
    [[nodiscard]] AirColumns columns_across(const Vec3& origin, const Vec3& direction) const noexcept;
    void solve(const AirResolution& resolution);
    double iterate(const AirResolution& resolution, const Moments& once);
    void gather(std::size_t height, const AirResolution& resolution, bool once, Moments& to) const;

    Air air_;
    PanelRule rule_;
    AirTables tables_;
};

/// `height_m` above the ground.
[[nodiscard]] double distance_to_horizon_m(const Air& air, double height_m) noexcept;
/// Bands of a spectrum.
[[nodiscard]] Rgb bands_of(const Air& air, const Air::Spectrum& light) noexcept;
/// exp(-optical depth) in the bands.
[[nodiscard]] Rgb transmittance_of(const Air& air, const AirColumns& columns) noexcept;

}  // namespace narpa
