/// renderer/material/lobes.h - the BSDF of each kind of material; bsdf.cpp selects among them.
///
/// Each kind has its f in 1/sr (`_f`), the sampling density of directions (`_pdf`, 1/sr) and the sampling itself
/// (`_direction`, which may fall below the surface: then f is 0). All assume n.v > 0, the first two n.l > 0 as
/// well. Phong's f is in bsdf.cpp.
#pragma once

#include "base/constants.h"
#include "renderer/material/bsdf.h"

namespace narpa::lobes {

using Random3 = std::array<double, 3>;
/// Lower densities occur only by rounding, and could overflow the weight.
inline constexpr double kMinDensity = 1e-30;

/// Mean of the bands.
inline double mean(const Rgb& c) noexcept {
    return static_cast<double>(c.x + c.y + c.z) / 3;
}

double phong_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;
Vec3 phong_direction(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept;
Rgb phong_classic_f(const Surface& s, double n_l, double n_v, double l_v) noexcept;

BsdfSample mirror_sample(const Surface& s, const Vec3& n, const Vec3& v) noexcept;
BsdfSample dielectric_sample(const Surface& s, const Vec3& n, const Vec3& v, double choice) noexcept;

Rgb ggx_f(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;
double ggx_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;
BsdfSample ggx_sample(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept;
Rgb ggx_mean_albedo(const Surface& s) noexcept;

Rgb lommel_seeliger_f(const Surface& s, double n_l, double n_v, double l_v) noexcept;
double lommel_seeliger_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;
Vec3 lommel_seeliger_direction(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept;
Rgb lommel_seeliger_mean_albedo(const Surface& s) noexcept;

Rgb lunar_lambert_f(const Surface& s, double n_l, double n_v, double l_v) noexcept;
double lunar_lambert_pdf(const Vec3& n, const Vec3& l) noexcept;
Vec3 lunar_lambert_direction(const Vec3& n, const Random3& u) noexcept;
Rgb lunar_lambert_mean_albedo(const Surface& s) noexcept;

Rgb hapke_f(const Surface& s, double n_l, double n_v, double l_v) noexcept;
double hapke_pdf(const Surface& s, const Vec3& n, const Vec3& l, const Vec3& v) noexcept;
Vec3 hapke_direction(const Surface& s, const Vec3& n, const Vec3& v, const Random3& u) noexcept;
Rgb hapke_mean_albedo(const Surface& s) noexcept;

}  // namespace narpa::lobes
