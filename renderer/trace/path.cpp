#include "renderer/trace/path.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <optional>

#include "renderer/trace/guide.h"
#include "renderer/trace/lights.h"
#include "renderer/trace/path_point.h"

namespace narpa {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// Behind so many surfaces a path that brings back less than this part of what it finds may end, at random.
constexpr int kSurfacesBeforeRoulette = 4;
constexpr float kFaint = 0.25f;
/// Random numbers: two groups for each surface of the longest path, then the roulette's.
constexpr std::uint32_t kRouletteGroup = 1 + 2 * 40;

/// The lanes whose bit is set, lowest first.
class EachLane {
public:
    explicit EachLane(std::uint32_t bits) : left_(bits) {}
    [[nodiscard]] EachLane begin() const { return *this; }
    [[nodiscard]] static EachLane end() { return EachLane(0); }
    std::size_t operator*() const { return static_cast<std::size_t>(std::countr_zero(left_)); }
    EachLane& operator++() {
        left_ &= left_ - 1;
        return *this;
    }
    friend bool operator==(const EachLane&, const EachLane&) = default;

private:
    std::uint32_t left_;
};
std::uint32_t bit(std::size_t lane) {
    return 1u << lane;
}

/// A packet of paths from the camera, surface by surface. What happens in a lane follows from its own ray and its
/// own random numbers alone.
class Walk {
public:
    Walk(const Tracer& tracer, const Placement& at, const PathSettings& settings,
         std::span<const PixelSampler> samplers, std::span<const std::uint32_t> sample, std::span<Rgb> radiance)
        : tracer_(tracer),
          scene_(tracer.scene()),
          lights_(tracer.lights()),
          at_(at),
          settings_(settings),
          group_(settings.direct ? Lights::Group::lights : Lights::Group::all),
          samplers_(samplers),
          sample_(sample),
          radiance_(radiance) {}

    void run(std::span<const Ray> rays, std::span<const Hit> first) {
        leave_camera(rays, first);
        const int depth = settings_.direct ? 1 : settings_.max_depth;
        for (int met = 0;; ++met) {
            gather(met);
            if (met == depth || going_ == 0) return;
            prepare(met, met + 1 < depth);
            ask_sun();
            ask_emitters();
            if (settings_.direct && !lights_.any_with_extent()) return;
            scatter(met);
            tracer_.intersect(at_, hits_, directions_, going_, hits_);
        }
    }

private:
    /// What a lane knows of its path.
    struct Lane {
        PathPoint point{};
        Receiver start{};                  ///< of the ray on its way, and of light asked for at the point
        Guide guide{};                     ///< of the next ray
        double direction_pdf = kInfinity;  ///< with which the ray's direction was chosen
        Rgb throughput{1, 1, 1};           ///< radiance at the camera per radiance along the ray
        float radiance_scale = 1;          ///< the part of it that leaving a dense medium undoes
        double length_m = 0;               ///< of the way from the camera to the point
        SamplePoint choose_light{}, choose_direction{};
    };

    void leave_camera(std::span<const Ray> rays, std::span<const Hit> first) {
        const std::size_t n = std::min({rays.size(), first.size(), radiance_.size(), kPacket});
        going_ = (1u << n) - 1;
        for (const std::size_t i : EachLane(going_)) {
            radiance_[i] = {};
            hits_[i] = first[i];
            directions_[i] = rays[i].direction;
            lanes_[i].start = receiver_at(rays[i].origin);
        }
    }

    /// Adds what the rays have found, and makes ready the surfaces where they go on.
    void gather(int met) {
        for (const std::size_t i : EachLane(going_)) {
            Lane& lane = lanes_[i];
            const bool escaped = hits_[i].body < 0;
            if (lights_.any_with_extent())
                add(i, lights_.met_before(escaped ? kInfinity : hits_[i].range_m, at_, lane.start, group_,
                                          directions_[i], lane.direction_pdf));
            if (escaped) {
                if (!settings_.direct) add(i, sky(lane, directions_[i]));
                going_ &= ~bit(i);
            } else if (met == 0 || !settings_.direct) {
                arrive(i);
            }
        }
    }

    [[nodiscard]] Rgb sky(const Lane& lane, const Vec3& direction) const {
        const std::optional<SunDisc>& sun = lights_.sun();
        if (!sun || sun->is_point()) return scene_.ambient;
        const double sun_pdf = sun->pdf(direction);
        if (sun_pdf == 0) return scene_.ambient;
        const float sunlight = static_cast<float>(power_heuristic(lane.direction_pdf, sun_pdf)) * sun->radiance();
        return scene_.ambient + Rgb{sunlight, sunlight, sunlight};
    }

