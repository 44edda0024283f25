#include "renderer/integrator/path.h"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <variant>

#include "base/each_isa.h"
#include "renderer/integrator/batch_sampler.h"
#include "renderer/integrator/path_reuse.h"
#include "renderer/integrator/path_state.h"
#include "renderer/integrator/path_vertex.h"
#include "renderer/light/lights.h"

namespace narpa {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// A path that brings back less than this part of what it finds may end, at random: once it has brought some light,
/// as the rest seldom adds much; without any, as on night sides, only behind so many surfaces.
constexpr float kFaint = 0.5f, kFaintInTheDark = 0.25f;
constexpr int kSurfacesInTheDark = 4;
/// Random numbers: two groups for each surface of the longest path, then the roulette's, four surfaces a group,
/// then the choice of what is shared.
constexpr std::uint32_t kRouletteGroup = 1 + 2 * 40, kSharingGroup = kRouletteGroup + 40 / 4 + 1;
/// Suns no wider than this are left to next-event estimation alone where the surface has no lobe: there a ray by
/// the BSDF finds the disc so seldom that it is not worth the densities.
constexpr double kNarrowSun_rad = 0.2;

using Points = BatchSampler::Points;
NARPA_EACH_ISA void next_points(const PathNumbers& from, std::size_t n, const Lanes<std::uint32_t>& pixel,
                                const Lanes<std::uint32_t>& sample, std::uint32_t group, Points& u) noexcept {
    BatchSampler(from.seed, from.frame, n, pixel, sample).points(group, u);
}

/// Paths from the camera, surface by surface; those that have ended make room for the rest. What happens to a path
/// follows from its own ray and its own random numbers alone, but where paths share what they find.
class Stream {
public:
    Stream(const RenderScene& render_scene, const BodyPoses& at, const PathSettings& settings,
           const PathNumbers& numbers)
        : tracer_(render_scene.tracer()),
          scene_(render_scene.scene()),
          lights_(render_scene.lights()),
          at_(at),
          settings_(settings),
          numbers_(numbers),
          group_(settings.direct ? Lights::Group::lights : Lights::Group::all),
          sun_(lights_.sun() ? &*lights_.sun() : nullptr),
          sun_has_extent_(sun_ != nullptr && !sun_->is_point()),
          narrow_sun_(sun_ != nullptr && scene_.sun->angular_diameter_rad < kNarrowSun_rad),
          guided_(settings.guided && sun_ != nullptr && !settings.direct),
          emitters_(lights_.any(group_)),
          receivers_(emitters_ || lights_.any_with_extent() || guided_),
          finds_alone_(scene_.ambient != Rgb{} || (sun_has_extent_ && !narrow_sun_)),
          sun_alone_(!lights_.any(Lights::Group::all) && !lights_.any_with_extent() && scene_.ambient == Rgb{}) {}

    void run(std::span<const Ray> rays, std::span<const Hit> first, std::span<Rgb> radiance) {
        radiance_ = radiance;
        leave_camera(rays, first);
        go_on();
    }
    void run_shared(std::span<const FirstSurface> first, std::span<Rgb> radiance, std::span<float> variance) {
        shared_ = !settings_.direct && settings_.max_depth > 1;
        radiance_ = radiance;
        variance_ = variance;
        std::fill(variance.begin(), variance.end(), 0.0f);
        leave_camera(first);
        go_on();
    }
    [[nodiscard]] std::uint64_t rays_traced() const { return rays_traced_; }

private:
    void go_on() {
        const int depth = settings_.direct ? 1 : settings_.max_depth;
        for (int met = 0;; ++met) {
            gather(met);
            if (met == 1 && shared_) begin_bounces();
            if (met == depth || n_ == 0) break;
            ask(met, met + 1 < depth);
            if (settings_.direct && !lights_.any_with_extent()) return;
            scatter(met, met + 1 == depth);
            trace();
        }
        if (n_bounces_ > 0) share_bounces();
    }

