// Lommel-Seeliger and lunar-Lambert surfaces.
#include "renderer/material/regolith.h"

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/material/directions.h"
#include "renderer/material/material_keys.h"

namespace narpa {

double henyey_greenstein(double g, double cos_phase) noexcept {
    const double d = 1 + g * g + 2 * g * cos_phase;
    return (1 - g * g) / (d * std::sqrt(d));
}

// Inverse CDF, multiplied out because the usual form divides by g.
double henyey_greenstein_cosine(double g, double u) noexcept {
    const double s = 2 * u - 1, d = 1 + g * s;
    const double cos_scattering = (s + g * (3 + s * s) / 2 + g * g * s + g * g * g * (s * s - 1) / 2) / (d * d);
    return std::clamp(-cos_scattering, -1.0, 1.0);
}

// Integral of the sphere's phase curve 1 - sin(a/2) tan(a/2) ln cot(a/4) times Henyey and Greenstein's function, by
// their Legendre series in cos a: coefficients by quadrature for the first, (2 n + 1) (-g)^n for the second.
double lommel_seeliger_bond_albedo(double g) noexcept {
    constexpr double kCoefficients[] = {0.20456855, 0.23177662, 0.03575057, 0.01225415, 0.00564312, 0.00306012,
                                        0.00184385, 0.00119633, 0.00082006, 0.00058652, 0.00043394, 0.00033003};
    double sum = 0, power = 1;
    for (const double k : kCoefficients) {
        sum += k * power;
        power *= -g;
    }
    return sum;
}

double lunar_lambert_weight(double phase_rad) noexcept {
    const double a = phase_rad * 180 / std::numbers::pi;
    return std::max(0.0, 1 + a * (-0.019 + a * (2.42e-4 - a * 1.46e-6)));
}

namespace {

constexpr TableKey kSeeligerRows[]{
    kAlbedoRow, kTextureRow, {"asymmetry", rows::number({.low = -0.95, .high = 0.95})}};

void read_lommel_seeliger(TableReader& table, Material& m) {
    read_albedo(table, m);
    table.read("asymmetry", m.asymmetry);
}

double asymmetry(const Surface& s) noexcept {
    return static_cast<double>(s.material->asymmetry);
}

// f = w / (4 pi) p(a) / (n.l + n.v)
Rgb lommel_seeliger_f(const Surface& s, const BsdfGeometry& g) noexcept {
    return s.diffuse * static_cast<float>(henyey_greenstein(asymmetry(s), g.l_v) / (4 * kPi * (g.n_l + g.n_v)));
}

double lommel_seeliger_pdf(const Surface& s, const BsdfGeometry& g) noexcept {
    const double mirrored = g.l_v - 2 * g.n_l * g.n_v;
    return (henyey_greenstein(asymmetry(s), g.l_v) + henyey_greenstein(asymmetry(s), mirrored)) / (4 * kPi);
}

Vec3 lommel_seeliger_direction(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept {
    const double cosine = henyey_greenstein_cosine(asymmetry(s), u[1]);
    return folded(Basis(v).to_world(direction_at(cosine, u[2])), n);
}

Rgb lommel_seeliger_mean_albedo(const Surface& s) noexcept {
    return s.diffuse * static_cast<float>(lommel_seeliger_bond_albedo(asymmetry(s)));
}

// f = A / pi (2 L(a) / (n.l + n.v) + 1 - L(a))
Rgb lunar_lambert_f(const Surface& s, const BsdfGeometry& g) noexcept {
    const double weight = lunar_lambert_weight(std::acos(std::clamp(g.l_v, -1.0, 1.0)));
    return s.diffuse * static_cast<float>((2 * weight / (g.n_l + g.n_v) + 1 - weight) / kPi);
}

// Half uniform over the hemisphere (for the Lommel-Seeliger part), half as Lambert's.
double lunar_lambert_pdf(const Surface&, const BsdfGeometry& g) noexcept {
    return 0.25 / kPi + 0.5 * g.n_l / kPi;
}

Vec3 lunar_lambert_direction(const Surface&, const Vec3& n, const Vec3&, const Random3& u) noexcept {
    return u[0] < 0.5 ? Basis(n).to_world(direction_at(1 - u[1], u[2])) : cosine_direction(n, u[1], u[2]);
}

// The factor is the mean of the directional albedo over the hemisphere, by quadrature.
Rgb lunar_lambert_mean_albedo(const Surface& s) noexcept {
    return s.diffuse * 1.2117f;
}

}  // namespace

constinit const BsdfKind kinds::lommel_seeliger{.name = "lommel_seeliger",
                                                .keys = kSeeligerRows,
                                                .read = read_lommel_seeliger,
                                                .f = lommel_seeliger_f,
                                                .pdf = lommel_seeliger_pdf,
                                                .direction = lommel_seeliger_direction,
                                                .ambient = lommel_seeliger_mean_albedo};

constinit const BsdfKind kinds::lunar_lambert{
    .name = "lunar_lambert",
    .keys = kAlbedoRows,
    .read = read_albedo,
    .f = lunar_lambert_f,
    .pdf = lunar_lambert_pdf,
    .direction = lunar_lambert_direction,
    .ambient = lunar_lambert_mean_albedo,
    .largest_albedo =
        [](const Material& m) noexcept { return m.diffuse * static_cast<float>(kLunarLambertLargest); },
    .energy_key = "albedo"};

}  // namespace narpa
