/// renderer/atmosphere/refraction/refraction.h - rays bent by concentric shells of air, by Snell's law.
#pragma once

#include <functional>
#include <vector>

namespace narpa {

/// Homogeneous shells about a sphere, from below; vacuum above the last.
struct RefractiveShells {
    double observer_radius_m = 0;      ///< where the lowest begins
    double observer_refractivity = 0;  ///< n - 1 at the observer
    std::vector<double> top_m;         ///< heights above the observer, ascending
    std::vector<double> refractivity;  ///< n - 1 of each
};

/// Shells of a smooth profile, thin where the air is dense: h = top (k / count)^2. `refractivity`: n - 1 at a
/// height above the ground. 400 shells, the default, are within 0.01 arcsec of the smooth profile to 85 degrees and
/// 0.05 arcsec to 89.
[[nodiscard]] RefractiveShells shells_of(const std::function<double(double)>& refractivity, double ground_radius_m,
                                         double observer_height_m, double top_m, int count = 400);

/// A ray from the observer out of the air, in the plane of observer, centre and ray.
struct BentRay {
    double refraction_rad = 0;  ///< true minus apparent zenith angle of an object at infinity
    double central_angle_rad =
        0;                ///< angle at the sphere's centre between the observer and where it leaves the air
    double impact_m = 0;  ///< distance of the emerging line from the centre: Bouguer's invariant n r sin z
    double exit_radius_m = 0;
};

/// Apparent zenith angle in [0, pi / 2]. The bending at a boundary comes from the difference of the squared sines,
/// which avoids cancellation.
[[nodiscard]] BentRay bend(const RefractiveShells& shells, double apparent_zenith_rad) noexcept;

/// Apparent zenith angle of an object at infinity with this true one, by the secant method with bisection; 1e-12
/// rad. Below the refracted horizon: pi / 2.
[[nodiscard]] double apparent_zenith(const RefractiveShells& shells, double true_zenith_rad) noexcept;
/// The same for an object at a finite distance, above the air: `true_zenith_rad` is that of the straight line to
/// it. The bent ray differs from it also by the parallax of its lateral shift, 1 arcsec at 400 km and 45 degrees.
[[nodiscard]] double apparent_zenith(const RefractiveShells& shells, double true_zenith_rad,
                                     double range_m) noexcept;

/// Refractivity of an atmosphere with a linear lapse of temperature up to a tropopause, isothermal above,
/// hydrostatic under constant gravity, of dry air: n - 1 at a height, in proportion to density.
class LapseAtmosphere {
public:
    LapseAtmosphere(double ground_refractivity, double temperature_k, double lapse_k_m = 0.0065,
                    double tropopause_m = 11000);
    [[nodiscard]] double operator()(double height_m) const noexcept;

private:
    double ground_, temperature_k_, lapse_k_m_, tropopause_m_, at_tropopause_, exponent_, height_scale_m_;
};

}  // namespace narpa