    void leave_camera(std::span<const Ray> rays, std::span<const Hit> first) {
        n_ = rays.size();
        for (std::size_t i = 0; i < n_; ++i) {
            radiance_[i] = {};
            hits_[i] = first[i];
            directions_[i] = rays[i].direction;
            paths_[i] = Path{};
            paths_[i].ray = static_cast<std::uint32_t>(i);
            paths_[i].to = &radiance_[i];
            if (receivers_) paths_[i].start = receiver_at(rays[i].origin);
        }
    }

    void leave_camera(std::span<const FirstSurface> first) {
        starts_.clear();
        n_ = 0;
        for (std::size_t from = 0; from < first.size(); from += kLanes) {
            const std::span<const FirstSurface> some = first.subspan(from, std::min(kLanes, first.size() - from));
            Points roulette;
            if (!finds_alone_) draw(some, kRouletteGroup, roulette);
            for (std::size_t k = 0; k < some.size(); ++k) {
                const std::size_t ray = from + k;
                const FirstSurface& f = some[k];
                radiance_[ray] = {};
                if (!f.met() && !lights_.any_with_extent()) {
                    radiance_[ray] = sky({}, f.rays->direction[f.lane]);
                    continue;
                }
                float chance = 1;
                int number = -1;
                if (f.lit()) {
                    if (!shared_) continue;
                    const Rgb albedo = f.surfaces->diffuse[f.lane] + f.surfaces->specular[f.lane];
                    chance = chance_to_set_out(albedo, !f.sunlit);
                    number = starts_.add(at_, f, ray, chance);
                    if (chance < 1 && roulette[0][k] >= static_cast<double>(chance)) continue;
                }
                Path& path = paths_[n_];
                path = Path{};
                path.ray = static_cast<std::uint32_t>(ray);
                path.to = &radiance_[ray];
                path.shares = number;
                path.lit = path.sun_asked = f.lit();
                path.sunlit = f.lit() && f.sunlit;
                path.throughput = Rgb{1, 1, 1} / chance;
                if (receivers_) path.start = receiver_at(f.rays->origin[f.lane]);
                hits_[n_] = (*f.hits)[f.lane];
                directions_[n_] = f.rays->direction[f.lane];
                ++n_;
            }
        }
    }
    void draw(std::span<const FirstSurface> some, std::uint32_t group, Points& u) const {
        Lanes<std::uint32_t> pixel{}, sample{};
        for (std::size_t k = 0; k < some.size(); ++k) pixel[k] = some[k].pixel, sample[k] = some[k].sample;
        next_points(numbers_, some.size(), pixel, sample, group, u);
    }

    /// Adds what the rays have found, and makes ready the surfaces where they go on.
    void gather(int met) {
        std::size_t kept = 0;
        for (std::size_t i = 0; i < n_; ++i) {
            Path& path = paths_[i];
            const bool escaped = hits_[i].body < 0;
            if (lights_.any_with_extent())
                add(path, lights_.met_before(escaped ? kInfinity : hits_[i].range_m, at_, path.start, group_,
                                             directions_[i], path.direction_pdf));
            if (escaped && !settings_.direct) add(path, sky(path, directions_[i]));
            if (escaped || (met > 0 && settings_.direct)) continue;
            keep(i, kept);
            arrive(kept++);
        }
        n_ = kept;
    }

    void keep(std::size_t from, std::size_t to) {
        if (from == to) return;
        paths_[to] = paths_[from];
        hits_[to] = hits_[from];
        directions_[to] = directions_[from];
    }

    [[nodiscard]] Rgb sky(const Path& path, const Vec3& direction) const {
        if (!sun_has_extent_ || path.sun_asked) return scene_.ambient;
        const double sun_pdf = sun_->pdf(direction);
        if (sun_pdf == 0) return scene_.ambient;
        const float sunlight = static_cast<float>(power_heuristic(path.direction_pdf, sun_pdf)) * sun_->radiance();
        return scene_.ambient + Rgb{sunlight, sunlight, sunlight};
    }

