// Phong's lobe: sampling for the BRDF (Lafortune and Willems 1994), and the paper's form, which is not a BRDF.
#include <cmath>

#include "renderer/material/directions.h"
#include "renderer/material/fresnel.h"
#include "renderer/material/lobes.h"

namespace narpa::lobes {
namespace {

/// Share of the samples for the lobe: by the albedos, each at its largest. A wide lobe leaves more to the cosine,
/// which keeps the largest weight below twice the mean down to n = 0.
double lobe_share(const Surface& s) {
    const double d = mean(s.diffuse), l = mean(s.specular), n = static_cast<double>(s.exponent);
    return l > 0 ? l / (d + l) * n / (n + 1) : 0;
}

/// (n + 1) / (2 pi) cos^n about the mirror direction.
double lobe_density(double cosine, double exponent) {
    return cosine > 0 ? (exponent + 1) / (2 * kPi) * std::pow(std::min(cosine, 1.0), exponent) : 0;
}

}  // namespace

// Lobe directions below the surface are mirrored to above it: no sample is lost, and the density of a direction is
// the sum of the lobe's there and in its mirror image.
double phong_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept {
    const double n_l = dot(n, l), n_v = dot(n, v), share = lobe_share(s),
                 exponent = static_cast<double>(s.exponent);
    double pdf = (1 - share) * n_l / kPi;
    if (share <= 0) return pdf;
    const double above = 2 * n_l * n_v - dot(l, v);
    return pdf + share * (lobe_density(above, exponent) + lobe_density(above - 2 * n_l * n_v, exponent));
}

Vec3 phong_direction(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept {
    if (u[0] >= lobe_share(s)) return cosine_direction(n, u[1], u[2]);
    const double cosine = std::pow(1 - u[1], 1 / (static_cast<double>(s.exponent) + 1));
    return folded(Basis(reflect(-v, n)).to_world(direction_at(cosine, u[2])), n);
}

// f (n.l) = (kd (n.l) + ks (r.v)^n) / pi. Below n.l = 1e-6 f stops growing: 0.2 arcsec above the horizon.
Rgb phong_classic_f(const Surface& s, double n_l, double n_v, double l_v) noexcept {
    const double r_v = 2 * n_l * n_v - l_v;
    if (r_v <= 0) return s.diffuse * static_cast<float>(1 / kPi);
    const double lobe = std::pow(std::min(r_v, 1.0), static_cast<double>(s.exponent)) / std::max(n_l, 1e-6);
    return (s.diffuse + s.material->specular * static_cast<float>(lobe)) * static_cast<float>(1 / kPi);
}

}  // namespace narpa::lobes
