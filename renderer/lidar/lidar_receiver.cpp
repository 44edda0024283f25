#include "renderer/lidar/lidar_receiver.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "base/constants.h"
#include "renderer/scene/lidar_sunlight.h"

namespace narpa {
namespace {

/// Sub-rays whose ranges are farther apart than this many mean spacings belong to different surfaces.
constexpr double kMeanSpacings = 6;
/// Random numbers: c2 of the counters, above those of a camera (SensorDraw). One block for each echo of a shot.
constexpr std::uint32_t kStream = 0x4c000000u, kEchoStream = 0x10000u;

/// Number of the medium's own echo, after those of surfaces.
constexpr std::size_t kAirEcho = LidarReceiver::kMaxEchoes;

/// Uniform in (0, 1).
double uniform(std::uint32_t word) {
    return (word + 0.5) * 0x1p-32;
}

double light_of(const LidarReturn& r) {
    return static_cast<double>(r.reflectivity) / (r.range_m * r.range_m);
}

}  // namespace

/// The random numbers of a batch, generated on demand.
class LidarReceiver::Draws {
public:
    Draws(const LidarReceiver& receiver, std::uint64_t first) : receiver_(receiver), first_(first) {}

    const RandomLanes& of_echo(std::size_t number) {
        for (; made_ <= number; ++made_)
            blocks_[made_] = philox(receiver_.schedule_, static_cast<std::uint32_t>(first_),
                                    static_cast<std::uint32_t>(first_ >> 32),
                                    receiver_.stream_ + static_cast<std::uint32_t>(made_) * kEchoStream);
        return blocks_[number];
    }

private:
    const LidarReceiver& receiver_;
    std::uint64_t first_;
    std::array<RandomLanes, kAirEcho + 1> blocks_;
    std::size_t made_ = 0;
};

LidarReceiver::LidarReceiver(const Tracer& tracer, const Lidar& lidar, std::uint64_t seed, std::size_t index)
    : tracer_(tracer),
      model_(lidar.receiver),
      range_max_m_(lidar.range_max_m),
      shot_range_max_m_(model_.range_ambiguity_m > 0 ? kInfinity : range_max_m_),
      mount_(lidar.mount),
      sunlight_(sees_sunlight(lidar)),
      reports_sunlight_(lidar.model && lidar.model->spec().measures_sunlight),
      min_light_(model_.range_at_10_percent_m > 0 ? 0.1 / std::pow(model_.range_at_10_percent_m, 2) : 0),
      random_(model_.range_noise_m > 0 || model_.range_noise_at_limit_m > 0 || model_.velocity_noise_m_s > 0),
      schedule_(seed),
      stream_(kStream + static_cast<std::uint32_t>(index)),
      cone_(model_.beam_divergence_rad, model_.sub_rays),
      culling_(tracer, cone_.tangent(), shot_range_max_m_),
      met_(kLanes * cone_.size()),
      multipath_(tracer, lidar, seed, index, cone_.size()) {
    const bool small_parts_may_matter =
        multipath_.is_on() ||
        std::ranges::any_of(tracer.scene().materials, [](const Material& m) { return m.retroreflectance > 0; });
    if (!small_parts_may_matter && cone_.size() <= std::size_t{LidarReceiverModel::kMaxSubRays})
        probes_ = BeamProbes(cone_);
}

std::uint32_t LidarReceiver::receive(const BodyPoses& at, const RayBatch& beams, std::uint64_t first,
                                     std::span<const Motion> motions, std::span<LidarEchoes> echoes) noexcept {
    const ShotSettings settings{.range_max_m = shot_range_max_m_,
                                .multipath = model_.multipath != LidarReceiverModel::Multipath::none,
                                .sunlight = sunlight_ ? ~0u : 0u,
                                .motions = motions,
                                .mount = mount_,
                                .medium = medium_};
    Draws draws(*this, first);
    const std::uint32_t meeting = culling_.find_meeting(at, beams);
    trace(at, beams, first, meeting, settings, draws);
    const bool sees_air = air_.is_possible() || (bright_air_ && reports_sunlight_);
    const std::uint32_t possible = sees_air ? lanes_below(beams.n) : meeting;
    for_each_lane(possible, [&](std::size_t i) {
        LidarEchoes& out = echoes[i] = {};
        const auto met = is_set(meeting, i) ? met_by(i) : std::span<LidarReturn>();
        const double axis_m = met.empty() ? 0 : met.front().range_m;
        if (!met.empty()) out.sunlight = met.front().sunlight;
        EchoList list;
        std::size_t n = 1;
        if (!met.empty() && is_set(on_plane_, i))
            list[0] = echo_of_plane(met, ratios_[i]);
        else
            n = part(met, list);
        if (n > 0 && multipath_.is_on()) n = add_multipath(multipath_.of_beam(first_[i]), list, n);
        if (n == 0 && !sees_air) return;
        if (bright_air_)
            out.sunlight += sunlight_in_air(at, beams[i], axis_m, uniform(draws.of_echo(kAirEcho).w1[i]));
        const double noise = noise_in(static_cast<double>(out.sunlight));
        double most = -1, second = -1;
        const auto report = [&](const LidarEcho& echo, double light) {
            if (!(echo.range_m > 0)) return;
            if (light > most) {
                out.second = std::exchange(out.strongest, echo);
                second = std::exchange(most, light);
            } else if (light > second) {
                out.second = echo;
                second = light;
            }
            out.last = echo;
        };
        if (air_.is_possible()) {
            const Echo air = air_echo(at, beams[i], settings, met, noise, uniform(draws.of_echo(kAirEcho).w3[i]));
            if (air.light > 0) report(measure(air, noise, i, kAirEcho, draws), air.light);
            for (Echo& echo : std::span(list).first(n)) echo.light += air_.light_at(at, beams[i], echo.range_m);
        }
        for (std::size_t k = 0; k < n; ++k) report(detect(list[k], noise, i, k, draws), list[k].light);
    });
    return possible;
}

/// Sunlight that the medium scatters into the beam, up to what its axis meets at `axis_m` (0: nothing); in units of
/// a white surface that faces the Sun.
float LidarReceiver::sunlight_in_air(const BodyPoses& at, const Ray& beam, double axis_m, double u) const noexcept {
    const double range_m = axis_m > 0 ? axis_m : kInfinity;
    return static_cast<float>(std::numbers::pi / tracer_.scene().sun->irradiance_w_m2 *
                              medium_->in_scattering(at, beam, range_m, u));
}

/// Noise of the receiver relative to that in the dark.
double LidarReceiver::noise_in(double sunlight) const noexcept {
    return std::sqrt(1 + model_.sunlight_noise * sunlight);
}

/// The medium's own echo, along the beam's axis; if there is none, its light is 0.
LidarReceiver::Echo LidarReceiver::air_echo(const BodyPoses& at, const Ray& beam, const ShotSettings& settings,
                                            std::span<const LidarReturn> met, double noise,
                                            double u) const noexcept {
    double nearest_m = kInfinity;
    for (const LidarReturn& r : met)
        if (r.range_m > 0) nearest_m = std::min(nearest_m, r.range_m);
    const auto [light, range_m] = air_.first(at, beam, nearest_m, noise, u);
    if (!(light > 0) || settings.motions.empty()) return {light, range_m};
    const Vec3 velocity =
        velocity_at(settings, at, medium_->body(), beam.origin + range_m * beam.direction, beam.time) -
        velocity_at(settings, at, settings.mount, beam.origin, beam.time);
    return {light, range_m, dot(beam.direction, velocity)};
}

/// Traces the beams `wanted`: the probes of all, where there are probes, and the other sub-rays of those whose
/// probes do not lie on a plane.
void LidarReceiver::trace(const BodyPoses& at, const RayBatch& beams, std::uint64_t first, std::uint32_t wanted,
                          const ShotSettings& settings, Draws& draws) noexcept {
    const std::size_t sub_rays = cone_.size(), probes = probes_.size();
    std::size_t count = 0;
    for_each_lane(wanted, [&](std::size_t i) {
        if (sub_rays > 1) across_[i] = BeamCone::across(beams.direction[i], draws.of_echo(0).w2[i]);
        first_[i] = sub_rays * count++;
    });
    on_plane_ = 0;
    if (probes == 0) return trace(at, beams, first, wanted, 0, sub_rays, settings);
    trace(at, beams, first, wanted, 0, probes, settings);
    for_each_lane(wanted, [&](std::size_t i) {
        if (probes_.lie_on_plane(std::span(met_).subspan(first_[i], probes), ratios_[i])) on_plane_ |= 1u << i;
    });
    trace(at, beams, first, wanted & ~on_plane_, probes, sub_rays, settings);
}

/// Traces the sub-rays `begin` to `end` of each of the beams `wanted`. They are nearly parallel, so they are traced
/// in one batch, through the bodies that their beams may hit.
void LidarReceiver::trace(const BodyPoses& at, const RayBatch& beams, std::uint64_t first, std::uint32_t wanted,
                          std::size_t begin, std::size_t end, ShotSettings settings) noexcept {
    const bool sunlight = settings.sunlight != 0;
    for (std::size_t s = begin; wanted != 0;) {
        RayBatch rays;
        DiffuseMultipath::SubRays of_beams;
        std::uint32_t shots = 0;
        settings.sunlight = 0;
        Lanes<std::size_t> place;  // in `met_`
        while (rays.n < kLanes && wanted != 0) {
            const auto i = static_cast<std::size_t>(std::countr_zero(wanted));
            const std::size_t n = std::min(end - s, kLanes - rays.n);
            // Sunlight of the first sub-ray alone, which is the nearest to the axis.
            if (sunlight && s == 0) settings.sunlight |= 1u << rays.n;
            for (std::size_t j = 0; j < n; ++j) place[rays.n + j] = first_[i] + s + j;
            if (multipath_.is_on())
                for (std::size_t j = 0; j < n; ++j)
                    of_beams.put(rays.n + j, first + i, s + j, place[rays.n + j], beams.direction[i]);
            cone_.append(beams[i], across_[i], s, n, rays);
            shots |= 1u << i;
            s += n;
            if (s == end) wanted &= wanted - 1, s = begin;
        }
        settings.bodies = culling_.bodies_of(shots);
        std::array<LidarReturn, kLanes> met;
        HitBatch hits;
        shoot(tracer_, at, rays, settings, met, hits);
        for (std::size_t j = 0; j < rays.n; ++j) met_[place[j]] = met[j];
        if (multipath_.is_on()) multipath_.trace(at, rays, of_beams, hits, std::span(met).first(rays.n), settings);
    }
}

/// The returns of a shot: of its probes, or of all its sub-rays.
std::span<LidarReturn> LidarReceiver::met_by(std::size_t shot) noexcept {
    return std::span(met_).subspan(first_[shot], is_set(on_plane_, shot) ? probes_.size() : cone_.size());
}

/// The echo of a shot whose probes lie on a plane.
LidarReceiver::Echo LidarReceiver::echo_of_plane(std::span<const LidarReturn> probes,
                                                 const BeamProbes::Ratios& ratios) noexcept {
    const auto [nearest, farthest] = std::ranges::minmax(probes, {}, &LidarReturn::range_m);
    Echo echo = echo_of(probes, nearest.range_m, farthest.range_m, static_cast<double>(probes.size()));
    echo.light *= ratios.light;
    echo.range_m *= ratios.range;
    return echo;
}

/// Adds the light of one of `n` rays of a beam.
void LidarReceiver::add_light(const LidarReturn& r, double n, Echo& echo) noexcept {
    const double light = light_of(r) / n;
    if (!(light > 0)) return;
    const double share = light / (echo.light + light);
    echo.light += light;
    echo.range_m += share * (r.range_m - echo.range_m);
    echo.velocity_m_s += share * (r.velocity_m_s - echo.velocity_m_s);
}

/// Makes one echo of the returns `met`, of a beam of `n` sub-rays.
LidarReceiver::Echo LidarReceiver::echo_of(std::span<const LidarReturn> met, double nearest_m, double farthest_m,
                                           double n) noexcept {
    double light = 0, moment = 0, velocity = 0, velocity_of_nearest = 0;
    for (const LidarReturn& r : met) {
        if (!(r.range_m > 0)) continue;
        if (r.range_m == nearest_m) velocity_of_nearest = r.velocity_m_s;
        const double l = light_of(r) / n;
        light += l;
        moment += l * (r.range_m - nearest_m);
        velocity += l * r.velocity_m_s;
    }
    if (!(light > 0)) return {light, nearest_m, velocity_of_nearest, nearest_m, farthest_m};
    return {light, nearest_m + moment / light, velocity / light, nearest_m, farthest_m};
}

/// Returns the number of echoes, the nearest first. Sorts the sub-rays by range where there may be several.
std::size_t LidarReceiver::part(std::span<LidarReturn> sub_rays, EchoList& echoes) const noexcept {
    if (sub_rays.empty()) return 0;
    if (sub_rays.size() == 1) {
        const LidarReturn& r = sub_rays.front();
        if (!(r.range_m > 0)) return 0;
        echoes[0] = {light_of(r), r.range_m, r.velocity_m_s, r.range_m, r.range_m};
        return 1;
    }
    const auto n = static_cast<double>(sub_rays.size());
    double nearest_m = kInfinity, farthest_m = 0;
    for (const LidarReturn& r : sub_rays) {
        nearest_m = std::min(nearest_m, choose(r.range_m > 0, r.range_m, kInfinity));
        farthest_m = std::max(farthest_m, r.range_m);
    }
    if (!(farthest_m > 0)) return 0;
    if (farthest_m - nearest_m <= model_.pulse_length_m) {
        echoes[0] = echo_of(sub_rays, nearest_m, farthest_m, n);
        return 1;
    }
    const auto end =
        std::partition(sub_rays.begin(), sub_rays.end(), [](const LidarReturn& r) { return r.range_m > 0; });
    std::sort(sub_rays.begin(), end,
              [](const LidarReturn& a, const LidarReturn& b) { return a.range_m < b.range_m; });
    const double gap_m = std::max(model_.pulse_length_m, kMeanSpacings * (farthest_m - nearest_m) / n);
    std::size_t count = 0;
    for (auto begin = sub_rays.begin(); begin != end && count < kMaxEchoes; ++count) {
        auto next = begin + 1;
        while (next != end && next->range_m - (next - 1)->range_m <= gap_m) ++next;
        echoes[count] = echo_of({begin, next}, begin->range_m, (next - 1)->range_m, n);
        begin = next;
    }
    return count;
}

/// Light within a pulse's length of an echo is added to it. Of later light, the interval of a pulse's length with
/// the most of it is an echo of its own. `late`: returns of one beam, equally weighted; their order changes.
/// Returns the number of echoes, the nearest first.
std::size_t LidarReceiver::add_multipath(std::span<LidarReturn> late, EchoList& echoes,
                                         std::size_t n) const noexcept {
    const auto rays = static_cast<double>(late.size());
    std::size_t later = 0;
    for (const LidarReturn& r : late) {
        if (!(r.range_m > 0)) continue;
        std::size_t k = n;
        while (k > 0 && !(r.range_m >= echoes[k - 1].first_m)) --k;
        if (k == 0 || r.range_m > echoes[k - 1].last_m + model_.pulse_length_m)
            late[later++] = r;
        else
            add_light(r, rays, echoes[k - 1]);
    }
    if (later == 0 || n == kMaxEchoes) return n;
    late = late.first(later);
    std::ranges::sort(late, {}, &LidarReturn::range_m);
    Echo strongest, window;
    for (std::size_t begin = 0, end = 0; begin < later; ++begin) {
        while (end < later && late[end].range_m <= late[begin].range_m + model_.pulse_length_m) ++end;
        window = {};
        for (const LidarReturn& r : late.subspan(begin, end - begin)) add_light(r, rays, window);
        if (window.light > strongest.light) strongest = window;
    }
    const auto place = std::ranges::upper_bound(std::span(echoes).first(n), strongest.range_m, {}, &Echo::range_m);
    std::copy_backward(place, std::span(echoes).first(n).end(), std::span(echoes).first(n + 1).end());
    *place = strongest;
    return n + 1;
}

/// Returns an empty echo if it is not detected.
LidarEcho LidarReceiver::detect(const Echo& echo, double noise, std::size_t lane, std::size_t number,
                                Draws& draws) const noexcept {
    if (min_light_ > 0) {
        const double detected = detection_probability(echo.light / (noise * min_light_), model_.detection_snr);
        if (detected < 1 && uniform(draws.of_echo(number).w3[lane]) >= detected) return {};
    }
    return measure(echo, noise, lane, number, draws);
}

/// Measures a detected echo; returns an empty one if it is out of range.
LidarEcho LidarReceiver::measure(const Echo& echo, double noise, std::size_t lane, std::size_t number,
                                 Draws& draws) const noexcept {
    LidarEcho out{echo.range_m, static_cast<float>(echo.light * echo.range_m * echo.range_m), echo.velocity_m_s};
    // Strength of the threshold over that of the echo; 0 if there is no limit.
    const double late = min_light_ > 0 ? noise * min_light_ / echo.light : 0;
    out.range_m += model_.range_bias_m + model_.range_walk_m * late;
    if (random_) {
        // Box and Muller 1958.
        const RandomLanes& words = draws.of_echo(number);
        const double radius = std::sqrt(-2 * std::log(uniform(words.w0[lane]))),
                     turn = 2 * std::numbers::pi * uniform(words.w1[lane]);
        out.range_m +=
            std::hypot(model_.range_noise_m, model_.range_noise_at_limit_m * late) * radius * std::cos(turn);
        out.velocity_m_s += model_.velocity_noise_m_s * radius * std::sin(turn);
    }
    if (model_.range_ambiguity_m > 0) out.range_m = std::fmod(out.range_m, model_.range_ambiguity_m);
    if (model_.velocity_ambiguity_m_s > 0)
        out.velocity_m_s = std::remainder(out.velocity_m_s, model_.velocity_ambiguity_m_s);
    if (!(out.range_m > model_.range_min_m && out.range_m < range_max_m_)) return {};
    return out;
}

}  // namespace narpa