    void arrive(std::size_t i) {
        Path& path = paths_[i];
        const Hit& hit = hits_[i];
        path.length_m += hit.range_m;
        points_[i] = PathPoint(tracer_, at_, hit, directions_[i], settings_.pixel_angle_rad * path.length_m,
                               !settings_.direct);
        const Surface& surface = points_[i].surface();
        if (surface.emission != Rgb{} && !path.lit) {
            const double light_pdf =
                path.direction_pdf == kInfinity ? 0 : lights_.pdf(at_, path.start, group_, directions_[i], hit);
            add(path, surface.emission * static_cast<float>(power_heuristic(path.direction_pdf, light_pdf)));
        }
        if (settings_.direct) add(path, scene_.ambient * ambient_reflectance(surface));
        if (receivers_) path.start = receiver_at(at_, hit, points_[i].plane());
    }

    /// Those of the points met that may stand for others become bounces; light of their paths is theirs.
    void begin_bounces() {
        n_bounces_ = 0;
        for (std::size_t i = 0; i < n_; ++i) {
            Path& path = paths_[i];
            path.lit = false;
            if (path.shares < 0 || !Bounce::possible(points_[i])) continue;
            path.bounce = static_cast<int>(n_bounces_);
            Bounce& b = bounces_[n_bounces_++];
            b.point = points_[i];
            b.position = hits_[i].position;
            b.touching_m = touching_m(static_cast<std::size_t>(hits_[i].body));
            b.found_from = static_cast<std::size_t>(path.shares);
            b.incident = {};
        }
    }
    /// What stands so close before a body's surface cannot be told from it: meshes are held in single precision.
    [[nodiscard]] double touching_m(std::size_t body) const {
        return tracer_.shape(body).properties().resolution_m;
    }
    [[nodiscard]] Bounce* bounce_at(const Path& path, int met) {
        return met == 1 && path.bounce >= 0 ? &bounces_[static_cast<std::size_t>(path.bounce)] : nullptr;
    }
    void share_bounces() {
        const PixelSampler numbers(numbers_.seed, numbers_.frame, numbers_.pixel[0]);
        rays_traced_ += starts_.gather(tracer_, at_, bounces_.from(0, n_bounces_),
                                       numbers.point(numbers_.sample[0], kSharingGroup)[0],
                                       settings_.pixel_angle_rad, radiance_, variance_);
    }

    /// Random numbers of the packet that begins with this path.
    void draw(std::size_t first, std::uint32_t group, Points& u) const {
        const std::size_t n = std::min(kLanes, n_ - first);
        Lanes<std::uint32_t> pixel{}, sample{};
        for (std::size_t k = 0; k < n; ++k) {
            pixel[k] = numbers_.pixel[paths_[first + k].ray];
            sample[k] = numbers_.sample[paths_[first + k].ray];
        }
        next_points(numbers_, n, pixel, sample, group, u);
    }
    static std::uint32_t direction_group(int met) { return static_cast<std::uint32_t>(1 + 2 * met); }
    static std::uint32_t light_group(int met) { return static_cast<std::uint32_t>(2 + 2 * met); }

    /// Light that the Sun and other emitters send straight to the points.
    void ask(int met, bool lit_surfaces_count) {
        to_sun_ = to_lights_ = to_bodies_ = 0;
        Points u;
        for (std::size_t first = 0; first < n_; first += kLanes) {
            if (emitters_ || sun_has_extent_) draw(first, light_group(met), u);
            for (std::size_t k = 0; k < kLanes && first + k < n_; ++k) {
                const std::size_t i = first + k;
                Path& path = paths_[i];
                if (path.lit) continue;
                path.sun_asked = false;
                path.guide = SmallBodySampling();
                if (points_[i].specular()) continue;
                // To be known before light is asked for, as both ways to find it are weighed against each other.
                if (guided_ && lit_surfaces_count) path.guide = SmallBodySampling(tracer_, at_, path.start);
                Bounce* const bounce = bounce_at(path, met);
                if (sun_ != nullptr) ask_sun(i, u[2][k], u[3][k], bounce);
                if (emitters_) ask_emitters(i, u[2][k], u[0][k], u[1][k], bounce);
            }
        }
        hear_sun();
        hear_lights();
        hear_bodies();
    }

