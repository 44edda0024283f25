#include "renderer/lidar/lidar_receiver.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace narpa {
namespace {

/// Sub-rays whose ranges are farther apart than so many times their mean distance are of different surfaces.
constexpr double kMeanSpacings = 4;
constexpr std::uint32_t kStream = 0x4c000000u;  ///< of the random numbers: none of a camera's

/// Uniform in (0, 1).
double uniform(std::uint32_t word) {
    return (word + 0.5) * 0x1p-32;
}

/// Standard normal (Box and Muller 1958).
double normal(std::uint32_t a, std::uint32_t b) {
    return std::sqrt(-2 * std::log(uniform(a))) * std::cos(2 * std::numbers::pi * uniform(b));
}

double light_of(const LidarReturn& r) {
    return static_cast<double>(r.reflectivity) / (r.range_m * r.range_m);
}

/// Two axes that complete a unit vector.
std::array<Vec3, 2> across(const Vec3& z) {
    const Vec3 any = std::abs(z.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    const Vec3 x = normalized(cross(any, z));
    return {x, cross(z, x)};
}

}  // namespace

LidarReceiver::LidarReceiver(const LidarReceiverModel& model, double range_max_m, std::uint64_t seed,
                             std::size_t lidar)
    : model_(model),
      range_max_m_(range_max_m),
      schedule_(seed),
      stream_(kStream + static_cast<std::uint32_t>(lidar)),
      met_(kLanes * static_cast<std::size_t>(model.sub_rays)) {
    // Evenly spread over the disc: a lattice by the golden section.
    for (int i = 0; i < model.sub_rays && model.sub_rays > 1; ++i) {
        radius_.push_back(std::tan(0.5 * model.beam_divergence_rad) * std::sqrt((i + 0.5) / model.sub_rays));
        turn_.push_back(2 * std::numbers::pi * i / std::numbers::phi);
    }
}

void LidarReceiver::receive(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, std::uint64_t first,
                            std::span<LidarReturn> returns) noexcept {
    const bool one = model_.sub_rays == 1, exact = model_.range_noise_m == 0 && model_.range_bias_m == 0;
    RandomLanes random;
    if (!one || model_.range_noise_m > 0)
        random =
            philox(schedule_, static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(first >> 32), stream_);
    if (one)
        shoot(tracer, at, beams, range_max_m_, returns);
    else
        gather(tracer, at, beams, random, returns);
    const double least_light =
        model_.range_at_10_percent_m > 0 ? 0.1 / std::pow(model_.range_at_10_percent_m, 2) : 0;
    for (std::size_t i = 0; i < beams.n; ++i) {
        LidarReturn& r = returns[i];
        if (!(r.range_m > 0)) continue;
        if (light_of(r) < least_light) r = {};
        if (exact || r.body < 0) continue;
        r.range_m += model_.range_bias_m;
        if (model_.range_noise_m > 0) r.range_m += model_.range_noise_m * normal(random.w0[i], random.w1[i]);
        if (!(r.range_m > 0 && r.range_m < range_max_m_)) r = {};
    }
}

void LidarReceiver::gather(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams,
                           const RandomLanes& random, std::span<LidarReturn> returns) noexcept {
    const std::size_t sub_rays = radius_.size();
    Lanes<std::array<Vec3, 2>> axes;
    for (std::size_t i = 0; i < beams.n; ++i) axes[i] = across(beams.direction[i]);
    RayBatch rays = beams;
    std::array<LidarReturn, kLanes> met;
    for (std::size_t s = 0; s < sub_rays; ++s) {
        for (std::size_t i = 0; i < beams.n; ++i) {
            // Turned at random, so that no edge favours the lattice.
            const double turn = turn_[s] + 2 * std::numbers::pi * uniform(random.w2[i]);
            const Vec3 aside = std::cos(turn) * axes[i][0] + std::sin(turn) * axes[i][1];
            rays.direction.put(i, normalized(beams.direction[i] + radius_[s] * aside));
        }
        shoot(tracer, at, rays, range_max_m_, met);
        for (std::size_t i = 0; i < beams.n; ++i) met_[i * sub_rays + s] = met[i];
    }
    for (std::size_t i = 0; i < beams.n; ++i) returns[i] = echo_of(std::span(met_).subspan(i * sub_rays, sub_rays));
}

LidarReturn LidarReceiver::echo_of(std::span<LidarReturn> sub_rays) const noexcept {
    const auto n = static_cast<double>(sub_rays.size());
    const double least_light =
        model_.range_at_10_percent_m > 0 ? 0.1 / std::pow(model_.range_at_10_percent_m, 2) : 0;
    const auto end =
        std::partition(sub_rays.begin(), sub_rays.end(), [](const LidarReturn& r) { return r.range_m > 0; });
    if (end == sub_rays.begin()) return {};
    std::sort(sub_rays.begin(), end,
              [](const LidarReturn& a, const LidarReturn& b) { return a.range_m < b.range_m; });
    const double spacing_m = ((end - 1)->range_m - sub_rays.front().range_m) / n;
    const double gap_m = std::max(model_.pulse_length_m, kMeanSpacings * spacing_m);
    LidarReturn reported;
    double most_light = -1;
    for (auto begin = sub_rays.begin(); begin != end;) {
        auto next = begin + 1;
        while (next != end && next->range_m - (next - 1)->range_m <= gap_m) ++next;
        double light = 0, moment = 0, brightest = -1;
        int body = begin->body;
        for (auto r = begin; r != next; ++r) {
            const double l = light_of(*r) / n;
            light += l, moment += l * (r->range_m - begin->range_m);
            if (l > brightest) brightest = l, body = r->body;
        }
        const double range_m = begin->range_m + (light > 0 ? moment / light : 0);
        const bool farther = model_.echo == LidarReceiverModel::Echo::last;
        if (farther ? light >= least_light : light > most_light) {
            most_light = light;
            reported = {range_m, static_cast<float>(light * range_m * range_m), body};
        }
        begin = next;
    }
    return reported;
}

}  // namespace narpa
