// Rough metal, or dielectric over a diffuse base: glTF 2.0's metallic-roughness material (appendix B), extended by
// height-correlated masking, multiple scattering between the facets, and a base that receives only the light that
// the interface transmits.
//
// f = metallic (F D V + M) + (1 - metallic) (F D V + M + base (1 - A(l)) (1 - A(v)) / (pi (1 - mean A)))
// D: Walter et al., "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007, eq. 33; V = G2 / (4 n.l
// n.v): Heitz, "Understanding the Masking-Shadowing Function", JCGT 3(2), 2014, eq. 99; M and A, the albedo of F D
// V + M: Kulla and Conty 2017. All of it is reciprocal, and reflects no more than it gets.
#include <cmath>

#include "base/constants.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/material/directions.h"
#include "renderer/material/fresnel.h"
#include "renderer/material/ggx_albedo.h"
#include "renderer/material/material_keys.h"

namespace narpa {
namespace {

constexpr TableKey kGgxRows[]{
    kAlbedoRow,
    kTextureRow,
    {"metallic", rows::number(kUnit)},
    {"roughness", rows::number(kUnit)},
    {"ior", rows::number({.low = 1, .high = 3})},
    kFresnelRow,
};

void ggx_read(TableReader& table, Material& m) {
    read_albedo(table, m);
    table.read("metallic", m.metallic);
    table.read("roughness", m.roughness);
    read_fresnel(table, m);
}

/// Smoother surfaces are treated as this one: a lobe of 20 arcsec, the limit that double and a mesh's float normals
/// resolve.
constexpr double kMinRoughness = 0.01;
/// Multiple scattering below this mean is ignored: it would only give rare bright samples.
constexpr double kMinMultiple = 1e-3;
/// Lower densities occur only by rounding, and could overflow the weight.
constexpr double kGgxMinDensity = 1e-30;

/// Quantities that depend on neither l nor v.
struct Ggx {
    double alpha, metallic;
    Rgb base;
    GgxAlbedo albedo;
    GgxAlbedo::Interface coat;
    double missing;          ///< 1 - mean E
    double multiple_diel;    ///< Fresnel factor of light that bounced more than once
    double diffuse_missing;  ///< 1 - mean A of the dielectric

    explicit Ggx(const Surface& s, double roughness) noexcept
        : alpha(roughness * roughness),
          metallic(static_cast<double>(s.material->metallic)),
          base(s.diffuse),
          albedo(roughness),
          coat{std::clamp(static_cast<double>(s.material->ior), 1.0, 3.0), s.material->schlick} {
        const double mean = albedo.mean();
        missing = 1 - mean < kMinMultiple ? 0 : 1 - mean;
        const double f = mean_fresnel(coat);
        multiple_diel = f * f * mean / (1 - f * (1 - mean));
        diffuse_missing = 1 - albedo.dielectric_mean(coat) - missing * multiple_diel;
    }
    explicit Ggx(const Surface& s) noexcept
        : Ggx(s, std::clamp(static_cast<double>(s.material->roughness), kMinRoughness, 1.0)) {}

    [[nodiscard]] Rgb multiple_metal() const noexcept {
        const float mean = static_cast<float>(albedo.mean());
        const Rgb f = (base * 20 + Rgb{1, 1, 1}) / 21;
        return {f.x * f.x * mean / (1 - f.x * (1 - mean)), f.y * f.y * mean / (1 - f.y * (1 - mean)),
                f.z * f.z * mean / (1 - f.z * (1 - mean))};
    }
    /// Share of light from mu that leaves the facets after more than one bounce, if they were perfect mirrors.
    [[nodiscard]] double unseen(double mu) const noexcept { return missing > 0 ? 1 - albedo.at(mu) : 0; }
    /// 1 - A: fraction that the interface transmits to the base.
    [[nodiscard]] double through(double mu) const noexcept {
        return std::max(0.0, 1 - albedo.dielectric(coat, mu) - unseen(mu) * multiple_diel);
    }
    [[nodiscard]] double fresnel(double cosine) const noexcept {
        const double c = std::clamp(cosine, 0.0, 1.0);
        return coat.schlick ? fresnel_schlick(c, coat.ior) : fresnel_dielectric(c, coat.ior);
    }
};

/// D of the half vector h (unit), computed from the sine to keep precision in narrow lobes.
double distribution(double alpha, const Vec3& n, const Vec3& h) {
    const Vec3 c = cross(n, h);
    const double cosine = dot(n, h), t = dot(c, c) + alpha * alpha * cosine * cosine;
    return cosine > 0 ? alpha * alpha / (kPi * t * t) : 0;
}

double spread(double alpha, double mu) {
    return std::sqrt(alpha * alpha + (1 - alpha * alpha) * mu * mu);
}

/// The material seen from the direction v.
struct SeenGgx : Ggx {
    Vec3 n, v;
    double n_v, spread_v, unseen_v, through_v = 0;
    Rgb metal_later{};  ///< Fresnel factor of light that bounced more than once
    double share;       ///< share of the samples for the first bounce

