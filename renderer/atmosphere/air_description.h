/// renderer/atmosphere/air_description.h - what an atmosphere is made of, as a scene describes it.
#pragma once

namespace narpa {

struct AirKind;
extern const AirKind kEarthAir;

/// SI units; heights above the planet's surface, taken as a sphere.
struct AirDescription {
    const AirKind* kind = &kEarthAir;  ///< never null; kinds: air_kind.h
    double ground_radius_m = 6'371'000;
    double top_m = 60'000;          ///< vacuum above
    double gas_height_m = 8449.63;  ///< scale height; gives Bodhaine's optical depth for Earth
    double gas_amount = 1;          ///< surface pressure relative to the planet's standard
    double aerosol_height_m = 1200;
    /// Earth: optical depth of gas and aerosol at 550 nm over that of gas alone, so 1 is clean air.
    double turbidity = 3;
    double aerosol_depth = 0;  ///< vertical optical depth at 550 nm; Earth's follows from the turbidity
    double ozone_du = 300;     ///< column, Dobson units; Earth only
    /// Extinction / backscatter at the LiDAR's wavelength; 0: computed from the phase function at 180 degrees.
    double aerosol_lidar_ratio_sr = 0;
    double ground_albedo = 0.1;  ///< of the surface that lights the air from below
};
[[nodiscard]] AirDescription earth_air(double turbidity = 3);
[[nodiscard]] AirDescription mars_air(double dust_depth = 0.5);

}  // namespace narpa