    /// Density per solid angle with which `scatter` finds a direction that the BSDF alone finds with `bsdf_pdf`.
    [[nodiscard]] double scatter_pdf(const Path& path, const Vec3& direction, double bsdf_pdf) const {
        const double share = path.guide.share();
        if (share == 0) return bsdf_pdf;
        return (1 - share) * bsdf_pdf + share * path.guide.pdf(tracer_, at_, path.start, direction);
    }

    /// A point of the Sun's disc.
    void ask_sun(std::size_t i, double u, double v, Bounce* bounce) {
        const Vec3 to_sun = sun_has_extent_ ? sun_->sample(u, v) : sun_->centre();
        // Rays find the disc as well, unless it is a point, or nothing beyond the first surface counts.
        const bool alone = !sun_has_extent_ || settings_.direct || (narrow_sun_ && points_[i].has_no_lobe());
        paths_[i].sun_asked = alone;
        const PathPoint::Response r = points_[i].respond(to_sun);
        if (r.f_cos == Rgb{}) return;
        const double weight = alone ? 1 : power_heuristic(sun_->pdf(to_sun), scatter_pdf(paths_[i], to_sun, r.pdf));
        const double arriving = weight * static_cast<double>(sun_->irradiance()) / dot(to_sun, sun_->centre());
        Question& q = asked_of_sun_[to_sun_++];
        q.path = i;
        q.towards = to_sun;
        q.range_m = kInfinity;
        q.to = paths_[i].to;
        q.light = paths_[i].throughput * (r.f_cos * static_cast<float>(arriving));
        if (bounce == nullptr) return;
        const auto light = static_cast<float>(arriving);
        receive(*bounce, Bounce::sun, to_sun, {light, light, light}, q);
    }
    /// Of a bounce all that comes of it is what falls in.
    static void receive(Bounce& bounce, std::size_t kind, const Vec3& from, const Rgb& light, Question& q) {
        bounce.incident[kind].from = from;
        q.to = &bounce.incident[kind].light;
        q.light = light;
    }

    /// A point of one of the other emitters.
    void ask_emitters(std::size_t i, double choice, double u, double v, Bounce* bounce) {
        const Path& path = paths_[i];
        const std::optional<LightSample> light = lights_.sample(at_, path.start, group_, choice, u, v);
        if (!light) return;
        const PathPoint::Response r = points_[i].respond(light->direction);
        if (r.f_cos == Rgb{}) return;
        const double pdf = scatter_pdf(path, light->direction, r.pdf);
        Question& q = light->body < 0 ? asked_of_lights_[to_lights_++] : asked_of_bodies_[to_bodies_++];
        q.path = i;
        q.towards = light->direction;
        q.to = path.to;
        q.light = path.throughput * r.f_cos;
        if (bounce != nullptr) receive(*bounce, Bounce::emitter, light->direction, {1, 1, 1}, q);
        q.scatter_pdf = pdf;
        q.body = light->body;
        q.face = light->face;
        q.range_m = light->body < 0 ? light->range_m : kInfinity;
        if (light->body >= 0) return;
        q.light = q.light * light->radiance_per_pdf * static_cast<float>(power_heuristic(light->pdf, pdf));
    }

    /// A packet of questions and where they start.
    struct Asking {
        Lanes<Hit> from;
        Lanes<Vec3> towards;
        Lanes<double> range_m{};
        std::uint32_t wanted = 0;
    };
    void put_together(const Room<Question>& questions, std::size_t first, std::size_t end, Asking& a) {
        const std::size_t n = std::min(kLanes, end - first);
        a.wanted = lanes_below(n);
        for (std::size_t k = 0; k < n; ++k) {
            const Question& q = questions[first + k];
            a.from[k] = hits_[q.path];
            a.towards[k] = q.towards;
            a.range_m[k] = q.range_m;
        }
        rays_traced_ += n;
    }

