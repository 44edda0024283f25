#include "bench/embree/reference_loop.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "bench/embree/raw_embree_scene.h"
#include "renderer/integrator/sampler.h"
#include "renderer/material/bsdf.h"

namespace narpa {
namespace {

constexpr float kPiFloat = std::numbers::pi_v<float>, kFarthest = std::numeric_limits<float>::infinity();
constexpr float kLift_m = 2e-5f;  ///< above a surface: some ten roundings of a coordinate of a few metres

/// Numbers in [0, 1), two for each call.
class Counter {
public:
    Counter() = default;
    Counter(const FrameSettings& s, std::uint32_t pixel, std::uint32_t sample)
        : key_(sampler_detail::mix(sampler_detail::mix(s.seed ^ (std::uint64_t{s.frame} << 32)) ^
                                   (std::uint64_t{pixel} << 32 | sample))) {}
    std::array<float, 2> two() {
        const std::uint64_t x = sampler_detail::mix(key_ += 0x9e3779b97f4a7c15u);
        return {static_cast<float>(x >> 40) * 0x1p-24f, static_cast<float>(x & 0xffffffu) * 0x1p-24f};
    }

private:
    std::uint64_t key_ = 0;
};

/// Two unit vectors across n (T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017).
std::array<Vec3f, 2> across(const Vec3f& n) {
    const float s = std::copysign(1.0f, n.z), a = -1 / (s + n.z), b = n.x * n.y * a;
    return {Vec3f{1 + s * n.x * n.x * a, s * b, -s * n.x}, Vec3f{b, s + n.y * n.y * a, -n.y}};
}
/// The unit direction at the angle asin(r) from the axis n and at the azimuth 2 pi v.
Vec3f about(const Vec3f& n, float r, float v) {
    const auto [t, b] = across(n);
    const float angle = 2 * kPiFloat * v;
    return (r * std::cos(angle)) * t + (r * std::sin(angle)) * b + std::sqrt(std::max(0.0f, 1 - r * r)) * n;
}

struct Point {
    Vec3f position, normal, view;  ///< normal and view: unit, on the viewer's side
    const Material* material;
};

Rgb brdf(const Point& p, const Vec3f& l) {
    const Material& m = *p.material;
    Rgb f = (1 / kPiFloat) * m.diffuse;
    if (m.kind == &kinds::phong) {
        const float cosine = 2 * dot(p.normal, l) * dot(p.normal, p.view) - dot(l, p.view);
        if (cosine > 0) f += ((m.exponent + 2) / (2 * kPiFloat) * std::pow(cosine, m.exponent)) * m.specular;
    }
    return f;
}

/// Sixteen paths, each with its light so far.
struct Paths {
    alignas(64) RTCRayHit16 q{};
    alignas(64) RTCRay16 shadow{};
    alignas(64) std::array<int, 16> valid{}, shadow_valid{};
    std::array<std::size_t, 16> pixel{};
    std::array<Counter, 16> random{};
    std::array<Rgb, 16> throughput{}, light{}, incident{};
    std::array<Point, 16> point{};

    void start(int i, const Vec3f& origin, const Vec3f& direction) {
        q.ray.org_x[i] = origin.x, q.ray.org_y[i] = origin.y, q.ray.org_z[i] = origin.z;
        q.ray.dir_x[i] = direction.x, q.ray.dir_y[i] = direction.y, q.ray.dir_z[i] = direction.z;
        q.ray.tnear[i] = 0, q.ray.tfar[i] = kFarthest, q.ray.mask[i] = ~0u;
        q.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    }
};

/// Direct light at a point: what comes from `direction` (unit) if nothing stands in the way before `far_m`.
struct Incident {
    Vec3f direction;
    float far_m;
    Rgb irradiance;  ///< on a surface that faces it, over the density with which it was chosen
};

/// An emissive triangle.
struct LampFace {
    Vec3f corner, side, other_side, normal;  ///< normal: unit
    Rgb radiance_area;                       ///< radiance times area over the chance to be chosen, W sr^-1
    float chosen_below;                      ///< sum of the chances up to this one
};

class Loop {
public:
    Loop(const Scene& s, RawScene raw_scene) : scene(s), raw(std::move(raw_scene)) {
        if (scene.sun) {
            to_sun = vec_cast<float>(normalized(scene.sun->direction));
            sun_radius = static_cast<float>(std::sin(0.5 * scene.sun->angular_diameter_rad));
        }
        find_lamps();
    }
    std::uint64_t render(const Camera& camera, const RawAim& aim, const FrameSettings& s, RadianceImage& out) const;

private:
    void find_lamps();
    std::uint64_t trace(Paths& p, const FrameSettings& s) const;
    [[nodiscard]] Point point_of(const Paths& p, int i) const;
    [[nodiscard]] Incident from_sun(Counter& random) const;
    [[nodiscard]] Incident from_lamps(const Point& p, Counter& random) const;
    template <class Source>
    std::uint64_t trace_shadows(Paths& p, const Source& source) const;
    std::uint64_t light_directly(Paths& p, bool direct) const;

