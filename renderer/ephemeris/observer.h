/// renderer/ephemeris/observer.h - an observer on the Earth, apparent directions, and bodies in orbit.
///
/// World frame: GCRS, metres from the Earth's centre. Earth orientation is IAU 2006/2000A by ERFA, without polar
/// motion (0.6 arcsec at most).
#pragma once

#include <cstdint>
#include <memory>

#include "base/pose.h"
#include "renderer/atmosphere/refraction/refraction.h"

namespace narpa {

struct ObserverPlace {
    double latitude_rad = 0, longitude_rad = 0;  ///< geodetic, WGS 84; east is positive
    double height_m = 0;                         ///< above the ellipsoid
    double ut1_utc_s = 0;                        ///< UT1 - UTC, published by the IERS
    // Air at the observer:
    double temperature_k = 283.15, pressure_hpa = 1010;
    double wavelength_m = 550e-9;
};

class GroundObserver {
public:
    GroundObserver(const ObserverPlace& place, std::int64_t unix_ns);
    /// The same observer at another time. Allocates nothing.
    [[nodiscard]] GroundObserver after(double dt_s) const;

    [[nodiscard]] const Vec3& position_m() const { return position_m_; }
    /// Geodetic.
    [[nodiscard]] const Vec3& zenith() const { return zenith_; }
    [[nodiscard]] const Vec3& north() const { return north_; }
    [[nodiscard]] const Vec3& east() const { return east_; }
    /// From Earth-fixed (ITRS) to world coordinates.
    [[nodiscard]] const Quat& q_world_earth() const { return q_world_earth_; }

    /// Where an object is seen: with light time, the aberration of the observer's rotation about the Earth, and, if
    /// `refracted`, the bending of its light by the air. Unit, world.
    [[nodiscard]] Vec3 apparent_direction(const Vec3& object_m, const Vec3& object_velocity_m_s,
                                          bool refracted = true) const;
    /// The Sun: with its parallax, and the aberration of the Earth's motion as well.
    [[nodiscard]] Vec3 apparent_sun(bool refracted = true) const;
    /// Raises a direction by refraction, for an object above the air at this distance (or infinity).
    [[nodiscard]] Vec3 refracted(const Vec3& direction, double range_m) const;

private:
    GroundObserver(const ObserverPlace& place, std::int64_t unix_ns,
                   std::shared_ptr<const RefractiveShells> shells);

    ObserverPlace place_;
    std::int64_t unix_ns_;
    Vec3 position_m_, velocity_m_s_, zenith_, north_, east_;
    Quat q_world_earth_;
    std::shared_ptr<const RefractiveShells> shells_;
};

/// Elements of a two-body orbit about the Earth, in GCRS.
struct OrbitalElements {
    double semi_major_axis_m = 6'778'000, eccentricity = 0;
    double inclination_rad = 0, ascending_node_rad = 0, argument_of_perigee_rad = 0;
    double mean_anomaly_rad = 0;  ///< at time 0
};
struct OrbitalState {
    Vec3 position_m{}, velocity_m_s{};
};
/// Kepler's equation by Newton's method to 1e-14 rad; mu = 3.986004418e14 m^3 s^-2.
[[nodiscard]] OrbitalState state_of(const OrbitalElements& orbit, double time_s = 0);

}  // namespace narpa
