#include "renderer/atmosphere/scattering/panel_scattering.h"

#include <array>

#include "base/each_isa.h"

namespace narpa {
namespace {

constexpr float kInv4Pi = 0.0795774715f;

constexpr std::size_t kBlock = 8;

/// Ratio of aerosol to gas scattering below which degree 2 suffices.
constexpr float kClear = 2e-3f;

/// Position of a node: radius, distance to the horizon, cosine of the Sun's zenith angle.
struct Place {
    float radius, horizon, sun;
};
inline Place place_of(const AirTables& t, const AirPanel& p, std::size_t k, const AirRay& ray) noexcept {
    const float h = p.height_m[k], radius = t.ground_m + h;
    const float sun = (ray.radius_m * ray.sun_cosine + p.t_m[k] * ray.sun_nu) / radius;
    return {radius, std::sqrt(h * (2 * t.ground_m + h)), std::min(1.0f, std::max(-1.0f, sun))};
}

/// (2 l + 1) / (4 pi) times the Legendre polynomial of each degree l. The series of the peak convolved with itself
/// converges within kPeakTerms terms beyond kMaxDegree.
constexpr std::size_t kPeakTerms = 20;
using LegendreTerms = std::array<float, kMaxDegree + 1 + kPeakTerms>;
inline void legendre_terms(float nu, LegendreTerms& out) noexcept {
    float before = 0, legendre = 1;
    for (std::size_t degree = 0; degree < out.size(); ++degree) {
        const auto n = static_cast<float>(degree);
        out[degree] = kInv4Pi * (2 * n + 1) * legendre;
        const float next = ((2 * n + 1) * nu * legendre - n * before) / (n + 1);
        before = legendre, legendre = next;
    }
}

/// Mean of the self-convolved peaks for light that the peak scatters at least once. The number of scatterings is
/// Poisson-distributed with mean `a`, the optical depth of the peak before and after the node; more than kMaxFolds
/// count as kMaxFolds.
inline void mean_fold(const AerosolPhase& p, std::size_t block, const Vector8& a, Vector8& out) noexcept {
    constexpr float kThin = 1e-3f;
    const Vector8 depth = a < kThin ? Vector8{} + kThin : a;
    Vector8 weight, folded, sum{};
    exp_of_negative(-depth, weight);
    Vector8 left = 1 - weight;
    for (std::size_t n = 0; n + 1 < AerosolPhase::kMaxFolds; ++n) {
        weight *= depth * (1 / static_cast<float>(n + 1));
        left -= weight;
        load(&p.folded[n][block], folded);
        sum += weight * folded;
    }
    load(&p.folded[AerosolPhase::kMaxFolds - 1][block], folded);
    const Vector8 mean = (sum + left * folded) / depth;
    load(&p.folded[0][block], folded);
    out = a < kThin ? folded : mean;
}

}  // namespace

NARPA_EACH_ISA void attenuate(const Air& air, const AirPanel& p, PanelTransmittance& through) noexcept {
    for (std::size_t block = 0; block < air.lanes(); block += kBlock) {
        Vector8 gas, aerosol, ozone, passes;
        load(&air.gas[block], gas), load(&air.scaled_extinction[block], aerosol), load(&air.ozone[block], ozone);
        for (std::size_t k = 0; k < p.n; ++k) {
            exp_of_negative(-(gas * p.gas_before[k] + aerosol * p.aerosol_before[k] + ozone * p.ozone_before[k]),
                            passes);
            store(passes, &through[k][block]);
        }
    }
}

/// Legendre moments of the normalised peak: 1 up to degree kMaxDegree, then g^k, k = degree - kMaxDegree - 1.
/// folded[0], the peak itself, is the phase function minus its truncated series.
NARPA_EACH_ISA void set_phase(const Air& air, float sun_nu, bool exact, AerosolPhase& phase) noexcept {
    const std::size_t lanes = air.lanes();
    LegendreTerms terms;
    legendre_terms(sun_nu, terms);
    phase.exact = exact;
    float kept = 0;
    Air::Spectrum rest{};
    for (std::size_t degree = 0; degree <= kMaxDegree; ++degree) {
        kept += terms[degree];
        for (std::size_t l = 0; l < lanes; ++l)
            rest[l] += air.scaled_aerosol[l] * air.moment[degree][l] * terms[degree];
    }
    phase.rest = rest;
    if (!exact) return;
    for (std::size_t l = 0; l < lanes; ++l) {
        const float g = air.asymmetry[l], s = 1 + g * g - 2 * g * sun_nu;
        const float all = air.aerosol[l] * kInv4Pi * (1 - g * g) / (s * std::sqrt(s));
        phase.peak[l] = air.aerosol[l] - air.scaled_aerosol[l];
        phase.folded[0][l] = (all - rest[l]) / std::max(phase.peak[l], 1e-30f);
    }
    constexpr std::size_t kMore = AerosolPhase::kMaxFolds - 1;
    for (std::size_t block = 0; block < lanes; block += kBlock) {
        Vector8 g, power[kMore], sum[kMore];
        load(&air.asymmetry[block], g);
        for (std::size_t n = 0; n < kMore; ++n) {
            power[n] = g * (n == 0 ? g : power[n - 1]);
            sum[n] = Vector8{};
        }
        for (std::size_t k = kPeakTerms; k-- > 0;)
            for (std::size_t n = 0; n < kMore; ++n) sum[n] = sum[n] * power[n] + terms[kMaxDegree + 1 + k];
        for (std::size_t n = 0; n < kMore; ++n) {
            sum[n] += kept;
            store(sum[n], &phase.folded[n + 1][block]);
        }
    }
}

NARPA_EACH_ISA void add_single_scattering(const AirTables& t, const Air& air, const AirPanel& p,
                                          const PanelTransmittance& through, const AirRay& ray,
                                          const AerosolPhase& phase, Air::Spectrum& out) noexcept {
    const std::size_t lanes = t.lanes;
    Air::Spectrum sum = out;
    const float nu = ray.sun_nu, gas_phase = 0.0596831037f * (1 + nu * nu);
    for (std::size_t k = 0; k < p.n; ++k) {
        const Place at = place_of(t, p, k, ray);
        const SunBeam beam = t.sun_beam(at.radius, at.horizon, at.sun);
        if (beam.visible == 0) continue;
        const float w = p.length_m[k] * beam.visible, gas = w * p.gas[k] * gas_phase, aerosol = w * p.aerosol[k];
        const auto [cg, ca, co] = beam.columns;
        for (std::size_t block = 0; block < lanes; block += kBlock) {
            Vector8 of_gas, of_aerosol, of_ozone, light, scattered, passes;
            load(&phase.rest[block], scattered);
            if (phase.exact) {
                Vector8 peak, mean;
                load(&phase.peak[block], peak);
                mean_fold(phase, block, peak * (ca + p.aerosol_before[k]), mean);
                scattered += peak * mean;
            }
            load(&air.gas[block], of_gas), load(&air.scaled_extinction[block], of_aerosol);
            load(&air.ozone[block], of_ozone), load(&through[k][block], passes), load(&sum[block], light);
            Vector8 arrives;
            exp_of_negative(-(of_gas * cg + of_aerosol * ca + of_ozone * co), arrives);
            light += (of_gas * gas + scattered * aerosol) * passes * arrives;
            store(light, &sum[block]);
        }
    }
    out = sum;
}

NARPA_EACH_ISA void add_multiple_scattering(const AirTables& t, const Air& air, const AirPanel& p,
                                            const PanelTransmittance& through, const AirRay& ray,
                                            Air::Spectrum& out) noexcept {
    const std::size_t lanes = t.lanes;
    Air::Spectrum sum = out;
    for (std::size_t k = 0; k < p.n; ++k) {
        const Place at = place_of(t, p, k, ray);
        const float wz = std::min(1.0f, std::max(-1.0f, (ray.radius_m * ray.up + p.t_m[k]) / at.radius));
        const float wx = (ray.sun_nu - wz * at.sun) / std::sqrt(std::max(1e-8f, 1 - at.sun * at.sun));
        const AirTables::Corners c = t.corners(at.horizon, at.sun);
        const float gas = p.length_m[k] * p.gas[k], aerosol = p.length_m[k] * p.aerosol[k];
        // Well above the aerosol, degree 2 (Rayleigh) suffices.
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