    const Scene& scene;
    const RawScene raw;
    Vec3f to_sun{};
    float sun_radius = 0;  ///< sine of the half angle
    std::vector<LampFace> lamps{};
};

Point Loop::point_of(const Paths& p, int i) const {
    const std::size_t face = p.q.hit.primID[i];
    const Vec3f a = raw.vertices[raw.corners[3 * face]], b = raw.vertices[raw.corners[3 * face + 1]],
                c = raw.vertices[raw.corners[3 * face + 2]];
    const Vec3f view = -normalized(Vec3f{p.q.ray.dir_x[i], p.q.ray.dir_y[i], p.q.ray.dir_z[i]});
    Vec3f n = normalized(cross(b - a, c - a));
    if (dot(n, view) < 0) n = -n;
    const Vec3f on = a + p.q.hit.u[i] * (b - a) + p.q.hit.v[i] * (c - a);
    return {on + kLift_m * n, n, view, &scene.materials[raw.face_material[face]]};
}

/// Each triangle is chosen in proportion to its area times its radiance.
void Loop::find_lamps() {
    double sum = 0;
    for (std::size_t face = 0; face < raw.face_material.size(); ++face) {
        const Rgb& emission = scene.materials[raw.face_material[face]].emission;
        if (mean_band(emission) <= 0) continue;
        const Vec3f a = raw.vertices[raw.corners[3 * face]], side = raw.vertices[raw.corners[3 * face + 1]] - a,
                    other = raw.vertices[raw.corners[3 * face + 2]] - a, across = cross(side, other);
        const float area = 0.5f * norm(across), power = area * mean_band(emission);
        if (power <= 0) continue;
        sum += static_cast<double>(power);
        lamps.push_back({a, side, other, normalized(across), (area / power) * emission, static_cast<float>(sum)});
    }
    const auto total = static_cast<float>(sum);
    for (LampFace& lamp : lamps) lamp.radiance_area = total * lamp.radiance_area, lamp.chosen_below /= total;
}

Incident Loop::from_sun(Counter& random) const {
    const auto irradiance = static_cast<float>(scene.sun->irradiance_w_m2);
    const auto [u, v] = random.two();
    return {about(to_sun, sun_radius * std::sqrt(u), v), kFarthest, {irradiance, irradiance, irradiance}};
}

Incident Loop::from_lamps(const Point& p, Counter& random) const {
    const float choice = random.two()[0];
    const auto chosen = std::upper_bound(lamps.begin(), lamps.end() - 1, choice,
                                         [](float c, const LampFace& lamp) { return c < lamp.chosen_below; });
    const auto [u, v] = random.two();
    const float root = std::sqrt(u);
    const Vec3f d = chosen->corner + (root * (1 - v)) * chosen->side + (root * v) * chosen->other_side - p.position;
    const float range_m = norm(d);
    const Vec3f l = (1 / range_m) * d;
    const float per_area = std::abs(dot(chosen->normal, l)) / (range_m * range_m);  // solid angle; both sides shine
    return {l, range_m * (1 - 1e-4f), per_area * chosen->radiance_area};
}

/// The light of one source on the points of all paths.
template <class Source>
std::uint64_t Loop::trace_shadows(Paths& p, const Source& source) const {
    std::uint64_t rays = 0;
    for (std::size_t i = 0; i < 16; ++i) {
        p.shadow_valid[i] = 0;
        if (p.valid[i] == 0) continue;
        const auto [l, far_m, irradiance] = source(p.point[i], p.random[i]);
        const float cosine = dot(p.point[i].normal, l);
        if (cosine <= 0) continue;
        p.shadow_valid[i] = -1;
        ++rays;
        p.incident[i] = (cosine * irradiance) * brdf(p.point[i], l);
        const Vec3f& o = p.point[i].position;
        p.shadow.org_x[i] = o.x, p.shadow.org_y[i] = o.y, p.shadow.org_z[i] = o.z;
        p.shadow.dir_x[i] = l.x, p.shadow.dir_y[i] = l.y, p.shadow.dir_z[i] = l.z;
        p.shadow.tnear[i] = 0, p.shadow.tfar[i] = far_m, p.shadow.mask[i] = ~0u;
    }
    if (rays == 0) return 0;
    embree::occluded(raw.scene.get(), p.shadow_valid.data(), p.shadow, embree::Run::apart);
    for (std::size_t i = 0; i < 16; ++i)
        if (p.shadow_valid[i] != 0 && p.shadow.tfar[i] >= 0) p.light[i] += p.throughput[i] * p.incident[i];
    return rays;
}

/// With method direct, emissive surfaces are visible but light nothing.
std::uint64_t Loop::light_directly(Paths& p, bool direct) const {
    std::uint64_t rays = 0;
    if (scene.sun) rays += trace_shadows(p, [&](const Point&, Counter& random) { return from_sun(random); });
    if (!direct && !lamps.empty())
        rays += trace_shadows(p, [&](const Point& point, Counter& random) { return from_lamps(point, random); });
    return rays;
}

/// Traces the paths from their camera rays and accumulates their radiance.
std::uint64_t Loop::trace(Paths& p, const FrameSettings& s) const {
    const bool direct = s.method == RenderSettings::Method::direct;
    std::uint64_t rays = 0;
    for (int depth = 0;; ++depth) {
        embree::intersect(raw.scene.get(), p.valid.data(), p.q,
                          depth == 0 ? embree::Run::together : embree::Run::apart);
        bool any = false;
        for (int k = 0; k < 16; ++k) {
            const auto i = static_cast<std::size_t>(k);
            if (p.valid[i] == 0) continue;
            ++rays;
            if (p.q.hit.geomID[k] == RTC_INVALID_GEOMETRY_ID) {
                if (!direct) p.light[i] += p.throughput[i] * scene.ambient;
                p.valid[i] = 0;
                continue;
            }
            p.point[i] = point_of(p, k);
            const Material& m = *p.point[i].material;
            if (depth == 0) p.light[i] += p.throughput[i] * m.emission;  // later next-event estimation finds it
            if (direct) p.light[i] += scene.ambient * (m.diffuse + m.specular);
            any = true;
        }
        if (!any || (!direct && depth == s.max_depth)) return rays;
        rays += light_directly(p, direct);
        if (direct) return rays;
        for (int k = 0; k < 16; ++k) {
            const auto i = static_cast<std::size_t>(k);
            if (p.valid[i] == 0) continue;
            const auto [u, v] = p.random[i].two();
            const Vec3f l = about(p.point[i].normal, std::sqrt(u), v);
            p.throughput[i] = p.throughput[i] * (kPiFloat * brdf(p.point[i], l));
            p.start(k, p.point[i].position, l);
        }
    }
}

std::uint64_t Loop::render(const Camera& camera, const RawAim& aim, const FrameSettings& s,
                           RadianceImage& out) const {
    const int strata = static_cast<int>(std::sqrt(static_cast<double>(s.spp)) + 1e-9);  // a side
    std::atomic<std::uint64_t> rays{0};
    std::fill(out.pixels.begin(), out.pixels.end(), Rgb{});
    over_raw_tiles(camera, [&](const RawTile& tile) {
        Paths p;
        std::size_t n = 0;
        std::uint64_t here = 0;
        const auto flush = [&] {
            for (std::size_t i = 0; i < 16; ++i) p.valid[i] = i < n ? -1 : 0;
            here += trace(p, s);
            for (std::size_t i = 0; i < n; ++i)
                out.pixels[p.pixel[i]] += (1 / static_cast<float>(s.spp)) * p.light[i];
            n = 0;
        };
        const auto add = [&](int x, int y, int sample) {
            const auto number = static_cast<std::uint32_t>(y * camera.width + x);
            p.pixel[n] = number;
            p.random[n] = Counter(s, number, static_cast<std::uint32_t>(sample));
            auto [u, v] = p.random[n].two();
            if (sample < strata * strata) {  // the samples beyond the last square lie anywhere
                u = (static_cast<float>(sample % strata) + u) / static_cast<float>(strata);
                v = (static_cast<float>(sample / strata) + v) / static_cast<float>(strata);
            }
            const Vec3f d = aim.ahead + (static_cast<float>(x) + u - 0.5f) * aim.across +
                            (static_cast<float>(y) + v - 0.5f) * aim.down;
            p.throughput[n] = {1, 1, 1};
            p.light[n] = {};
            p.start(static_cast<int>(n), aim.origin, d);
            if (++n == 16) flush();
        };
        for (int y0 = tile.rows().begin(); y0 < tile.rows().end(); y0 += 4)
            for (int x0 = tile.cols().begin(); x0 < tile.cols().end(); x0 += 4)
                for (int y = y0; y < std::min(y0 + 4, tile.rows().end()); ++y)
                    for (int x = x0; x < std::min(x0 + 4, tile.cols().end()); ++x)
                        for (int sample = 0; sample < s.spp; ++sample) add(x, y, sample);
        if (n > 0) flush();
        rays += here;
    });
    return rays;
}

}  // namespace

Result<ReferenceLoop> reference_loop(const Scene& scene, const BodyPoses& at) {
    for (const Material& m : scene.materials)
        if (!is_lambert_or_phong(m) || is_textured(m))
            return Error{"material \"" + m.name + "\", expected Lambert or Phong without textures", scene.file};
    for (const Mesh& m : scene.meshes)
        if (!m.normals.empty())
            return Error{"mesh \"" + m.name + "\" has normals, expected flat faces", scene.file};
    if (!scene.lights.empty()) return Error{"the scene has a [[light]], expected the Sun alone", scene.file};
    auto raw = RawScene::build(scene, at);
    if (!raw) return raw.error();
    return ReferenceLoop(
        [loop = std::make_shared<Loop>(scene, *std::move(raw))](const Camera& camera, const Rigid3& T,
                                                                const FrameSettings& settings, RadianceImage& out) {
            return loop->render(camera, RawAim(camera, T), settings, out);
        });
}

}  // namespace narpa