    void arrive(std::size_t i) {
        Lane& lane = lanes_[i];
        const Hit& hit = hits_[i];
        lane.length_m += hit.range_m;
        lane.point = PathPoint(tracer_, at_, hit, directions_[i], settings_.pixel_angle_rad * lane.length_m,
                               !settings_.direct);
        const Surface& surface = lane.point.surface();
        if (surface.emission != Rgb{}) {
            const double light_pdf =
                lane.direction_pdf == kInfinity ? 0 : lights_.pdf(at_, lane.start, group_, directions_[i], hit);
            add(i, surface.emission * static_cast<float>(power_heuristic(lane.direction_pdf, light_pdf)));
        }
        if (settings_.direct) add(i, scene_.ambient * ambient_reflectance(surface));
        lane.start = receiver_at(at_, hit, lane.point.plane());
    }

    /// Random numbers, and where the next rays had better go: to be known before light is asked for, as both ways
    /// to find it are weighed against each other.
    void prepare(int met, bool lit_surfaces_count) {
        const auto group = static_cast<std::uint32_t>(1 + 2 * met);
        for (const std::size_t i : EachLane(going_)) {
            Lane& lane = lanes_[i];
            lane.choose_direction = samplers_[i].point(sample_[i], group);
            lane.choose_light = samplers_[i].point(sample_[i], group + 1);
            const bool guided = lit_surfaces_count && lights_.sun() && !is_specular(*lane.point.surface().material);
            lane.guide = guided ? Guide(tracer_, at_, lane.start) : Guide();
        }
    }

    /// Density per solid angle with which `scatter` finds a direction that the BSDF alone finds with `bsdf_pdf`.
    [[nodiscard]] double scatter_pdf(const Lane& lane, const Vec3& direction, double bsdf_pdf) const {
        const double share = lane.guide.share();
        if (share == 0) return bsdf_pdf;
        return (1 - share) * bsdf_pdf + share * lane.guide.pdf(tracer_, at_, lane.start, direction);
    }

    /// Light from a point of the Sun's disc for each lane.
    void ask_sun() {
        if (!lights_.sun()) return;
        const SunDisc& sun = *lights_.sun();
        Lanes<Vec3> to_sun;
        Lanes<Rgb> sunlit;
        std::uint32_t wanted = 0;
        for (const std::size_t i : EachLane(going_)) {
            const Lane& lane = lanes_[i];
            if (is_specular(*lane.point.surface().material)) continue;
            to_sun[i] = sun.sample(lane.choose_light[2], lane.choose_light[3]);
            const PathPoint::Response r = lane.point.respond(to_sun[i]);
            if (r.f_cos == Rgb{}) continue;
            // Rays find the disc as well, unless it is a point, or nothing beyond the first surface counts.
            const bool alone = sun.is_point() || settings_.direct;
            const double weight =
                alone ? 1 : power_heuristic(sun.pdf(to_sun[i]), scatter_pdf(lane, to_sun[i], r.pdf));
            sunlit[i] = r.f_cos * static_cast<float>(weight * static_cast<double>(sun.irradiance()) /
                                                     dot(to_sun[i], sun.centre()));
            wanted |= bit(i);
        }
        if (wanted == 0) return;
        for (const std::size_t i : EachLane(wanted & ~tracer_.occluded(at_, hits_, to_sun, wanted)))
            add(i, sunlit[i]);
    }

    /// Light from a point of one of the other emitters for each lane.
    void ask_emitters() {
        if (!lights_.any(group_)) return;
        Lanes<LightSample> samples;
        Lanes<PathPoint::Response> responses;
        Lanes<Vec3> towards;
        Lanes<double> range_m;
        std::uint32_t to_lights = 0, to_bodies = 0;
        for (const std::size_t i : EachLane(going_)) {
            const Lane& lane = lanes_[i];
            if (is_specular(*lane.point.surface().material)) continue;
            const auto& [u, v, choice, unused] = lane.choose_light;
            const std::optional<LightSample> light = lights_.sample(at_, lane.start, group_, choice, u, v);
            if (!light) continue;
            responses[i] = lane.point.respond(light->direction);
            if (responses[i].f_cos == Rgb{}) continue;
            responses[i].pdf = scatter_pdf(lane, light->direction, responses[i].pdf);
            samples[i] = *light;
            towards[i] = light->direction;
            range_m[i] = light->range_m;
            (light->body < 0 ? to_lights : to_bodies) |= bit(i);
        }
        if (to_lights != 0) {
            const std::uint32_t dark = tracer_.occluded(at_, hits_, towards, range_m, to_lights);
            for (const std::size_t i : EachLane(to_lights & ~dark)) {
                const double weight = power_heuristic(samples[i].pdf, responses[i].pdf);
                add(i, responses[i].f_cos * samples[i].radiance_per_pdf * static_cast<float>(weight));
            }
        }
        if (to_bodies != 0) {
            Lanes<Hit> found;
            tracer_.intersect(at_, hits_, towards, to_bodies, found);
            for (const std::size_t i : EachLane(to_bodies)) {
                if (found[i].body != samples[i].body || found[i].face != samples[i].face) continue;
                const double pdf = lights_.pdf(at_, lanes_[i].start, group_, towards[i], found[i]);
                if (!(pdf > 0)) continue;  // met where the ray starts
                const double weight = power_heuristic(pdf, responses[i].pdf);
                add(i, responses[i].f_cos * emission(lanes_[i], towards[i], found[i]) *
                           static_cast<float>(weight / pdf));
            }
        }
    }

