#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "renderer/atmosphere/gauss_legendre.h"
#include "renderer/atmosphere/scattering/panel_scattering.h"
#include "renderer/atmosphere/scattering/scattered_light.h"

namespace narpa {
namespace {

constexpr std::size_t kAzimuths = 9;
constexpr double kConverged = 2e-5;

/// Panels of a ray through the air, and the transmittance to their nodes.
struct Way {
    PanelEnds ends;
    AirColumns columns;
    std::array<AirPanel, PanelEnds::kMax> panels;
    std::array<PanelTransmittance, PanelEnds::kMax> to_nodes;

    void fill(const Air& air, const PanelRule& rule, const Vec3& origin, const Vec3& direction) {
        columns = {};
        for (std::size_t k = 0; k + 1 < ends.n; ++k) {
            fill_panel(air, rule, origin, direction, ends.t_m[k], ends.t_m[k + 1], columns, panels[k]);
            attenuate(air, panels[k], to_nodes[k]);
        }
    }
};

}  // namespace

/// Table contents, laid out as in AirTables.
struct ScatteredLight::Moments {
    std::vector<float> moments, irradiance;
};

void ScatteredLight::solve(const AirResolution& resolution) {
    Moments once{std::vector<float>(tables_.moments.size()), std::vector<float>(tables_.irradiance.size())};
    tbb::parallel_for(std::size_t{0}, tables_.heights, [&](std::size_t i) { gather(i, resolution, true, once); });
    tables_.set_scattered(once.moments, once.irradiance);
    for (int orders = 1; orders < resolution.max_orders; ++orders)
        if (iterate(resolution, once) < kConverged) break;
}

/// New table: `once` plus the present table scattered once more, that is one more order. Returns the largest
/// change, relative to the largest moment.
double ScatteredLight::iterate(const AirResolution& resolution, const Moments& once) {
    Moments next = once;
    tbb::parallel_for(std::size_t{0}, tables_.heights, [&](std::size_t i) { gather(i, resolution, false, next); });
    double change = 0, most = 0;
    for (std::size_t i = 0; i < next.moments.size(); ++i) {
        change = std::max(change, static_cast<double>(std::abs(next.moments[i] - tables_.moments[i])));
        most = std::max(most, static_cast<double>(std::abs(next.moments[i])));
    }
    tables_.set_scattered(std::move(next.moments), std::move(next.irradiance));
    return most > 0 ? change / most : 0;
}

/// Adds to the moments at one height: sunlight scattered or reflected once if `once`, else the tabulated light
/// scattered or reflected once more.
void ScatteredLight::gather(std::size_t height, const AirResolution& resolution, bool once, Moments& to) const {
    const AirTables& t = tables_;
    const std::size_t lanes = air_.lanes();
    const Quadrature rule = gauss_legendre(static_cast<std::size_t>(resolution.directions));
    const double h = tables_.height_m(air_, height), r = air_.ground_radius_m() + h,
                 horizon_cosine = -distance_to_horizon_m(air_, h) / r;
    const Vec3 origin{0, 0, r};
    const float albedo = static_cast<float>(air_.description().ground_albedo / std::numbers::pi);
    for (int side = 0; side < 2; ++side)
        for (std::size_t n = 0; n < rule.node.size(); ++n) {
            // Dense at the horizon.
            const double dense = rule.node[n], span = side == 0 ? 1 - horizon_cosine : -1 - horizon_cosine;
            const double up = horizon_cosine + span * dense * dense,
                         weight = 2 * dense * std::abs(span) * rule.weight[n];
            const double sine = std::sqrt((1 - up) * (1 + up));
            const Vec3 direction{sine, 0, up};
            double range = std::numeric_limits<double>::infinity();
            if (side == 1) {
                const double b = r * up;
                range = -b - std::sqrt(std::max(0.0, b * b - h * (2 * air_.ground_radius_m() + h)));
            }
            Way whole, parted;
            whole.ends = panel_ends(air_, origin, direction, range, nullptr);
            whole.fill(air_, rule_, origin, direction);
            Spectrum through{};
            for (std::size_t l = 0; l < lanes; ++l)
                through[l] =
                    std::exp(-(air_.gas[l] * whole.columns.gas + air_.scaled_extinction[l] * whole.columns.aerosol +
                               air_.ozone[l] * whole.columns.ozone));
            for (std::size_t j = 0; j < t.suns; ++j) {
                const double sun = t.sun_cosine(j), sun_sine = std::sqrt((1 - sun) * (1 + sun));
                for (std::size_t a = 0; a < kAzimuths; ++a) {
                    const double phi = std::numbers::pi * (static_cast<double>(a) + 0.5) / kAzimuths;
                    const double wx = sine * std::cos(phi), nu = wx * sun_sine + up * sun;
                    const AirRay ray{static_cast<float>(r), static_cast<float>(up), static_cast<float>(sun),
                                     static_cast<float>(nu)};
                    const Way* way = &whole;
                    if (once) {  // direct light ends at the edge of the planet's shadow
                        const Vec3 to_sun{sun_sine * std::cos(phi), sun_sine * std::sin(phi), sun};
                        parted.ends = panel_ends(air_, origin, direction, range, &to_sun);
                        if (parted.ends.n > whole.ends.n) {
                            parted.fill(air_, rule_, origin, direction);
                            way = &parted;
                        }
                    }
                    AerosolPhase phase;
                    if (once) set_phase(air_, ray.sun_nu, false, phase);
                    Spectrum light{};
                    for (std::size_t k = 0; k + 1 < way->ends.n; ++k)
                        if (once)
                            add_single_scattering(t, air_, way->panels[k], way->to_nodes[k], ray, phase, light);
                        else
                            add_multiple_scattering(t, air_, way->panels[k], way->to_nodes[k], ray, light);
                    if (side == 1) {
                        const double there = (r * sun + range * nu) / air_.ground_radius_m();
                        const Spectrum lit = once ? sunlight(0, there, true) : ground_irradiance(there);
                        const float facing = once ? static_cast<float>(std::max(there, 0.0)) : 1.0f;
                        for (std::size_t l = 0; l < lanes; ++l) light[l] += through[l] * albedo * facing * lit[l];
                    }
                    const auto w = static_cast<float>(weight * 2 * std::numbers::pi / kAzimuths);
                    const auto z = static_cast<float>(up);
                    Harmonics y;
                    harmonics(z, static_cast<float>(wx), kMaxDegree, y);
                    float* const moment = &to.moments[t.entry(height, j)];
                    for (std::size_t m = 0; m < kHarmonics; ++m)
                        for (std::size_t l = 0; l < lanes; ++l) moment[m * lanes + l] += w * y[m] * light[l];
                    if (height == 0 && side == 0)
                        for (std::size_t l = 0; l < lanes; ++l) to.irradiance[j * lanes + l] += w * z * light[l];
                }
            }
        }
}

}  // namespace narpa
