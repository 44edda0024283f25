#include "renderer/atmosphere/panel_scattering.h"

#include <cstring>

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr float kInv4Pi = 0.0795774715f;

/// Eight lanes at once.
constexpr std::size_t kBlock = 8;
using Vector8 = float __attribute__((vector_size(32)));
// By reference: a function that returns or takes one has another ABI on each instruction set.
inline void load(const float* from, Vector8& to) noexcept {
    std::memcpy(&to, from, sizeof to);
}
inline void store(const Vector8& v, float* to) noexcept {
    std::memcpy(to, &v, sizeof v);
}

/// The aerosol's part of the scattering below which only degree 2 counts.
constexpr float kClear = 2e-3f;

/// Where a node stands: height, distance to the horizon, cosine of the Sun's zenith angle.
struct Place {
    float radius, horizon, sun;
};
inline Place place_of(const AirTables& t, const AirPanel& p, std::size_t k, const AirRay& ray) noexcept {
    const float h = p.height_m[k], radius = t.ground_m + h;
    const float sun = (ray.radius_m * ray.sun_cosine + p.t_m[k] * ray.sun_nu) / radius;
    return {radius, std::sqrt(h * (2 * t.ground_m + h)), std::min(1.0f, std::max(-1.0f, sun))};
}

/// The aerosol's phase function of a ray towards the Sun: what is kept of it when it is cut off at kMaxDegree, and
/// the forward peak, f of it. Light that the peak has scattered n times has the peak folded n times with itself.
struct ForwardPeak {
    static constexpr std::size_t kMostFolds = 5, kTerms = 20;
    Air::Spectrum rest{};  ///< times scattering
    Air::Spectrum peak{};  ///< f times scattering: 1/m
    std::array<Air::Spectrum, kMostFolds> folded{};
};

/// Legendre polynomials over 4 pi, times 2 l + 1.
using LegendreTerms = std::array<float, kMaxDegree + 1 + ForwardPeak::kTerms>;
inline void legendre_terms(float nu, LegendreTerms& out) noexcept {
    float before = 0, legendre = 1;
    for (std::size_t degree = 0; degree < out.size(); ++degree) {
        const auto n = static_cast<float>(degree);
        out[degree] = kInv4Pi * (2 * n + 1) * legendre;
        const float next = ((2 * n + 1) * nu * legendre - n * before) / (n + 1);
        before = legendre, legendre = next;
    }
}

/// Moments of the peak: 1 up to kMaxDegree, then g^k. The first is what the phase function has beyond the rest; of
/// the others the sum converges.
inline void split(const Air& air, float nu, std::size_t lanes, ForwardPeak& out) noexcept {
    LegendreTerms terms;
    legendre_terms(nu, terms);
    float kept = 0;
    for (std::size_t degree = 0; degree <= kMaxDegree; ++degree) {
        kept += terms[degree];
        for (std::size_t l = 0; l < lanes; ++l)
            out.rest[l] += air.scaled_aerosol[l] * air.moment[degree][l] * terms[degree];
    }
    for (std::size_t l = 0; l < lanes; ++l) {
        const float g = air.asymmetry[l], s = 1 + g * g - 2 * g * nu;
        out.peak[l] = air.aerosol[l] - air.scaled_aerosol[l];
        const float all = air.aerosol[l] * kInv4Pi * (1 - g * g) / (s * std::sqrt(s));
        out.folded[0][l] = (all - out.rest[l]) / std::max(out.peak[l], 1e-30f);
        float power = g;
        for (std::size_t n = 1; n < ForwardPeak::kMostFolds; ++n) {
            power *= g;
            float sum = 0;
            for (std::size_t k = ForwardPeak::kTerms; k-- > 0;) sum = sum * power + terms[kMaxDegree + 1 + k];
            out.folded[n][l] = kept + sum;
        }
    }
}

/// Mean of the folded peaks for light that is scattered into the ray once at least: `a` optical depth of the peak
/// before and after. Poisson's distribution; more folds count as the most.
inline float mean_fold(const ForwardPeak& p, std::size_t l, float a) noexcept {
    constexpr float kThin = 1e-3f;
    if (a < kThin) return p.folded[0][l];
    const float none = exp_of_negative(-a);
    float weight = none, left = 1 - none, sum = 0;
    for (std::size_t n = 0; n + 1 < ForwardPeak::kMostFolds; ++n) {
        weight *= a / static_cast<float>(n + 1);
        left -= weight;
        sum += weight * p.folded[n][l];
    }
    return (sum + left * p.folded[ForwardPeak::kMostFolds - 1][l]) / a;
}

}  // namespace

