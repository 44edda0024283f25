/// renderer/atmosphere/lidar_air.h - attenuation and backscatter of a LiDAR's beam by the air.
///
/// The lidar equation: of a pulse of energy E, air at a range r sends back E beta(r) T(r)^2 A / r^2 per metre onto
/// an aperture A; a diffuse surface of reflectivity rho sends back E rho / pi T^2 A / r^2. The return of the air is
/// therefore expressed in units of that surface's rho T^2 / r^2: pi beta T^2 / r^2 per metre. (U. Wandinger in C.
/// Weitkamp (ed.), Lidar, Springer 2005, chapter 1.)
#pragma once

#include "base/vec3.h"
#include "renderer/atmosphere/air_path.h"

namespace narpa {

class LidarAir {
public:
    /// `steps` of the march along a beam.
    LidarAir(const AirDescription& description, double wavelength_m, int steps);

    /// One-way transmittance.
    [[nodiscard]] double transmittance(const Vec3& origin, const Vec3& direction, double range_m) const noexcept;

    struct Return {
        double light = 0;    ///< integral of pi beta T^2 / r^2
        double range_m = 0;  ///< mean range, weighted with the light
    };
    /// Return of the air between two ranges, 0 < from_m < to_m, for a beam that starts in the air. The optical
    /// depth up to a range uses the densities at the start, half-way and at that range (Simpson's rule): valid for
    /// ranges that are short compared with the scale heights.
    [[nodiscard]] Return backscattered(const Vec3& origin, const Vec3& direction, double from_m,
                                       double to_m) const noexcept;
    /// Upper bound of pi beta: its value at the ground, 1/m.
    [[nodiscard]] double max_1_m() const noexcept;

private:
    struct Coefficients {
        double extinction_1_m = 0, backscatter_1_m_sr = 0;
    };
    [[nodiscard]] Coefficients at(const Vec3& position) const noexcept;

    Air air_;
    PanelRule rule_;
    AirCoefficients at_ground_;
    AirBackscatter back_;
};

}  // namespace narpa
