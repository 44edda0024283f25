#include "renderer/ephemeris/observer.h"

#include <erfa.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "renderer/atmosphere/refraction/refractive_index.h"
#include "renderer/ephemeris/time_scales.h"

namespace narpa {
namespace {

constexpr double kLightSpeed = 299'792'458.0, kAu_m = 149'597'870'700.0, kDay_s = 86400;
constexpr double kEarthRate_rad_s = 7.292115e-5, kEarthMu = 3.986004418e14;
constexpr double kAirTop_m = 80'000;
constexpr int kWgs84 = 1;

Vec3 aberrated(const Vec3& direction, const Vec3& velocity_m_s) {
    return normalized(direction + velocity_m_s / kLightSpeed);
}

/// The air above the observer, with the lapse rate of the standard atmosphere.
std::shared_ptr<const RefractiveShells> shells_above(const ObserverPlace& place) {
    double fixed[3];
    eraGd2gc(kWgs84, place.longitude_rad, place.latitude_rad, place.height_m, fixed);
    const double n_minus_1 = 1e-6 * dry_refractivity(place.wavelength_m, place.temperature_k, place.pressure_hpa);
    const LapseAtmosphere air(n_minus_1, place.temperature_k, 0.0065, std::max(1000.0, 11'000 - place.height_m));
    return std::make_shared<RefractiveShells>(shells_of(air, norm(Vec3{fixed[0], fixed[1], fixed[2]}), 0,
                                                        kAirTop_m - std::min(place.height_m, 0.5 * kAirTop_m)));
}

}  // namespace

GroundObserver::GroundObserver(const ObserverPlace& place, std::int64_t unix_ns)
    : GroundObserver(place, unix_ns, shells_above(place)) {}

GroundObserver GroundObserver::after(double dt_s) const {
    return {place_, unix_ns_ + std::llround(1e9 * dt_s), shells_};
}

GroundObserver::GroundObserver(const ObserverPlace& place, std::int64_t unix_ns,
                               std::shared_ptr<const RefractiveShells> shells)
    : place_(place), unix_ns_(unix_ns), shells_(std::move(shells)) {
    const TimeScales t = time_scales(unix_ns);
    JulianDate ut1;
    eraUtcut1(t.utc.days, t.utc.fraction, place.ut1_utc_s, &ut1.days, &ut1.fraction);
    double m[3][3], fixed[3];
    eraC2t06a(t.tt.days, t.tt.fraction, ut1.days, ut1.fraction, 0, 0, m);
    eraGd2gc(kWgs84, place.longitude_rad, place.latitude_rad, place.height_m, fixed);
    // Rows of m are the Earth's axes in GCRS.
    const Vec3 x{m[0][0], m[0][1], m[0][2]}, y{m[1][0], m[1][1], m[1][2]}, z{m[2][0], m[2][1], m[2][2]};
    q_world_earth_ = quat_from_columns(x, y, z);
    position_m_ = fixed[0] * x + fixed[1] * y + fixed[2] * z;
    velocity_m_s_ = cross(kEarthRate_rad_s * z, position_m_);
    const double cos_lat = std::cos(place.latitude_rad), sin_lat = std::sin(place.latitude_rad);
    const double cos_lon = std::cos(place.longitude_rad), sin_lon = std::sin(place.longitude_rad);
    zenith_ = cos_lat * cos_lon * x + cos_lat * sin_lon * y + sin_lat * z;
    east_ = -sin_lon * x + cos_lon * y;
    north_ = cross(zenith_, east_);
}

Vec3 GroundObserver::refracted(const Vec3& direction, double range_m) const {
    const double cosine = dot(direction, zenith_);
    const Vec3 across = direction - cosine * zenith_;
    const double sine = norm(across), zenith = std::atan2(sine, cosine);
    if (sine < 1e-12 || zenith > 1.6) return direction;
    const double seen = range_m == std::numeric_limits<double>::infinity()
                            ? apparent_zenith(*shells_, zenith)
                            : apparent_zenith(*shells_, zenith, range_m);
    return std::cos(seen) * zenith_ + std::sin(seen) / sine * across;
}

Vec3 GroundObserver::apparent_direction(const Vec3& object_m, const Vec3& object_velocity_m_s, bool refract) const {
    Vec3 line = object_m - position_m_;
    line = line - norm(line) / kLightSpeed * object_velocity_m_s;  // where it was when the light left
    const Vec3 direction = aberrated(normalized(line), velocity_m_s_);
    return refract ? refracted(direction, norm(line)) : direction;
}

Vec3 GroundObserver::apparent_sun(bool refract) const {
    const JulianDate tt = time_scales(unix_ns_).tt;
    double heliocentric[2][3], barycentric[2][3];
    eraEpv00(tt.days, tt.fraction, heliocentric, barycentric);
    const Vec3 sun = -kAu_m * Vec3{heliocentric[0][0], heliocentric[0][1], heliocentric[0][2]};
    const Vec3 earth_m_s = kAu_m / kDay_s * Vec3{barycentric[1][0], barycentric[1][1], barycentric[1][2]};
    const Vec3 direction = aberrated(normalized(sun - position_m_), earth_m_s + velocity_m_s_);
    return refract ? refracted(direction, std::numeric_limits<double>::infinity()) : direction;
}

OrbitalState state_of(const OrbitalElements& o, double time_s) {
    const double a = o.semi_major_axis_m, e = o.eccentricity;
    const double motion = std::sqrt(kEarthMu / a) / a;
    const double mean = std::remainder(o.mean_anomaly_rad + motion * time_s, 2 * std::numbers::pi);
    double anomaly = e < 0.8 ? mean : std::copysign(std::numbers::pi, mean);
    for (int step = 0; step < 50; ++step) {
        const double change = (anomaly - e * std::sin(anomaly) - mean) / (1 - e * std::cos(anomaly));
        anomaly -= change;
        if (std::abs(change) < 1e-14) break;
    }
    const double c = std::cos(anomaly), s = std::sin(anomaly), flat = std::sqrt((1 - e) * (1 + e));
    const Quat q = exp_rotation({0, 0, o.ascending_node_rad}) * exp_rotation({o.inclination_rad, 0, 0}) *
                   exp_rotation({0, 0, o.argument_of_perigee_rad});
    const double speed = motion * a / (1 - e * c);
    return {q * Vec3{a * (c - e), a * flat * s, 0}, q * Vec3{-speed * s, speed * flat * c, 0}};
}

}  // namespace narpa
