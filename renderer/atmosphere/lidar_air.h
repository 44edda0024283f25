/// renderer/atmosphere/lidar_air.h - what the air makes of a LiDAR's beam: it dims it, and sends some of it back.
///
/// The lidar equation: of a pulse of energy E, air at a range r sends back E beta(r) T(r)^2 A / r^2 per metre onto
/// an aperture A, where a diffuse surface of reflectivity rho sends E rho / pi T^2 A / r^2. So air is told in units
/// of such a surface's rho T^2 / r^2: pi beta T^2 / r^2 per metre. (U. Wandinger in C. Weitkamp (ed.), Lidar,
/// Springer 2005, chapter 1.)
#pragma once

#include "base/vec3.h"
#include "renderer/atmosphere/air_path.h"

namespace narpa {

class LidarAir {
public:
    /// `steps` of the march along a beam.
    LidarAir(const AirDescription& description, double wavelength_m, int steps);

    /// One way.
    [[nodiscard]] double transmittance(const Vec3& origin, const Vec3& direction, double range_m) const noexcept;

    struct Return {
        double light = 0;    ///< integral of pi beta T^2 / r^2
        double range_m = 0;  ///< its mean
    };
    /// Of the air between two ranges, 0 < from_m < to_m, of a beam that starts in the air. The optical depth up to
    /// there is that of densities at the start, half-way and there (Simpson): for ranges that are short beside the
    /// heights in which these fall.
    [[nodiscard]] Return backscattered(const Vec3& origin, const Vec3& direction, double from_m,
                                       double to_m) const noexcept;
    /// pi beta at the ground, 1/m: the most.
    [[nodiscard]] double most_1_m() const noexcept;

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
