#include "renderer/atmosphere/refraction/refraction.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace narpa {
namespace {

constexpr double kGravity_m_s2 = 9.80665, kDryAir_j_kg_k = 8.31446261815324 / 0.0289644;

double cosine_of(double sine) {
    return std::sqrt(std::max(0.0, (1 - sine) * (1 + sine)));
}

/// Angle at the planet's centre by which the bent ray misses the object: where the ray with this apparent zenith
/// angle reaches the object's radius, minus where the object is.
double miss(const RefractiveShells& shells, double apparent, double true_zenith, double range_m) {
    const BentRay ray = bend(shells, apparent);
    const double r0 = shells.observer_radius_m;
    const double radius = std::sqrt(r0 * r0 + range_m * range_m + 2 * r0 * range_m * std::cos(true_zenith));
    const double reached = ray.central_angle_rad + std::asin(std::min(1.0, ray.impact_m / ray.exit_radius_m)) -
                           std::asin(std::min(1.0, ray.impact_m / radius));
    const double wanted = std::atan2(range_m * std::sin(true_zenith), r0 + range_m * std::cos(true_zenith));
    return reached - wanted;
}

template <class Excess>
double solve_zenith(const Excess& excess, double start) {
    // Bracket: air as on Earth lifts objects by less than 0.02 rad. Denser air needs a wider one.
    double low = std::max(0.0, start - 0.02), high = std::min(0.5 * std::numbers::pi, start);
    if (excess(high) <= 0) return high;
    double at_low = excess(low);
    while (at_low >= 0 && low > 0) {
        low = std::max(0.0, 2 * low - start);
        at_low = excess(low);
    }
    if (at_low >= 0) return low;
    for (int step = 0; step < 100 && high - low > 1e-13; ++step) {
        // Secant; every third step bisects.
        const double at_high = excess(high);
        double middle = low - at_low * (high - low) / (at_high - at_low);
        if (step % 3 == 2 || !(middle > low && middle < high)) middle = 0.5 * (low + high);
        const double value = excess(middle);
        if (value < 0)
            low = middle, at_low = value;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

}  // namespace

RefractiveShells shells_of(const std::function<double(double)>& refractivity, double ground_radius_m,
                           double observer_height_m, double top_m, int count) {
    RefractiveShells s{ground_radius_m + observer_height_m, refractivity(observer_height_m), {}, {}};
    const double depth = top_m - observer_height_m;
    const auto height = [&](double k) { return depth * (k / count) * (k / count); };
    // The profile is sampled at levels; the shell boundaries lie between them.
    for (int k = 0; k < count; ++k) {
        s.top_m.push_back(height(k + 0.5));
        s.refractivity.push_back(refractivity(observer_height_m + height(k)));
    }
    return s;
}

BentRay bend(const RefractiveShells& shells, double apparent_zenith_rad) noexcept {
    const double r0 = shells.observer_radius_m;
    BentRay ray;
    ray.impact_m = (1 + shells.observer_refractivity) * r0 * std::sin(apparent_zenith_rad);
    ray.exit_radius_m = r0;
    const auto cross = [&](double radius, double below, double above) {
        // Sines on both sides of the boundary, q / (n r); above the ray is flatter.
        const double outer = std::min(1.0, ray.impact_m / ((1 + above) * radius));
        const double inner = std::min(1.0, ray.impact_m / ((1 + below) * radius));
        const double ratio = ray.impact_m / radius;
        const double difference = ratio * ratio * (below - above) * (2 + below + above) /
                                  ((1 + below) * (1 + below) * (1 + above) * (1 + above));
        const double sum = outer * cosine_of(inner) + inner * cosine_of(outer);
        if (sum > 0) ray.refraction_rad += std::asin(std::clamp(difference / sum, -1.0, 1.0));
    };
    double below = shells.observer_refractivity;
    double radius = r0;
    for (std::size_t i = 0; i < shells.top_m.size(); ++i) {
        const double here = shells.refractivity[i];
        if (here != below) cross(radius, below, here);
        const double next = r0 + shells.top_m[i], q = ray.impact_m / (1 + here);
        ray.central_angle_rad += std::asin(std::min(1.0, q / radius)) - std::asin(std::min(1.0, q / next));
        radius = next;
        below = here;
    }
    cross(radius, below, 0);
    ray.exit_radius_m = radius;
    return ray;
}

double apparent_zenith(const RefractiveShells& shells, double true_zenith_rad) noexcept {
    return solve_zenith([&](double z) { return z + bend(shells, z).refraction_rad - true_zenith_rad; },
                        true_zenith_rad);
}

double apparent_zenith(const RefractiveShells& shells, double true_zenith_rad, double range_m) noexcept {
    return solve_zenith([&](double z) { return miss(shells, z, true_zenith_rad, range_m); }, true_zenith_rad);
}

LapseAtmosphere::LapseAtmosphere(double ground_refractivity, double temperature_k, double lapse_k_m,
                                 double tropopause_m)
    : ground_(ground_refractivity),
      temperature_k_(temperature_k),
      lapse_k_m_(lapse_k_m),
      tropopause_m_(tropopause_m),
      exponent_(kGravity_m_s2 / (kDryAir_j_kg_k * lapse_k_m) - 1) {
    const double cold_k = temperature_k - lapse_k_m * tropopause_m;
    at_tropopause_ = ground_ * std::pow(cold_k / temperature_k, exponent_);
    height_scale_m_ = kDryAir_j_kg_k * cold_k / kGravity_m_s2;
}

double LapseAtmosphere::operator()(double height_m) const noexcept {
    if (height_m < tropopause_m_) return ground_ * std::pow(1 - lapse_k_m_ * height_m / temperature_k_, exponent_);
    return at_tropopause_ * std::exp(-(height_m - tropopause_m_) / height_scale_m_);
}

}  // namespace narpa
