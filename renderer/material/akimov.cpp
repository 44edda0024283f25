// Akimov's disk function for the Moon, without parameters: Yu. Shkuratov et al., "Optical measurements of the Moon
// as a tool to study its surface", Planetary and Space Science 59, 1326 (2011), eq. 20; L. Akimov, Kinematics and
// Physics of Celestial Bodies 4, 3 (1988).
//
// D(a, b, g) = cos(a / 2) cos(pi / (pi - a) (g - a / 2)) (cos b)^(a / (pi - a)) / cos g, 1 at full phase (a = 0)
// everywhere on the disk. Photometric latitude b and longitude g: n.v = cos b cos g, n.l = cos b cos(a - g).
// f = A D / (pi n.l), with the normal albedo A. It is reciprocal, as cos g cos(a - g) is symmetric in l and v.
#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "renderer/material/directions.h"
#include "renderer/material/material_keys.h"

namespace narpa {
namespace {

/// Phase angles are at most this much below pi, where the exponent has no limit.
constexpr double kLeastSupplement_rad = 1e-6;
/// Below, D is 1 to rounding, and the longitude is not defined.
constexpr double kFullPhaseSine = 1e-9;

double disk_function(double n_l, double n_v, double l_v) noexcept {
    const double phase = std::min(std::acos(std::clamp(l_v, -1.0, 1.0)), kPi - kLeastSupplement_rad);
    const double sine = std::sin(phase);
    if (sine < kFullPhaseSine) return 1;
    const double longitude = std::atan2(n_l - n_v * std::cos(phase), n_v * sine);
    const double cos_longitude = std::cos(longitude), cos_latitude = std::min(1.0, n_v / cos_longitude);
    const double terminator = std::cos(kPi / (kPi - phase) * (longitude - 0.5 * phase));
    return std::max(
        0.0, std::cos(0.5 * phase) * terminator / cos_longitude * std::pow(cos_latitude, phase / (kPi - phase)));
}

Rgb akimov_f(const Surface& s, const BsdfGeometry& g) noexcept {
    return s.diffuse * static_cast<float>(disk_function(g.n_l, g.n_v, g.l_v) / (kPi * g.n_l));
}

// f n.l is bounded: directions are sampled evenly over the hemisphere.
double akimov_pdf(const Surface&, const BsdfGeometry&) noexcept {
    return 0.5 / kPi;
}

Vec3 akimov_direction(const Surface&, const Vec3& n, const Vec3&, const Random3& u) noexcept {
    return Basis(n).to_world(direction_at(1 - u[1], u[2]));
}

}  // namespace

// Mean and largest of the directional albedo over the viewer's hemisphere, by quadrature; the largest is at 87
// degrees.
constinit const BsdfKind kinds::akimov{
    .name = "akimov",
    .keys = kAlbedoRows,
    .read = read_albedo,
    .f = akimov_f,
    .pdf = akimov_pdf,
    .direction = akimov_direction,
    .ambient = [](const Surface& s) noexcept { return s.diffuse * 1.3721f; },
    .largest_albedo = [](const Material& m) noexcept { return m.diffuse * 1.697f; },
    .energy_key = "albedo"};

}  // namespace narpa
