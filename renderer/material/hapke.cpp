// B. Hapke, "Theory of Reflectance and Emittance Spectroscopy", 2nd ed. 2012, without porosity (K = 1) and coherent
// backscattering: f = w / (4 pi) (n.l)e / ((n.l)e + (n.v)e) ((1 + B(a)) p(a) + H((n.l)e) H((n.v)e) - 1) S / n.l
// In chapter 6: p, two Henyey-Greenstein terms; 8: H, in the approximation of 2002; 9: B, shadow hiding; 12: the
// effective cosines ()e and the shadowing S of slopes of mean angle theta-bar (first in Icarus 59, 41, 1984).
#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/material/directions.h"
#include "renderer/material/material_keys.h"
#include "renderer/material/regolith.h"

namespace narpa {
namespace {

constexpr TableKey kHapkeRows[]{
    kAlbedoRow,
    kTextureRow,
    {"b", rows::number({.low = 0, .high = 0.95})},
    {"c", rows::number({.low = -1, .high = 1})},
    {"opposition_b0", rows::number({.low = 0, .high = 10})},
    {"opposition_h", rows::number({.low = 0, .high = 10, .low_open = true})},
    {"roughness_deg", rows::number({.low = 0, .high = 60})},
};

void hapke_read(TableReader& table, Material& m) {
    read_albedo(table, m);
    table.read("b", m.hapke.phase_b);
    table.read("c", m.hapke.phase_c);
    table.read("opposition_b0", m.hapke.opposition_b0);
    table.read("opposition_h", m.hapke.opposition_h);
    if (const auto degrees = table.number("roughness_deg"))
        m.hapke.roughness_rad = static_cast<float>(*degrees * kPi / 180);
}

double double_henyey_greenstein(const Hapke& h, double cos_phase) {
    const double b = static_cast<double>(h.phase_b), c = static_cast<double>(h.phase_c);
    return 0.5 * ((1 + c) * henyey_greenstein(-b, cos_phase) + (1 - c) * henyey_greenstein(b, cos_phase));
}

/// B(a) = B0 / (1 + tan(a/2) / h), with tan(a/2) = |l - v| / |l + v|.
double opposition(const Hapke& h, double cos_phase) {
    const double b0 = static_cast<double>(h.opposition_b0), width = static_cast<double>(h.opposition_h);
    if (b0 <= 0) return 0;
    const double near = std::sqrt(std::max(0.0, 1 + cos_phase)), far = std::sqrt(std::max(0.0, 1 - cos_phase));
    return b0 * width * near / std::max(width * near + far, 1e-300);
}

double chandrasekhar_h(double w, double mu) {
    const double gamma = std::sqrt(std::max(0.0, 1 - w)), r0 = (1 - gamma) / (1 + gamma);
    const double logarithm = mu > 0 ? mu * std::log1p(1 / mu) : 0;  // mu ln((1 + mu) / mu)
    return 1 / (1 - w * (r0 * mu + (0.5 - r0 * mu) * logarithm));
}

/// Effective cosines of the lit and visible facets of a rough surface, and the remaining light: `shadowing` is S
/// over n.l.
struct RoughGeometry {
    double mu_l, mu_v, shadowing;
};

RoughGeometry rough_geometry(double roughness_rad, double n_l, double n_v, double l_v) {
    if (roughness_rad <= 0) return {n_l, n_v, 1 / n_l};
    const double tangent = std::tan(roughness_rad), cotangent = 1 / tangent;
    const double chi = 1 / std::sqrt(1 + kPi * tangent * tangent);
    struct Slope {
        double mu, sine, e1, e2, eta;
    };
    const auto slope = [&](double cosine) {
        const double mu = std::min(cosine, 1.0), sine = std::sqrt((1 - mu) * (1 + mu)),
                     c = sine > 0 ? cotangent * mu / sine : 1e9;
        const double e1 = std::exp(-2 / kPi * c), e2 = std::exp(-c * c / kPi);
        return Slope{mu, sine, e1, e2, chi * (mu + sine * tangent * e2 / (2 - e1))};
    };
    const Slope l = slope(n_l), v = slope(n_v);
    const double product = l.sine * v.sine;
    const double cos_psi = product > 0 ? std::clamp((l_v - l.mu * v.mu) / product, -1.0, 1.0) : 1;
    const double psi = std::acos(cos_psi), sin2_half = 0.5 * (1 - cos_psi);

    // The formulas differ by which of the two directions is nearer to the normal.
    const bool light_higher = l.mu >= v.mu;
    const Slope &high = light_higher ? l : v, &low = light_higher ? v : l;
    const double normaliser = 2 - low.e1 - psi / kPi * high.e1;
    const double mu_high =
        chi * (high.mu + high.sine * tangent * (cos_psi * low.e2 + sin2_half * high.e2) / normaliser);
    const double mu_low = chi * (low.mu + low.sine * tangent * (low.e2 - sin2_half * high.e2) / normaliser);

    const double shared = std::exp(-2 * std::sqrt(std::max(0.0, (1 - cos_psi) / (1 + cos_psi))));
    const double mu_l = std::max(0.0, light_higher ? mu_high : mu_low),
                 mu_v = std::max(0.0, light_higher ? mu_low : mu_high);
    const double shadowing = mu_v / v.eta * chi / (l.eta * (1 - shared + shared * chi * high.mu / high.eta));
    return {mu_l, mu_v, shadowing};
}

/// Share of cosine-distributed samples: about that of multiply scattered light.
double multiple_share(const Surface& s) {
    return 0.15 + 0.6 * std::clamp(band_mean(s.diffuse), 0.0, 1.0);
}

Rgb hapke_f(const Surface& s, const BsdfGeometry& cosines) noexcept {
    const Hapke& h = s.material->hapke;
    const RoughGeometry g =
        rough_geometry(static_cast<double>(h.roughness_rad), cosines.n_l, cosines.n_v, cosines.l_v);
    const double both = g.mu_l + g.mu_v;
    if (!(both > 0)) return {};
    const double geometry = g.mu_l / both * g.shadowing / (4 * kPi);
    const double single = (1 + opposition(h, cosines.l_v)) * double_henyey_greenstein(h, cosines.l_v) - 1;
    const auto band = [&](float albedo) {
        const double w = static_cast<double>(albedo);
        return static_cast<float>(w * geometry *
                                  (single + chandrasekhar_h(w, g.mu_l) * chandrasekhar_h(w, g.mu_v)));
    };
    const Rgb& w = s.diffuse;
    const float x = band(w.x), y = w.y == w.x ? x : band(w.y);
    return {x, y, w.z == w.x ? x : w.z == w.y ? y : band(w.z)};
}

double hapke_pdf(const Surface& s, const BsdfGeometry& g) noexcept {
    const Hapke& h = s.material->hapke;
    const double mirrored = g.l_v - 2 * g.n_l * g.n_v, share = multiple_share(s);
    const double single = (double_henyey_greenstein(h, g.l_v) + double_henyey_greenstein(h, mirrored)) / (4 * kPi);
    return (1 - share) * single + share * g.n_l / kPi;
}

Vec3 hapke_direction(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept {
    const Hapke& h = s.material->hapke;
    const double share = multiple_share(s), b = static_cast<double>(h.phase_b), c = static_cast<double>(h.phase_c);
    if (u[0] < share) return cosine_direction(n, u[1], u[2]);
    const bool backward = u[0] < share + (1 - share) * 0.5 * (1 + c);
    const double cosine = henyey_greenstein_cosine(backward ? -b : b, u[1]);
    return folded(Basis(v).to_world(direction_at(cosine, u[2])), n);
}

// Single scattering: that of a Lommel-Seeliger sphere. Multiple scattering: that of isotropic scatterers (Hapke
// 2012, chapter 11, within 0.3 per cent). The narrow opposition peak and shadowing by roughness are left out: an
// upper bound except for that peak.
Rgb hapke_ambient(const Surface& s) noexcept {
    const Hapke& h = s.material->hapke;
    const double b = static_cast<double>(h.phase_b), c = static_cast<double>(h.phase_c);
    const double single =
        0.5 * ((1 + c) * lommel_seeliger_bond_albedo(-b) + (1 - c) * lommel_seeliger_bond_albedo(b));
    const auto band = [&](float albedo) {
        const double w = static_cast<double>(albedo), gamma = std::sqrt(std::max(0.0, 1 - w));
        const double isotropic = (1 - gamma) / (1 + gamma) * (1 - gamma / (3 * (1 + gamma)));
        return static_cast<float>(isotropic + w * (single - lommel_seeliger_bond_albedo(0)));
    };
    return {band(s.diffuse.x), band(s.diffuse.y), band(s.diffuse.z)};
}

}  // namespace

constinit const BsdfKind kinds::hapke{.name = "hapke",
                                      .keys = kHapkeRows,
                                      .read = hapke_read,
                                      .f = hapke_f,
                                      .pdf = hapke_pdf,
                                      .direction = hapke_direction,
                                      .ambient = hapke_ambient,
                                      .energy_key = "albedo"};

}  // namespace narpa