    [[nodiscard]] Rgb emission(const Lane& lane, const Vec3& direction, const Hit& hit) const {
        const Material& m = scene_.materials[static_cast<std::size_t>(hit.material)];
        if (m.emission_texture < 0) return m.emission;
        const double width_m = settings_.pixel_angle_rad * (lane.length_m + hit.range_m);
        return surface_at(tracer_, at_, hit, direction, width_m).emission;
    }

    /// Chooses where the paths go on, and ends some that would bring little.
    void scatter(int met) {
        for (const std::size_t i : EachLane(going_)) {
            Lane& lane = lanes_[i];
            const BsdfSample s = next_direction(lane);
            lane.throughput = lane.throughput * s.weight;
            lane.radiance_scale *= s.radiance_scale;
            // Out of many shells of dense glass, one in another, it may outgrow single precision.
            if (lane.throughput == Rgb{} || !is_finite(lane.throughput) || !survives(i, met)) {
                going_ &= ~bit(i);
                continue;
            }
            directions_[i] = s.l;
            lane.direction_pdf = s.pdf;
            if (!s.transmitted) continue;
            hits_[i] = other_side(hits_[i]);
            lane.start = receiver_at(at_, hits_[i], -lane.point.plane());
        }
    }

    [[nodiscard]] BsdfSample next_direction(const Lane& lane) const {
        const auto& [u, v, lobe, choice] = lane.choose_direction;
        const double share = lane.guide.share();
        if (share == 0) return lane.point.scatter({lobe, u, v});
        BsdfSample s;
        if (choice < share)
            s.l = lane.guide.direction(tracer_, at_, lane.start, choice / share, u, v);
        else
            s = lane.point.scatter({lobe, u, v});
        const PathPoint::Response r = lane.point.respond(s.l);
        s.pdf = scatter_pdf(lane, s.l, r.pdf);
        s.weight = r.f_cos == Rgb{} ? Rgb{} : r.f_cos * static_cast<float>(1 / s.pdf);
        return s;
    }

    /// Russian roulette: who survives carries the others' share.
    bool survives(std::size_t i, int met) {
        if (met + 1 < kSurfacesBeforeRoulette) return true;
        Rgb& throughput = lanes_[i].throughput;
        const float brings = std::max({throughput.x, throughput.y, throughput.z}) / lanes_[i].radiance_scale;
        if (brings >= kFaint) return true;
        const float chance = brings / kFaint;
        const auto k = static_cast<std::uint32_t>(met + 1 - kSurfacesBeforeRoulette);
        if (samplers_[i].point(sample_[i], kRouletteGroup + k / 4)[k % 4] >= static_cast<double>(chance))
            return false;
        throughput = throughput / chance;
        return true;
    }

    void add(std::size_t i, const Rgb& radiance) { radiance_[i] += lanes_[i].throughput * radiance; }

    const Tracer& tracer_;
    const Scene& scene_;
    const Lights& lights_;
    const Placement& at_;
    const PathSettings& settings_;
    const Lights::Group group_;
    const std::span<const PixelSampler> samplers_;
    const std::span<const std::uint32_t> sample_;
    const std::span<Rgb> radiance_;

    std::uint32_t going_ = 0;  ///< lanes whose paths have not ended
    Lanes<Lane> lanes_;
    Lanes<Vec3> directions_;  ///< of the rays on their way
    Lanes<Hit> hits_;         ///< where they start, then where they end
};

}  // namespace

void path_radiance(const Tracer& tracer, const Placement& at, const PathSettings& settings,
                   std::span<const Ray> rays, std::span<const Hit> first, std::span<const PixelSampler> samplers,
                   std::span<const std::uint32_t> sample, std::span<Rgb> radiance) noexcept {
    Walk(tracer, at, settings, samplers, sample, radiance).run(rays, first);
}

}  // namespace narpa