    void hear_sun() {
        Asking a;
        for (std::size_t first = 0; first < to_sun_; first += kLanes) {
            put_together(asked_of_sun_, first, to_sun_, a);
            const std::uint32_t dark = tracer_.occluded(at_, a.from, a.towards, a.wanted);
            hear(asked_of_sun_, first, a.wanted & ~dark);
        }
    }
    void hear_lights() {
        Asking a;
        for (std::size_t first = 0; first < to_lights_; first += kLanes) {
            put_together(asked_of_lights_, first, to_lights_, a);
            const std::uint32_t dark = tracer_.occluded(at_, a.from, a.towards, a.range_m, a.wanted);
            hear(asked_of_lights_, first, a.wanted & ~dark);
        }
    }
    void hear(const Room<Question>& questions, std::size_t first, std::uint32_t lit) {
        for (std::size_t k = 0; k < kLanes; ++k)
            if (is_set(lit, k)) *questions[first + k].to += questions[first + k].light;
    }
    void hear_bodies() {
        Asking a;
        for (std::size_t first = 0; first < to_bodies_; first += kLanes) {
            put_together(asked_of_bodies_, first, to_bodies_, a);
            Lanes<Hit> found;
            tracer_.intersect(at_, a.from, a.towards, a.wanted, found);
            for (std::size_t k = 0; first + k < to_bodies_ && k < kLanes; ++k) {
                const Question& q = asked_of_bodies_[first + k];
                if (found[k].body != q.body || found[k].face != q.face) continue;
                const Path& path = paths_[q.path];
                const double pdf = lights_.pdf(at_, path.start, group_, q.towards, found[k]);
                if (!(pdf > 0)) continue;  // met where the ray starts
                const double weight = power_heuristic(pdf, q.scatter_pdf);
                *q.to += q.light * emission(path, q.towards, found[k]) * static_cast<float>(weight / pdf);
            }
        }
    }

    [[nodiscard]] Rgb emission(const Path& path, const Vec3& direction, const Hit& hit) const {
        const Material& m = scene_.materials[static_cast<std::size_t>(hit.material)];
        if (m.emission_texture < 0) return m.emission;
        const double width_m = settings_.pixel_angle_rad * (path.length_m + hit.range_m);
        return surface_at(tracer_, at_, hit, direction, width_m).emission;
    }

    /// Chooses where the paths go on, and ends those that would bring little, or nothing.
    void scatter(int met, bool last) {
        std::size_t kept = 0;
        Points u, roulette;
        for (std::size_t first = 0; first < n_; first += kLanes) {
            bool drawn = false;
            draw(first, direction_group(met), u);
            for (std::size_t k = 0; k < kLanes && first + k < n_; ++k) {
                const std::size_t i = first + k;
                Path& path = paths_[i];
                if (last && sun_alone_ && path.sun_asked) continue;
                float made_up = 1;
                const auto survives = [&](float goes_on) {
                    if (goes_on >= 1) return true;
                    if (!drawn) draw(first, kRouletteGroup + static_cast<std::uint32_t>(met) / 4, roulette);
                    drawn = true;
                    if (roulette[static_cast<std::size_t>(met % 4)][k] >= static_cast<double>(goes_on))
                        return false;
                    made_up = 1 / goes_on;
                    path.throughput = path.throughput / goes_on;
                    return true;
                };
                const bool sets_out = met == 0 && shared_ && !points_[i].specular();
                if (sets_out && !path.lit) {
                    const float goes_on = chance_to_set_out(points_[i].surface(), radiance_[path.ray] == Rgb{});
                    path.shares = starts_.add(at_, hits_[i], points_[i], path, goes_on);
                    if (!survives(goes_on)) continue;
                }
                const BsdfSample s = next_direction(i, {u[0][k], u[1][k], u[2][k], u[3][k]});
                path.throughput = path.throughput * s.weight;
                path.radiance_scale *= s.radiance_scale;
                // Out of many shells of dense glass, one in another, it may outgrow single precision.
                if (path.throughput == Rgb{} || !is_finite(path.throughput)) continue;
                if (!sets_out && !survives(chance(path, met + 1))) continue;
                if (Bounce* const bounce = bounce_at(path, met);
                    bounce != nullptr && !set_out(path, *bounce, s, made_up))
                    continue;
                path.direction_pdf = s.pdf;
                directions_[i] = s.l;
                if (s.transmitted) {
                    hits_[i] = other_side(hits_[i]);
                    if (receivers_) path.start = receiver_at(at_, hits_[i], -points_[i].plane());
                }
                keep(i, kept++);
            }
        }
        n_ = kept;
    }

