#include "renderer/atmosphere/scattering/path_traced_air.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "renderer/atmosphere/air_path.h"
#include "renderer/atmosphere/chapman.h"
#include "renderer/atmosphere/scattering/rayleigh.h"

namespace narpa {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

class BruteForce {
public:
    BruteForce(const AirDescription& air, double wavelength_m, const Vec3& to_sun, std::uint64_t seed)
        : description_(air),
          c_(coefficients(air, wavelength_m)),
          to_sun_(to_sun),
          random_(seed),
          ozone_rule_(32),
          air_(air, wavelength_m) {}

    double path(Vec3 p, Vec3 d) {
        double light = 0, weight = 1;
        for (int bounce = 0; bounce < 1000; ++bounce) {
            const double ground = to_sphere(p, d, description_.ground_radius_m);
            const double t = flight(p, d, ground);
            if (t == kNever) return light;
            p += t * d;
            if (t == ground) {
                const Vec3 up = normalized(p);
                p = description_.ground_radius_m * (1 + 1e-12) * up;
                weight *= description_.ground_albedo;
                light += weight * std::max(0.0, dot(up, to_sun_)) / std::numbers::pi * sunlight(p);
                d = around(up, std::sqrt(uniform()));
            } else {
                const AirDensities at = air_.densities(norm(p) - description_.ground_radius_m);
                const double gas = c_.gas_scattering * static_cast<double>(at.gas);
                const double aerosol = c_.aerosol_scattering * static_cast<double>(at.aerosol);
                const double all = gas + c_.aerosol_extinction * static_cast<double>(at.aerosol) +
                                   c_.ozone_absorption * static_cast<double>(at.ozone);
                weight *= (gas + aerosol) / all;
                const double nu = dot(d, to_sun_);
                light += weight * (gas * rayleigh_phase(nu) + aerosol * henyey_greenstein_phase(nu, c_.asymmetry)) /
                         (gas + aerosol) * sunlight(p);
                d = around(d, uniform() * (gas + aerosol) < gas ? rayleigh_cosine() : aerosol_cosine());
            }
            if (weight < 0.1) {
                if (uniform() > weight / 0.1) return light;
                weight = 0.1;
            }
        }
        return light;
    }

private:
    double uniform() { return std::uniform_real_distribution<double>()(random_); }

    /// Distance to the near side of a sphere about the planet's centre, from outside; infinite if the ray misses
    /// it.
    static double to_sphere(const Vec3& p, const Vec3& d, double radius) {
        const double b = dot(p, d), c = dot(p, p) - radius * radius, discriminant = b * b - c;
        if (discriminant < 0 || b > 0) return kNever;
        const double t = -b - std::sqrt(discriminant);
        return t > 0 ? t : kNever;
    }

    /// Distance to the next collision or the ground; infinite if the ray escapes. The majorant is the extinction at
    /// the lowest height ahead.
    double flight(const Vec3& p, const Vec3& d, double ground) {
        const double top = description_.ground_radius_m + description_.top_m;
        const double along = dot(p, d), reach = std::sqrt(std::max(0.0, along * along - dot(p, p) + top * top));
        const double leaves = -along + reach;
        if (dot(p, p) - along * along > top * top || leaves <= 0) return ground;
        double t = std::max(0.0, -along - reach);
        const double end = std::min(leaves, ground);
        while (t < end) {
            // In pieces of 10 km, for a tight majorant.
            const double piece = std::min(end, t + 10'000);
            const double lowest = std::clamp(-along, t, piece);
            const double h = std::max(0.0, norm(p + lowest * d) - description_.ground_radius_m);
            const AirDensities most = air_.densities(h);
            const double majorant = c_.gas_scattering * static_cast<double>(most.gas) +
                                    c_.aerosol_extinction * static_cast<double>(most.aerosol) +
                                    (description_.ozone_du > 0 ? c_.ozone_absorption : 0);
            double s = t;
            for (;;) {
                s -= std::log(1 - uniform()) / (majorant * 1.00001 + 1e-30);
                if (s >= piece) break;
                const AirDensities at = air_.densities(norm(p + s * d) - description_.ground_radius_m);
                const double here = c_.gas_scattering * static_cast<double>(at.gas) +
                                    c_.aerosol_extinction * static_cast<double>(at.aerosol) +
                                    c_.ozone_absorption * static_cast<double>(at.ozone);
                if (uniform() * majorant < here) return s;
            }
            t = piece;
        }
        return ground <= leaves ? ground : kNever;
    }

    double sunlight(const Vec3& p) {
        if (to_sphere(p, to_sun_, description_.ground_radius_m) != kNever) return 0;
        const double r = norm(p), zenith = std::acos(std::clamp(dot(p, to_sun_) / r, -1.0, 1.0));
        const double top = description_.ground_radius_m + description_.top_m;
        // Chapman's columns extend to infinity: the part above the top is subtracted.
        const double exit = std::asin(std::min(1.0, r * std::sin(zenith) / top));
        double depth = 0;
        for (const auto& [height, extinction] : {std::pair{description_.gas_height_m, c_.gas_scattering},
                                                 std::pair{description_.aerosol_height_m, c_.aerosol_extinction}}) {
            const double here = std::exp(-(r - description_.ground_radius_m) / height);
            const double above = std::exp(-description_.top_m / height);
            depth +=
                extinction * height * (here * chapman(r / height, zenith) - above * chapman(top / height, exit));
        }
        if (description_.ozone_du > 0)
            depth += c_.ozone_absorption *
                     static_cast<double>(columns_along(air_, ozone_rule_, p, to_sun_, kNever).ozone);
        return std::exp(-depth);
    }

    double rayleigh_cosine() {  // inverse of its CDF, by Cardano's formula
        const double q = 4 * uniform() - 2, root = std::cbrt(q + std::sqrt(q * q + 1));
        return root - 1 / root;
    }
    double aerosol_cosine() {
        const double g = c_.asymmetry, u = uniform();
        if (std::abs(g) < 1e-6) return 2 * u - 1;
        const double s = (1 - g * g) / (1 - g + 2 * g * u);
        return (1 + g * g - s * s) / (2 * g);
    }
    Vec3 around(const Vec3& axis, double cosine) {
        const Vec3 other = std::abs(axis.z) < 0.9 ? Vec3{0, 0, 1} : Vec3{1, 0, 0};
        const Vec3 x = normalized(cross(axis, other)), y = cross(axis, x);
        const double phi = 2 * std::numbers::pi * uniform(), sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
        return normalized(cosine * axis + sine * std::cos(phi) * x + sine * std::sin(phi) * y);
    }

    const AirDescription& description_;
    AirCoefficients c_;
    Vec3 to_sun_;
    std::mt19937_64 random_;
    PanelRule ozone_rule_;
    Air air_;
};

}  // namespace

PathTracedLight path_traced_air(const AirDescription& air, double wavelength_m, const Vec3& origin,
                                const Vec3& direction, const Vec3& to_sun, std::uint64_t paths,
                                std::uint64_t seed) {
    BruteForce tracer(air, wavelength_m, to_sun, seed);
    double sum = 0, squares = 0;
    for (std::uint64_t i = 0; i < paths; ++i) {
        const double light = tracer.path(origin, direction);
        sum += light;
        squares += light * light;
    }
    const auto n = static_cast<double>(paths);
    const double mean = sum / n;
    return {mean, std::sqrt(std::max(0.0, squares / n - mean * mean) / std::max(1.0, n - 1))};
}

}  // namespace narpa
