#include "renderer/atmosphere/lidar_air.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace narpa {

LidarAir::LidarAir(const AirDescription& description, double wavelength_m, int steps)
    : air_(description, wavelength_m),
      rule_(static_cast<std::size_t>(steps)),
      at_ground_(coefficients(description, wavelength_m)),
      back_(backscatter(description, at_ground_)) {}

double LidarAir::transmittance(const Vec3& origin, const Vec3& direction, double range_m) const noexcept {
    const AirColumns c = columns_along(air_, rule_, origin, direction, range_m);
    return std::exp(-(at_ground_.gas_scattering * static_cast<double>(c.gas) +
                      at_ground_.aerosol_extinction * static_cast<double>(c.aerosol) +
                      at_ground_.ozone_absorption * static_cast<double>(c.ozone)));
}

double LidarAir::max_1_m() const noexcept {
    return std::numbers::pi * (back_.gas + back_.aerosol);
}

LidarAir::Coefficients LidarAir::at(const Vec3& position) const noexcept {
    const double height = norm(position) - air_.ground_radius_m();
    if (height > air_.description().top_m) return {};
    const AirDensities d = air_.densities(std::max(height, 0.0));
    const auto gas = static_cast<double>(d.gas), aerosol = static_cast<double>(d.aerosol);
    return {at_ground_.gas_scattering * gas + at_ground_.aerosol_extinction * aerosol,
            back_.gas * gas + back_.aerosol * aerosol};
}

LidarAir::Return LidarAir::backscattered(const Vec3& origin, const Vec3& direction, double from_m,
                                         double to_m) const noexcept {
    // Gauss-Legendre nodes in 1 / r: with this substitution the integrand is beta T^2.
    constexpr std::array kNodes{0.069431844202973712, 0.33000947820757187, 0.66999052179242813,
                                0.93056815579702629};
    constexpr std::array kWeights{0.17392742256872693, 0.32607257743127307, 0.32607257743127307,
                                  0.17392742256872693};
    const double far = 1 / to_m, near = 1 / from_m;
    const double here = at(origin).extinction_1_m;
    Return sum;
    for (std::size_t i = 0; i < kNodes.size(); ++i) {
        const double range = 1 / (far + (near - far) * kNodes[i]);
        const Coefficients there = at(origin + range * direction);
        const double half_way = at(origin + 0.5 * range * direction).extinction_1_m;
        const double depth = range / 6 * (here + 4 * half_way + there.extinction_1_m);
        const double light =
            (near - far) * kWeights[i] * std::numbers::pi * there.backscatter_1_m_sr * std::exp(-2 * depth);
        sum.light += light;
        sum.range_m += light * range;
    }
    if (sum.light > 0) sum.range_m /= sum.light;
    return sum;
}

}  // namespace narpa