    /// On from a bounce: what the path finds falls in there.
    [[nodiscard]] static bool set_out(Path& path, Bounce& bounce, const BsdfSample& s, float made_up) {
        if (!(s.pdf > 0)) return false;
        const auto greatest = [](const Rgb& c) { return std::max({c.x, c.y, c.z}); };
        // The roulette has made up for those that it has ended.
        const float before = greatest(path.throughput), per_pdf = made_up / static_cast<float>(s.pdf);
        path.throughput = {per_pdf, per_pdf, per_pdf};
        path.radiance_scale *= per_pdf / before;
        bounce.incident[Bounce::path].from = s.l;
        path.to = &bounce.incident[Bounce::path].light;
        return true;
    }

    [[nodiscard]] BsdfSample next_direction(std::size_t i, const SamplePoint& numbers) const {
        const auto& [u, v, lobe, choice] = numbers;
        const Path& path = paths_[i];
        const double share = path.guide.share();
        if (share == 0) return points_[i].scatter({lobe, u, v});
        BsdfSample s;
        if (choice < share)
            s.l = path.guide.direction(tracer_, at_, path.start, choice / share, u, v);
        else
            s = points_[i].scatter({lobe, u, v});
        const PathPoint::Response r = points_[i].respond(s.l);
        s.pdf = scatter_pdf(path, s.l, r.pdf);
        s.weight = r.f_cos == Rgb{} ? Rgb{} : r.f_cos * static_cast<float>(1 / s.pdf);
        return s;
    }

    /// Probability with which a path that is shared leaves its first surface, before its direction is known.
    [[nodiscard]] float chance_to_set_out(const Surface& surface, bool in_the_dark) const {
        const bool plain = surface.material->kind <= Material::Kind::phong;
        return chance_to_set_out(plain ? surface.diffuse + surface.specular : Rgb{1, 1, 1}, in_the_dark);
    }
    [[nodiscard]] float chance_to_set_out(const Rgb& albedo, bool in_the_dark) const {
        if (finds_alone_) return 1;
        const float brings = std::max({albedo.x, albedo.y, albedo.z});
        return settings_.sets_out * std::min(1.0f, brings / (in_the_dark ? kFaintInTheDark : kFaint));
    }

    /// Probability with which a path goes on behind so many surfaces; it then carries the share of those that end.
    [[nodiscard]] float chance(const Path& path, int surfaces) const {
        // What a wide Sun sends comes by two ways that make up for each other: neither is left to chance.
        const bool nothing_yet = radiance_[path.ray] == Rgb{} && !path.sunlit;
        const bool in_the_dark = nothing_yet || (sun_has_extent_ && !narrow_sun_);
        if (in_the_dark && surfaces < kSurfacesInTheDark) return 1;
        const Rgb& t = path.throughput;
        const float brings = std::max({t.x, t.y, t.z}) / path.radiance_scale;
        return std::min(1.0f, brings / (in_the_dark ? kFaintInTheDark : kFaint));
    }

    void trace() {
        for (std::size_t first = 0; first < n_; first += kLanes) {
            const std::size_t n = std::min(kLanes, n_ - first);
            const std::span<Hit> hits = hits_.from(first, n);
            tracer_.intersect(at_, hits, directions_.from(first, n), lanes_below(n), hits);
            rays_traced_ += n;
        }
    }

