#include "renderer/atmosphere/scattered_light.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>

#include "base/each_isa.h"
#include "renderer/atmosphere/fast_exp.h"
#include "renderer/atmosphere/gauss_legendre.h"

namespace narpa {
namespace {

constexpr float kInv4Pi = 0.0795774715f, kSqrt4Pi = 3.5449077f;
/// The table's least cosine of the Sun's zenith angle: 23.6 degrees below the horizon.
constexpr float kLowestSun = 0.4f;
constexpr std::size_t kAzimuths = 8;
constexpr double kConverged = 2e-5;

/// Part of the Sun's disc above a horizon that stands `x` radii below its centre.
float disc_above(float x) {
    if (x >= 1) return 1;
    if (x <= -1) return 0;
    return 0.5f + (x * std::sqrt(1 - x * x) + std::asin(x)) * static_cast<float>(std::numbers::inv_pi);
}

constexpr std::size_t kDegree = Air::kDegree, kHarmonics = (kDegree + 1) * (kDegree + 2) / 2;
using Harmonics = std::array<float, kHarmonics>;

/// Of the associated Legendre functions over (2 m - 1)!! sin^m, from degree to degree; norms that make the
/// harmonics orthonormal.
struct Recurrence {
    Harmonics norm{}, up{}, down{};
};
constexpr Recurrence kRecurrence = [] {
    Recurrence r;
    std::size_t i = 0;
    for (std::size_t l = 0; l <= kDegree; ++l)
        for (std::size_t m = 0; m <= l; ++m, ++i) {
            double ratio = 1, diagonal = 1;  // (l - m)! / (l + m)!; (2 m - 1)!!
            for (std::size_t k = l - m + 1; k <= l + m; ++k) ratio /= static_cast<double>(k);
            for (std::size_t k = 1; k < 2 * m; k += 2) diagonal *= static_cast<double>(k);
            const auto degree = static_cast<double>(l), order = static_cast<double>(m);
            const double square =
                (2 * degree + 1) * 0.079577471545947668 * (m == 0 ? 1 : 2) * ratio * diagonal * diagonal;
            double root = square > 1 ? square : 1;
            for (int step = 0; step < 60; ++step) root = 0.5 * (root + square / root);
            r.norm[i] = static_cast<float>(root);
            r.up[i] = static_cast<float>((2 * degree + 1) / (degree + 1 - order));
            r.down[i] = static_cast<float>((degree + order) / (degree + 1 - order));
        }
    return r;
}();

/// Real spherical harmonics, orthonormal, even in azimuth: degree by degree, in each by rising order. Of a unit
/// vector by its components along the zenith, and horizontally towards the Sun.
inline void harmonics(float z, float x, std::size_t most, Harmonics& out) noexcept {
    const float y = std::sqrt(std::max(0.0f, 1 - z * z - x * x));
    float real = 1, imaginary = 0;  // (x + i y)^m
    for (std::size_t m = 0; m <= most; ++m) {
        float before = 0, p = 1;
        for (std::size_t l = m; l <= most; ++l) {
            const std::size_t i = l * (l + 1) / 2 + m;
            out[i] = kRecurrence.norm[i] * p * real;
            const float next = kRecurrence.up[i] * z * p - kRecurrence.down[i] * before;
            before = p, p = next;
        }
        const float turned = real * x - imaginary * y;
        imaginary = real * y + imaginary * x;
        real = turned;
    }
}

/// What the tables are interpolated from.
struct Tables {
    const float *sun_columns, *moments, *brightness;  ///< brightness: its logarithm and its inverse
    std::size_t column_heights, column_angles, heights, suns, lanes;
    float ground_m, top_m, horizon_m;  ///< radii, and the distance from the horizon to the top
    float sun_radius;
};

struct Cell {
    std::size_t index;
    float fraction;
};
inline Cell cell(float x, std::size_t n) {
    const float clamped = std::min(std::max(x, 0.0f), 1.0f) * static_cast<float>(n - 1);
    const auto i = std::min(static_cast<std::size_t>(clamped), n - 2);
    return {i, clamped - static_cast<float>(i)};
}

struct SunBeam {
    AirColumns columns;
    float visible;  ///< part of the disc
};
/// `horizon_m`: from there to the horizon.
inline SunBeam sun_beam(const Tables& t, float radius_m, float horizon_m, float sun_cosine) {
    const float horizon_cosine = -horizon_m / radius_m;
    SunBeam beam{};
    beam.visible = disc_above((sun_cosine - horizon_cosine) / (t.sun_radius * t.ground_m / radius_m));
    if (beam.visible == 0) return beam;
    const float mu = std::max(sun_cosine, horizon_cosine);
    // E. Bruneton, F. Neyret, EGSR 2008: by the distance to the top.
    const float rise = (t.top_m - radius_m) * (t.top_m + radius_m), b = radius_m * mu;
    const float to_top = rise / (b + std::sqrt(std::max(0.0f, b * b + rise)) + 1e-3f);
    const float least = t.top_m - radius_m, most = horizon_m + t.horizon_m;
    const auto [i, fi] = cell(horizon_m / t.horizon_m, t.column_heights);
    const auto [j, fj] = cell((to_top - least) / (most - least), t.column_angles);
    const float* const low = t.sun_columns + 4 * (i * t.column_angles + j);
    const float* const high = low + 4 * t.column_angles;
    std::array<float, 4> c;
    for (std::size_t k = 0; k < 4; ++k) {
        const float below = low[k] + fj * (low[k + 4] - low[k]), above = high[k] + fj * (high[k + 4] - high[k]);
        c[k] = below + fi * (above - below);
    }
    beam.columns = {c[0], c[1], c[2]};
    return beam;
}

inline float sun_coordinate(float sun_cosine) {
    return sun_cosine >= 0 ? 0.5f + 0.5f * std::sqrt(sun_cosine)
                           : 0.5f - 0.5f * std::sqrt(-sun_cosine / kLowestSun);
}

/// Pointers to the four corners of a cell, and their weights.
struct Corners {
    const float* at[4];
    float weight[4];
};
/// In twilight the light falls by orders of magnitude from one elevation of the Sun to the next: its brightness is
/// interpolated geometrically, and what is relative to it linearly.
inline Corners corners(const Tables& t, float horizon_m, float sun_cosine) {
    const auto [i, fi] = cell(horizon_m / t.horizon_m, t.heights);
    const auto [j, fj] = cell(sun_coordinate(sun_cosine), t.suns);
    const std::size_t size = kHarmonics * t.lanes, low = i * t.suns + j, high = low + t.suns;
    Corners c{{t.moments + size * low, t.moments + size * (low + 1), t.moments + size * high,
               t.moments + size * (high + 1)},
              {(1 - fi) * (1 - fj), (1 - fi) * fj, fi * (1 - fj), fi * fj}};
    const float* const b[4]{t.brightness + 2 * low, t.brightness + 2 * low + 2, t.brightness + 2 * high,
                            t.brightness + 2 * high + 2};
    float mean = 0;
    for (std::size_t k = 0; k < 4; ++k) mean += c.weight[k] * b[k][0];
    constexpr float kShift = 8, kExpShift = 2980.958f;
    const float level = kExpShift * exp_of_negative(mean - kShift);
    for (std::size_t k = 0; k < 4; ++k) c.weight[k] *= level * b[k][1];
    return c;
}

}  // namespace

/// A ray relative to the planet and the Sun.
struct ScatteredLight::Way {
    float radius_m;                ///< of its start
    float up, sun_cosine, sun_nu;  ///< there: cosines of ray and zenith, Sun and zenith, ray and Sun
    bool exact;                    ///< the aerosol's own phase function, for light scattered once
};

namespace {

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

NARPA_EACH_ISA void attenuate(const Air& air, const AirPanel& p, PanelTransmittance& through) noexcept {
    const std::size_t lanes = air.lanes();
    for (std::size_t k = 0; k < p.n; ++k)
        for (std::size_t block = 0; block < lanes; block += kBlock)
            for (std::size_t l = block; l < block + kBlock; ++l)
                through[k][l] = exp_of_negative(-(air.gas[l] * p.gas_before[k] +
                                                  air.scaled_extinction[l] * p.aerosol_before[k] +
                                                  air.ozone[l] * p.ozone_before[k]));
}

/// Where a node stands: height, distance to the horizon, cosine of the Sun's zenith angle.
struct Place {
    float radius, horizon, sun;
};
inline Place place_of(const Tables& t, const AirPanel& p, std::size_t k, const ScatteredLight::Way& way) noexcept {
    const float h = p.height_m[k], radius = t.ground_m + h;
    const float sun = (way.radius_m * way.sun_cosine + p.t_m[k] * way.sun_nu) / radius;
    return {radius, std::sqrt(h * (2 * t.ground_m + h)), std::min(1.0f, std::max(-1.0f, sun))};
}

/// Sunlight scattered into the ray on a panel.
NARPA_EACH_ISA void add_once(const Tables& t, const Air& air, const AirPanel& p, const PanelTransmittance& through,
                             const ScatteredLight::Way& way, Air::Spectrum& out) noexcept {
    const std::size_t lanes = t.lanes;
    Air::Spectrum sum = out, aerosol_once;
    const float nu = way.sun_nu, gas_phase = 0.0596831037f * (1 + nu * nu);
    if (way.exact) {
        for (std::size_t l = 0; l < lanes; ++l) {
            const float g = air.asymmetry[l], s = 1 + g * g - 2 * g * nu;
            aerosol_once[l] = air.aerosol[l] * kInv4Pi * (1 - g * g) / (s * std::sqrt(s));
        }
    } else {
        aerosol_once.fill(0);
        float before = 0, legendre = 1;
        for (std::size_t degree = 0; degree <= kDegree; ++degree) {
            const auto n = static_cast<float>(degree);
            for (std::size_t l = 0; l < lanes; ++l)
                aerosol_once[l] += air.scaled_aerosol[l] * kInv4Pi * (2 * n + 1) * air.moment[degree][l] * legendre;
            const float next = ((2 * n + 1) * nu * legendre - n * before) / (n + 1);
            before = legendre, legendre = next;
        }
    }
    for (std::size_t k = 0; k < p.n; ++k) {
        const Place at = place_of(t, p, k, way);
        const SunBeam beam = sun_beam(t, at.radius, at.horizon, at.sun);
        if (beam.visible == 0) continue;
        const float w = p.length_m[k] * beam.visible, gas = w * p.gas[k] * gas_phase, aerosol = w * p.aerosol[k];
        const auto [cg, ca, co] = beam.columns;
        for (std::size_t block = 0; block < lanes; block += kBlock)
            for (std::size_t l = block; l < block + kBlock; ++l) {
                const float depth = air.gas[l] * cg + air.scaled_extinction[l] * ca + air.ozone[l] * co;
                sum[l] += (air.gas[l] * gas + aerosol_once[l] * aerosol) * through[k][l] * exp_of_negative(-depth);
            }
    }
    out = sum;
}

/// Light of the table scattered into the ray on a panel.
NARPA_EACH_ISA void add_again(const Tables& t, const Air& air, const AirPanel& p, const PanelTransmittance& through,
                              const ScatteredLight::Way& way, Air::Spectrum& out) noexcept {
    const std::size_t lanes = t.lanes;
    Air::Spectrum sum = out;
    for (std::size_t k = 0; k < p.n; ++k) {
        const Place at = place_of(t, p, k, way);
        const float wz = std::min(1.0f, std::max(-1.0f, (way.radius_m * way.up + p.t_m[k]) / at.radius));
        const float wx = (way.sun_nu - wz * at.sun) / std::sqrt(std::max(1e-8f, 1 - at.sun * at.sun));
        const Corners c = corners(t, at.horizon, at.sun);
        const float gas = p.length_m[k] * p.gas[k], aerosol = p.length_m[k] * p.aerosol[k];
        // High above the aerosol Rayleigh's degree suffices.
        const bool clear = air.scaled_aerosol[0] * aerosol < kClear * air.gas[0] * gas;
        const std::size_t degrees = clear ? 2 : kDegree;
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

Tables tables_of(const Air& air, const std::vector<float>& sun_columns, const std::vector<float>& moments,
                 const std::vector<float>& brightness, std::size_t column_heights, std::size_t column_angles,
                 std::size_t heights, std::size_t suns, double sun_radius_rad) {
    const double top = air.top_radius_m(), ground = air.ground_radius_m();
    return {sun_columns.data(),
            moments.data(),
            brightness.data(),
            column_heights,
            column_angles,
            heights,
            suns,
            air.lanes(),
            static_cast<float>(ground),
            static_cast<float>(top),
            static_cast<float>(std::sqrt((top - ground) * (top + ground))),
            static_cast<float>(sun_radius_rad)};
}

double to_horizon(const Air& air, double height_m) {
    return std::sqrt(std::max(0.0, height_m * (2 * air.ground_radius_m() + height_m)));
}

}  // namespace

#define NARPA_AIR_TABLES                                                                                   \
    tables_of(air_, sun_columns_, moments_, brightness_, column_heights_, column_angles_, heights_, suns_, \
              sun_radius_rad_)

ScatteredLight::ScatteredLight(const Air& air, const AirResolution& resolution, double sun_radius_rad, int threads)
    : air_(air),
      rule_(static_cast<std::size_t>(resolution.steps)),
      sun_radius_rad_(std::max(sun_radius_rad, 1e-5)),
      column_heights_(static_cast<std::size_t>(resolution.column_heights)),
      column_angles_(static_cast<std::size_t>(resolution.column_angles)),
      heights_(static_cast<std::size_t>(resolution.heights)),
      suns_(static_cast<std::size_t>(resolution.suns)) {
    make_columns();
    solve(resolution, threads);
}

void ScatteredLight::make_columns() {
    const PanelRule rule(PanelRule::kMaxNodes);
    const double ground = air_.ground_radius_m(), top = air_.top_radius_m();
    const double full = std::sqrt((top - ground) * (top + ground));
    sun_columns_.assign(4 * column_heights_ * column_angles_, 0);
    for (std::size_t i = 0; i < column_heights_; ++i) {
        const double horizon = full * static_cast<double>(i) / static_cast<double>(column_heights_ - 1);
        const double r = std::sqrt(ground * ground + horizon * horizon);
        for (std::size_t j = 0; j < column_angles_; ++j) {
            const double least = top - r, most = horizon + full;
            const double d =
                least + (most - least) * static_cast<double>(j) / static_cast<double>(column_angles_ - 1);
            // r^2 + d^2 + 2 r d mu = top^2
            double mu = d > 0 ? ((top - r) * (top + r) - d * d) / (2 * r * d) : 1;
            mu = std::clamp(mu, -horizon / r, 1.0);
            const Vec3 direction{std::sqrt((1 - mu) * (1 + mu)), 0, mu};
            const AirColumns c =
                columns_along(air_, rule, {0, 0, r}, direction, std::numeric_limits<double>::infinity());
            float* const to = &sun_columns_[4 * (i * column_angles_ + j)];
            to[0] = c.gas, to[1] = c.aerosol, to[2] = c.ozone;
        }
    }
}

double ScatteredLight::height_of(std::size_t i) const {
    const double ground = air_.ground_radius_m(), top = air_.top_radius_m();
    const double horizon =
        std::sqrt((top - ground) * (top + ground)) * static_cast<double>(i) / static_cast<double>(heights_ - 1);
    return horizon * horizon / (ground + std::sqrt(ground * ground + horizon * horizon));
}

double ScatteredLight::sun_cosine_of(std::size_t j) const {
    const double y = 2 * static_cast<double>(j) / static_cast<double>(suns_ - 1) - 1;
    return y >= 0 ? y * y : -static_cast<double>(kLowestSun) * y * y;
}

void ScatteredLight::solve(const AirResolution& resolution, int threads) {
    const std::size_t size = heights_ * suns_ * kHarmonics * air_.lanes();
    moments_once_.assign(size, 0);
    ground_once_.assign(suns_ * air_.lanes(), 0);
    ground_.assign(suns_ * air_.lanes(), 0);
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    arena.execute([&] {
        tbb::parallel_for(std::size_t{0}, heights_,
                          [&](std::size_t i) { gather(i, resolution, true, moments_once_, ground_once_); });
        moments_ = moments_once_;
        measure();
        ground_ = ground_once_;
        for (orders_ = 1; orders_ < resolution.most_orders;) {
            ++orders_;
            if (iterate(resolution) < kConverged) break;
        }
    });
    moments_once_ = {};
    ground_once_ = {};
}

/// One more order of scattering; returns the largest change, relative to the most.
double ScatteredLight::iterate(const AirResolution& resolution) {
    std::vector<float> moments = moments_once_, ground = ground_once_;
    tbb::parallel_for(std::size_t{0}, heights_,
                      [&](std::size_t i) { gather(i, resolution, false, moments, ground); });
    double change = 0, most = 0;
    for (std::size_t i = 0; i < moments.size(); ++i) {
        change = std::max(change, static_cast<double>(std::abs(moments[i] - moments_[i])));
        most = std::max(most, static_cast<double>(std::abs(moments[i])));
    }
    moments_ = std::move(moments);
    measure();
    ground_ = std::move(ground);
    return most > 0 ? change / most : 0;
}

void ScatteredLight::measure() {
    constexpr float kDark = 1e-25f;
    const std::size_t size = kHarmonics * air_.lanes();
    brightness_.resize(2 * heights_ * suns_);
    for (std::size_t i = 0; i < heights_ * suns_; ++i) {
        float sum = 0;
        for (std::size_t l = 0; l < air_.lanes(); ++l) sum += moments_[size * i + l];
        sum = std::max(sum, kDark);
        brightness_[2 * i] = std::log(sum);
        brightness_[2 * i + 1] = 1 / sum;
    }
}

/// Adds to the moments at one height: `once` sunlight scattered or reflected once, else what becomes of known
/// light.
void ScatteredLight::gather(std::size_t height, const AirResolution& resolution, bool once,
                            std::vector<float>& moments, std::vector<float>& ground) const {
    const Tables t = NARPA_AIR_TABLES;
    const std::size_t lanes = air_.lanes();
    const Quadrature rule = gauss_legendre(static_cast<std::size_t>(resolution.directions));
    const double h = height_of(height), r = air_.ground_radius_m() + h, horizon_cosine = -to_horizon(air_, h) / r;
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
            const PanelEnds ends = panel_ends(air_, origin, direction, range, nullptr);
            std::array<AirPanel, PanelEnds::kMost> panels;
            AirColumns columns;
            std::array<PanelTransmittance, PanelEnds::kMost> to_nodes;
            for (std::size_t k = 0; k + 1 < ends.n; ++k) {
                fill_panel(air_, rule_, origin, direction, ends.t_m[k], ends.t_m[k + 1], columns, panels[k]);
                attenuate(air_, panels[k], to_nodes[k]);
            }
            Spectrum through{};
            for (std::size_t l = 0; l < lanes; ++l)
                through[l] = std::exp(-(air_.gas[l] * columns.gas + air_.scaled_extinction[l] * columns.aerosol +
                                        air_.ozone[l] * columns.ozone));
            for (std::size_t j = 0; j < suns_; ++j) {
                const double sun = sun_cosine_of(j), sun_sine = std::sqrt((1 - sun) * (1 + sun));
                for (std::size_t a = 0; a < kAzimuths; ++a) {
                    const double phi = std::numbers::pi * (static_cast<double>(a) + 0.5) / kAzimuths;
                    const double wx = sine * std::cos(phi), nu = wx * sun_sine + up * sun;
                    const Way way{static_cast<float>(r), static_cast<float>(up), static_cast<float>(sun),
                                  static_cast<float>(nu), false};
                    Spectrum light{};
                    for (std::size_t k = 0; k + 1 < ends.n; ++k)
                        (once ? add_once : add_again)(t, air_, panels[k], to_nodes[k], way, light);
                    if (side == 1) {
                        const double there = (r * sun + range * nu) / air_.ground_radius_m();
                        const Spectrum lit = once ? sunlight(0, there, true) : ground_irradiance(there);
                        const float facing = once ? static_cast<float>(std::max(there, 0.0)) : 1.0f;
                        for (std::size_t l = 0; l < lanes; ++l) light[l] += through[l] * albedo * facing * lit[l];
                    }
                    const auto w = static_cast<float>(weight * 2 * std::numbers::pi / kAzimuths);
                    const auto z = static_cast<float>(up);
                    Harmonics y;
                    harmonics(z, static_cast<float>(wx), kDegree, y);
                    float* const to = &moments[kHarmonics * lanes * (height * suns_ + j)];
                    for (std::size_t m = 0; m < kHarmonics; ++m)
                        for (std::size_t l = 0; l < lanes; ++l) to[m * lanes + l] += w * y[m] * light[l];
                    if (height == 0 && side == 0)
                        for (std::size_t l = 0; l < lanes; ++l) ground[j * lanes + l] += w * z * light[l];
                }
            }
        }
}

ScatteredLight::Segment ScatteredLight::along(const Vec3& origin, const Vec3& direction, double range_m,
                                              const Vec3& to_sun) const noexcept {
    Segment s;
    const PanelEnds ends = panel_ends(air_, origin, direction, range_m, &to_sun);
    if (ends.n < 2) return s;
    const Tables t = NARPA_AIR_TABLES;
    // From where it enters the air: what is far away would cost digits.
    const double entry = ends.t_m[0];
    const Vec3 start = origin + entry * direction;
    const double r = norm(start);
    const Way way{static_cast<float>(r), static_cast<float>(dot(start, direction) / r),
                  static_cast<float>(dot(start, to_sun) / r), static_cast<float>(dot(direction, to_sun)), true};
    AirPanel panel;
    PanelTransmittance through;
    for (std::size_t k = 0; k + 1 < ends.n; ++k) {
        fill_panel(air_, rule_, start, direction, ends.t_m[k] - entry, ends.t_m[k + 1] - entry, s.columns, panel);
        attenuate(air_, panel, through);
        add_once(t, air_, panel, through, way, s.in_scattering);
        add_again(t, air_, panel, through, way, s.in_scattering);
    }
    for (float& x : s.in_scattering) x = std::max(x, 0.0f);
    return s;
}

AirColumns ScatteredLight::columns(const Vec3& origin, const Vec3& direction, double range_m) const noexcept {
    if (range_m == std::numeric_limits<double>::infinity()) return columns_to_space(origin, direction);
    return columns_along(air_, rule_, origin, direction, range_m);
}

AirColumns ScatteredLight::columns_to_space(const Vec3& origin, const Vec3& direction) const noexcept {
    const double top = air_.top_radius_m();
    double r = norm(origin);
    Vec3 start = origin;
    if (r > top) {
        const PanelEnds ends =
            panel_ends(air_, origin, direction, std::numeric_limits<double>::infinity(), nullptr);
        if (ends.n < 2) return {};
        start = origin + ends.t_m[0] * direction;
        r = std::min(norm(start), top);
    }
    const double h = std::max(0.0, r - air_.ground_radius_m());
    Tables t = NARPA_AIR_TABLES;
    t.sun_radius = 1e-6f;
    const double cosine = dot(start, direction) / r, horizon = to_horizon(air_, h);
    if (cosine < -horizon / r - 2e-3) {
        constexpr float kBlocked = 1e12f;
        return {kBlocked, kBlocked, 0};
    }
    const auto mu = static_cast<float>(std::max(cosine, -horizon / r + 4e-6));
    return sun_beam(t, t.ground_m + static_cast<float>(h), static_cast<float>(horizon), mu).columns;
}

ScatteredLight::Spectrum ScatteredLight::scalar_irradiance(double height_m, double sun_cosine) const noexcept {
    const Tables t = NARPA_AIR_TABLES;
    const Corners c = corners(t, static_cast<float>(to_horizon(air_, height_m)), static_cast<float>(sun_cosine));
    Spectrum out{};
    for (std::size_t k = 0; k < 4; ++k)
        for (std::size_t l = 0; l < t.lanes; ++l) out[l] += c.weight[k] * kSqrt4Pi * c.at[k][l];
    return out;
}

ScatteredLight::Spectrum ScatteredLight::skylight(const Vec3& position, const Vec3& normal,
                                                  const Vec3& to_sun) const noexcept {
    Spectrum out{};
    const double r = norm(position);
    if (r > air_.top_radius_m()) return out;
    const double h = std::max(0.0, r - air_.ground_radius_m());
    const Vec3 up = position / r;
    const double sun = std::clamp(dot(up, to_sun), -1.0, 1.0), sun_sine = std::sqrt(std::max(1e-8, 1 - sun * sun));
    const auto nz = static_cast<float>(dot(normal, up));
    const auto nx = static_cast<float>((dot(normal, to_sun) - static_cast<double>(nz) * sun) / sun_sine);
    const Tables t = NARPA_AIR_TABLES;
    const Corners c = corners(t, static_cast<float>(to_horizon(air_, h)), static_cast<float>(sun));
    const std::size_t lanes = t.lanes;
    Harmonics y;
    harmonics(std::clamp(nz, -1.0f, 1.0f), nx, kDegree, y);
    // Of the cosine lobe: pi, 2/3 pi, pi / 4, 0, -pi / 24, 0, pi / 64 (R. Ramamoorthi, P. Hanrahan, SIGGRAPH 2001).
    constexpr std::array kLobe{3.14159265f, 2.09439510f, 0.78539816f, 0.0f, -0.13089969f, 0.0f, 0.04908739f};
    static_assert(kLobe.size() == kDegree + 1);
    for (std::size_t k = 0; k < 4; ++k) {
        std::size_t i = 0;
        for (std::size_t degree = 0; degree <= kDegree; ++degree)
            for (std::size_t m = 0; m <= degree; ++m, ++i)
                for (std::size_t l = 0; l < lanes; ++l)
                    out[l] += c.weight[k] * kLobe[degree] * y[i] * c.at[k][i * lanes + l];
    }
    const auto facing = static_cast<float>(std::max(0.0, dot(normal, to_sun)));
    if (facing > 0) {
        const Spectrum scaled = sunlight(h, sun, true), direct = sunlight(h, sun, false);
        for (std::size_t l = 0; l < lanes; ++l) out[l] += facing * (scaled[l] - direct[l]);
    }
    for (float& x : out) x = std::max(x, 0.0f);
    return out;
}

ScatteredLight::Spectrum ScatteredLight::ground_irradiance(double sun_cosine) const noexcept {
    const auto [j, f] = cell(sun_coordinate(static_cast<float>(sun_cosine)), suns_);
    Spectrum out{};
    const float *const low = &ground_[j * air_.lanes()], *const high = low + air_.lanes();
    for (std::size_t l = 0; l < air_.lanes(); ++l) out[l] = low[l] + f * (high[l] - low[l]);
    return out;
}

ScatteredLight::Spectrum ScatteredLight::sunlight(double height_m, double sun_cosine, bool scaled) const noexcept {
    const Tables t = NARPA_AIR_TABLES;
    const SunBeam beam = sun_beam(t, t.ground_m + static_cast<float>(height_m),
                                  static_cast<float>(to_horizon(air_, height_m)), static_cast<float>(sun_cosine));
    Spectrum out{};
    if (beam.visible == 0) return out;
    const Spectrum& extinction = scaled ? air_.scaled_extinction : air_.aerosol_extinction;
    for (std::size_t l = 0; l < t.lanes; ++l)
        out[l] =
            beam.visible * exp_of_negative(-(air_.gas[l] * beam.columns.gas + extinction[l] * beam.columns.aerosol +
                                             air_.ozone[l] * beam.columns.ozone));
    return out;
}

#undef NARPA_AIR_TABLES

Rgb bands_of(const Air& air, const Air::Spectrum& light) noexcept {
    Rgb out{};
    for (std::size_t l = 0; l < air.lanes(); ++l) {
        out.x += air.red[l] * light[l];
        out.y += air.green[l] * light[l];
        out.z += air.blue[l] * light[l];
    }
    return out;
}

Rgb transmittance_of(const Air& air, const AirColumns& columns) noexcept {
    Air::Spectrum through{};
    for (std::size_t l = 0; l < air.lanes(); ++l)
        through[l] = exp_of_negative(-(air.gas[l] * columns.gas + air.aerosol_extinction[l] * columns.aerosol +
                                       air.ozone[l] * columns.ozone));
    return bands_of(air, through);
}

}  // namespace narpa