NARPA_EACH_ISA void attenuate(const Air& air, const AirPanel& p, PanelTransmittance& through) noexcept {
    const std::size_t lanes = air.lanes();
    for (std::size_t k = 0; k < p.n; ++k)
        for (std::size_t block = 0; block < lanes; block += kBlock)
            for (std::size_t l = block; l < block + kBlock; ++l)
                through[k][l] = exp_of_negative(-(air.gas[l] * p.gas_before[k] +
                                                  air.scaled_extinction[l] * p.aerosol_before[k] +
                                                  air.ozone[l] * p.ozone_before[k]));
}

NARPA_EACH_ISA void add_once(const AirTables& t, const Air& air, const AirPanel& p,
                             const PanelTransmittance& through, const AirRay& ray, Air::Spectrum& out) noexcept {
    const std::size_t lanes = t.lanes;
    Air::Spectrum sum = out;
    const float nu = ray.sun_nu, gas_phase = 0.0596831037f * (1 + nu * nu);
    ForwardPeak phase;
    split(air, nu, lanes, phase);
    if (!ray.exact) phase.peak.fill(0);
    for (std::size_t k = 0; k < p.n; ++k) {
        const Place at = place_of(t, p, k, ray);
        const SunBeam beam = t.sun_beam(at.radius, at.horizon, at.sun);
        if (beam.visible == 0) continue;
        const float w = p.length_m[k] * beam.visible, gas = w * p.gas[k] * gas_phase, aerosol = w * p.aerosol[k];
        const auto [cg, ca, co] = beam.columns;
        for (std::size_t block = 0; block < lanes; block += kBlock)
            for (std::size_t l = block; l < block + kBlock; ++l) {
                const float depth = air.gas[l] * cg + air.scaled_extinction[l] * ca + air.ozone[l] * co;
                const float peak = phase.peak[l] * mean_fold(phase, l, phase.peak[l] * (ca + p.aerosol_before[k]));
                sum[l] +=
                    (air.gas[l] * gas + (phase.rest[l] + peak) * aerosol) * through[k][l] * exp_of_negative(-depth);
            }
    }
    out = sum;
}

NARPA_EACH_ISA void add_again(const AirTables& t, const Air& air, const AirPanel& p,
                              const PanelTransmittance& through, const AirRay& ray, Air::Spectrum& out) noexcept {
    const std::size_t lanes = t.lanes;
    Air::Spectrum sum = out;
    for (std::size_t k = 0; k < p.n; ++k) {
        const Place at = place_of(t, p, k, ray);
        const float wz = std::min(1.0f, std::max(-1.0f, (ray.radius_m * ray.up + p.t_m[k]) / at.radius));
        const float wx = (ray.sun_nu - wz * at.sun) / std::sqrt(std::max(1e-8f, 1 - at.sun * at.sun));
        const AirTables::Corners c = t.corners(at.horizon, at.sun);
        const float gas = p.length_m[k] * p.gas[k], aerosol = p.length_m[k] * p.aerosol[k];
        // High above the aerosol Rayleigh's degree suffices.
        const bool clear = air.scaled_aerosol[0] * aerosol < kClear * air.gas[0] * gas;
        const std::size_t degrees = clear ? 2 : kMaxDegree;
        Harmonics y;
        harmonics(wz, wx, degrees, y);
        for (std::size_t block = 0; block < lanes; block += kBlock) {
            const float *const a = c.at[0] + block, *const b = c.at[1] + block, *const d = c.at[2] + block,
                               *const e = c.at[3] + block;
            const float wa = c.weight[0], wb = c.weight[1], wd = c.weight[2], we = c.weight[3];
            Vector8 from_gas{}, from_aerosol{}, va, vb, vd, ve;
            std::size_t i = 0;
            for (std::size_t degree = 0; degree <= degrees; ++degree) {
                Vector8 part{};
                for (std::size_t m = 0; m <= degree; ++m, ++i) {
                    const std::size_t from = i * lanes;
                    load(a + from, va), load(b + from, vb), load(d + from, vd), load(e + from, ve);
                    part += y[i] * (wa * va + wb * vb + wd * vd + we * ve);
                }
                if (degree == 0) from_gas = part;
                if (degree == 2) from_gas += 0.1f * part;
                load(&air.moment[degree][block], va);
                from_aerosol += va * part;
            }
            load(&air.gas[block], va), load(&air.scaled_aerosol[block], vb);
            load(&through[k][block], vd), load(&sum[block], ve);
            ve += (gas * va * from_gas + aerosol * vb * from_aerosol) * vd;
            store(ve, &sum[block]);
        }
    }
    out = sum;
}

}  // namespace narpa