    static void add(const Path& path, const Rgb& radiance) { *path.to += path.throughput * radiance; }

    const Tracer& tracer_;
    const Scene& scene_;
    const Lights& lights_;
    const BodyPoses& at_;
    const PathSettings& settings_;
    const PathNumbers numbers_;
    const Lights::Group group_;
    const SunDisc* const sun_;
    const bool sun_has_extent_, narrow_sun_;
    const bool guided_;       ///< some body may look small from another
    const bool emitters_;     ///< beside the Sun
    const bool receivers_;    ///< somebody asks where the points are
    const bool finds_alone_;  ///< the sky and a wide Sun, which is not shared
    bool shared_ = false;     ///< paths give each other of what they find
    const bool sun_alone_;    ///< nothing else shines
    std::span<Rgb> radiance_;
    std::span<float> variance_;  ///< of what is shared
    std::uint64_t rays_traced_ = 0;

    std::size_t n_ = 0;  ///< paths that have not ended
    std::size_t to_sun_ = 0, to_lights_ = 0, to_bodies_ = 0;
    Room<Path> paths_;
    Room<PathPoint> points_;
    Room<Vec3> directions_;  ///< of the rays on their way
    Room<Hit> hits_;         ///< where they start, then where they end
    Room<Question> asked_of_sun_, asked_of_lights_, asked_of_bodies_;
    std::size_t n_bounces_ = 0;
    Room<Bounce> bounces_;
    Starts starts_;
};

}  // namespace

std::uint64_t path_radiance(const RenderScene& render_scene, const BodyPoses& at, const PathSettings& settings,
                            std::span<const Ray> rays, std::span<const Hit> first, const PathNumbers& numbers,
                            std::span<Rgb> radiance) noexcept {
    std::uint64_t traced = 0;
    for (std::size_t k = 0; k < rays.size(); k += kStream) {
        const std::size_t n = std::min(kStream, rays.size() - k);
        Stream stream(render_scene, at, settings,
                      {numbers.seed, numbers.frame, numbers.pixel.subspan(k, n), numbers.sample.subspan(k, n)});
        stream.run(rays.subspan(k, n), first.subspan(k, n), radiance.subspan(k, n));
        traced += stream.rays_traced();
    }
    return traced;
}

Rgb sky_along(const RenderScene& render_scene, const Vec3& direction) noexcept {
    const Rgb& ambient = render_scene.scene().ambient;
    const std::optional<SunDisc>& sun = render_scene.lights().sun();
    if (!sun || sun->is_point() || sun->pdf(direction) == 0) return ambient;
    return ambient + Rgb{sun->radiance(), sun->radiance(), sun->radiance()};
}

bool sun_alone_lights_first_surfaces(const RenderScene& render_scene) noexcept {
    const Lights& lights = render_scene.lights();
    if (lights.any(Lights::Group::all) || lights.any_with_extent() || !lights.sun()) return false;
    return lights.sun()->is_point() || render_scene.scene().sun->angular_diameter_rad < kNarrowSun_rad;
}

std::uint64_t shared_path_radiance(const RenderScene& render_scene, const BodyPoses& at,
                                   const PathSettings& settings, std::span<const FirstSurface> first,
                                   std::uint64_t seed, std::uint32_t frame, std::span<Rgb> radiance,
                                   std::span<float> variance) noexcept {
    if (first.empty()) return 0;
    std::array<std::uint32_t, kSharing> pixel, sample;
    for (std::size_t i = 0; i < first.size(); ++i) pixel[i] = first[i].pixel, sample[i] = first[i].sample;
    Stream stream(render_scene, at, settings,
                  {seed, frame, std::span(pixel).first(first.size()), std::span(sample).first(first.size())});
    stream.run_shared(first, radiance, variance);
    return stream.rays_traced();
}

}  // namespace narpa