    SeenGgx(const Surface& s, const Vec3& normal, const Vec3& view) noexcept
        : Ggx(s), n(normal), v(view), n_v(dot(n, v)), spread_v(spread(alpha, n_v)), unseen_v(unseen(n_v)) {
        double first = 0, later = 0;
        if (metallic > 0) {
            metal_later = multiple_metal();
            first += metallic * band_mean(schlick(base, n_v)) * albedo.at(n_v);
            later += metallic * unseen_v * band_mean(metal_later);
        }
        if (metallic < 1) {
            const double above = albedo.dielectric(coat, n_v);
            through_v = std::max(0.0, 1 - above - unseen_v * multiple_diel);
            first += (1 - metallic) * above;
            later += (1 - metallic) * (unseen_v * multiple_diel + band_mean(base) * through_v);
        }
        share = later > 0 ? std::clamp(first / (first + later), 0.1, 0.9) : 1;
    }

    [[nodiscard]] Rgb f(const Vec3& l) const noexcept {
        const double n_l = dot(n, l);
        const double later = missing > 0 ? unseen(n_l) * unseen_v / (kPi * missing) : 0;
        double first = 0, cosine = 1;
        const Vec3 sum = l + v;
        const double length = norm(sum);
        if (length > 0) {
            const Vec3 h = sum / length;
            cosine = dot(h, v);
            first = distribution(alpha, n, h) * 0.5 / (n_l * spread_v + n_v * spread(alpha, n_l));
        }
        Rgb f{};
        if (metallic > 0)
            f += (schlick(base, cosine) * static_cast<float>(first) + metal_later * static_cast<float>(later)) *
                 static_cast<float>(metallic);
        if (metallic < 1) {
            const double below = through(n_l) * through_v / (kPi * diffuse_missing);
            const float specular = static_cast<float>(fresnel(cosine) * first + multiple_diel * later);
            f += (base * static_cast<float>(below) + Rgb{specular, specular, specular}) *
                 static_cast<float>(1 - metallic);
        }
        return f;
    }

    /// Density of mirror directions about visible normals: that of the normals divided by 4 h.v.
    [[nodiscard]] double pdf(const Vec3& l) const noexcept {
        const Vec3 sum = l + v;
        const double length = norm(sum);
        const double first = length > 0 ? distribution(alpha, n, sum / length) / (2 * (n_v + spread_v)) : 0;
        return share * first + (1 - share) * dot(n, l) / kPi;
    }

    // Visible normals: J. Dupuy, A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps", HPG 2023.
    [[nodiscard]] Vec3 direction(const Random3& u) const noexcept {
        if (u[0] >= share) return cosine_direction(n, u[1], u[2]);
        const Basis frame(n);
        const Vec3 local = frame.to_local(v);
        const Vec3 stretched = normalized(Vec3{alpha * local.x, alpha * local.y, local.z});
        const Vec3 cap = direction_at((1 - u[1]) * (1 + stretched.z) - stretched.z, u[2]) + stretched;
        const Vec3 h = normalized(Vec3{alpha * cap.x, alpha * cap.y, std::max(cap.z, 1e-12)});
        return frame.to_world(reflect(-local, h));
    }
};

Rgb ggx_f(const Surface& s, const BsdfGeometry& g) noexcept {
    return SeenGgx(s, g.n, g.v).f(g.l);
}

double ggx_pdf(const Surface& s, const BsdfGeometry& g) noexcept {
    return SeenGgx(s, g.n, g.v).pdf(g.l);
}

BsdfSample ggx_sample(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept {
    const SeenGgx g(s, n, v);
    BsdfSample out;
    out.l = g.direction(u);
    const double n_l = dot(n, out.l);
    if (n_l <= 0) return out;
    out.pdf = g.pdf(out.l);
    if (out.pdf > kGgxMinDensity) out.weight = g.f(out.l) * static_cast<float>(n_l / out.pdf);
    return out;
}

Rgb ggx_ambient(const Surface& s) noexcept {
    const Ggx g(s);
    const float mean = static_cast<float>(g.albedo.mean()),
                power = static_cast<float>(g.albedo.mean_schlick_power());
    const Rgb metal =
        g.base * mean + (Rgb{1, 1, 1} - g.base) * power + g.multiple_metal() * static_cast<float>(g.missing);
    const float top = static_cast<float>(1 - g.diffuse_missing);
    const Rgb dielectric = Rgb{top, top, top} + g.base * (1 - top);
    return metal * static_cast<float>(g.metallic) + dielectric * static_cast<float>(1 - g.metallic);
}

/// A bound: white metal reflects all.
Rgb ggx_largest_albedo(const Material& m) noexcept {
    return {std::max(m.diffuse.x, 1.0f), std::max(m.diffuse.y, 1.0f), std::max(m.diffuse.z, 1.0f)};
}

}  // namespace

constinit const BsdfKind kinds::ggx{.name = "ggx",
                                    .keys = kGgxRows,
                                    .read = ggx_read,
                                    .f = ggx_f,
                                    .pdf = ggx_pdf,
                                    .sample = ggx_sample,
                                    .ambient = ggx_ambient,
                                    .largest_albedo = ggx_largest_albedo};

}  // namespace narpa
