// Phong's lobe: sampling for the BRDF (Lafortune and Willems 1994), and the paper's form, which is not a BRDF.
#include <cmath>
#include <limits>

#include "base/constants.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/material/directions.h"
#include "renderer/material/fresnel.h"
#include "renderer/material/material_keys.h"
#include "renderer/material/phong_lobe.h"

namespace narpa {
namespace {

constexpr float kPhongInvPi = static_cast<float>(1 / kPi);
constexpr Range kExponent{.low = 0, .high = 1e4};
constexpr TableKey kPhongRows[]{
    kAlbedoRow,
    kTextureRow,
    {"specular", rows::rgb(kUnit), "a number or [r, g, b] in [0, 1], as the kind is \"phong\""},
    {"exponent", rows::number(kExponent), "a number in [0, 10000], as the kind is \"phong\""},
    kSpecularTextureRow,
    kCloudTextureRow,
    kCloudAlbedoRow,
};
constexpr TableKey kClassicRows[]{
    kAlbedoRow,
    kTextureRow,
    {"specular", rows::rgb(kUnit), "a number or [r, g, b] in [0, 1], as the kind is \"phong_classic\""},
    {"exponent", rows::number(kExponent), "a number in [0, 10000], as the kind is \"phong_classic\""},
    kSpecularTextureRow,
    {"ambient", rows::rgb(kUnit)},
};

void phong_read(TableReader& table, Material& m) {
    read_albedo(table, m);
    table.read("specular", m.specular);
    table.read("exponent", m.exponent);
}

void read_phong_classic(TableReader& table, Material& m) {
    phong_read(table, m);
    table.read("ambient", m.ambient);
}

/// Share of the samples for the lobe: by the albedos, each at its largest. A wide lobe leaves more to the cosine,
/// which keeps the largest weight below twice the mean down to n = 0.
double lobe_share(const Surface& s) {
    const double d = band_mean(s.diffuse), l = band_mean(s.specular), n = static_cast<double>(s.exponent);
    return l > 0 ? l / (d + l) * n / (n + 1) : 0;
}

/// (n + 1) / (2 pi) cos^n about the mirror direction.
double lobe_density(double cosine, double exponent) {
    return cosine > 0 ? (exponent + 1) / (2 * kPi) * std::pow(std::min(cosine, 1.0), exponent) : 0;
}

Rgb phong_f(const Surface& s, const BsdfGeometry& g) noexcept {
    return s.diffuse * kPhongInvPi + s.specular * phong_lobe(2 * g.n_l * g.n_v - g.l_v, s.exponent);
}

// Lobe directions below the surface are mirrored to above it: no sample is lost, and the density of a direction is
// the sum of the lobe's there and in its mirror image.
double phong_pdf(const Surface& s, const BsdfGeometry& g) noexcept {
    const double share = lobe_share(s), exponent = static_cast<double>(s.exponent);
    const double cosine = (1 - share) * g.n_l / kPi;
    if (share <= 0) return cosine;
    const double above = 2 * g.n_l * g.n_v - g.l_v;
    return cosine + share * (lobe_density(above, exponent) + lobe_density(above - 2 * g.n_l * g.n_v, exponent));
}

Vec3 phong_direction(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept {
    if (u[0] >= lobe_share(s)) return cosine_direction(n, u[1], u[2]);
    const double cosine = std::pow(1 - u[1], 1 / (static_cast<double>(s.exponent) + 1));
    return folded(Basis(reflect(-v, n)).to_world(direction_at(cosine, u[2])), n);
}

// f (n.l) = (kd (n.l) + ks (r.v)^n) / pi. Below n.l = 1e-6 f stops growing: 0.2 arcsec above the horizon.
Rgb phong_classic_f(const Surface& s, const BsdfGeometry& g) noexcept {
    const double r_v = 2 * g.n_l * g.n_v - g.l_v;
    if (r_v <= 0) return s.diffuse * kPhongInvPi;
    const double lobe = std::pow(std::min(r_v, 1.0), static_cast<double>(s.exponent)) / std::max(g.n_l, 1e-6);
    return (s.diffuse + s.material->specular * static_cast<float>(lobe)) * kPhongInvPi;
}

Rgb unbounded(const Material&) noexcept {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    return {kInfinity, kInfinity, kInfinity};
}

}  // namespace

constinit const BsdfKind kinds::phong{
    .name = "phong",
    .keys = kPhongRows,
    .read = phong_read,
    .lambert_or_phong = true,
    .has_lobe = true,
    .f = phong_f,
    .pdf = phong_pdf,
    .direction = phong_direction,
    .largest_albedo = [](const Material& m) noexcept { return m.diffuse + m.specular; },
    .energy_key = "specular"};

constinit const BsdfKind kinds::phong_classic{
    .name = "phong_classic",
    .keys = kClassicRows,
    .read = read_phong_classic,
    .has_lobe = true,
    .direct_only = true,
    .f = phong_classic_f,
    .ambient = [](const Surface& s) noexcept { return s.material->ambient; },
    .largest_albedo = unbounded};

}  // namespace narpa
