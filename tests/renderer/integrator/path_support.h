/// tests/renderer/integrator/path_support.h - the light along a ray, with how well it is known.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "renderer/integrator/path.h"
#include "tests/support/shapes.h"

namespace narpa::test {

/// Direct light only.
inline const PathSettings kDirectLight{.max_depth = 1};

/// Rays with their first hits, from which paths begin.
class PathRays {
public:
    explicit PathRays(std::size_t n) : rays_((n + kLanes - 1) / kLanes), hits_(rays_.size()), starts_(n) {}

    void put(std::size_t i, const Ray& ray, const Hit& first, std::uint32_t pixel) {
        RayBatch& rays = rays_[i / kLanes];
        HitBatch& hits = hits_[i / kLanes];
        rays.n = std::max(rays.n, i % kLanes + 1);
        rays.put(i % kLanes, ray);
        hits.put(i % kLanes, first);
        starts_[i] = {&rays, &hits, nullptr, i % kLanes, pixel, 0};
    }
    /// Radiance of this sample of each. Returns the number of rays traced.
    std::uint64_t trace(const Transport& t, std::uint32_t sample, std::span<Rgb> radiance) {
        for (PathStart& s : starts_) s.sample = sample;
        return path_radiance(t, starts_, radiance);
    }

private:
    std::vector<RayBatch> rays_;
    std::vector<HitBatch> hits_;
    std::vector<PathStart> starts_;
};

/// Radiance along one ray by one sample.
inline Rgb light_along(const RenderScene& render_scene, const BodyPoses& at, const Ray& ray, const Hit& first,
                       const PathSettings& settings, std::uint64_t seed, std::uint32_t pixel,
                       std::uint32_t sample) {
    Rgb radiance;
    PathRays one(1);
    one.put(0, ray, first, pixel);
    one.trace({render_scene, at, settings, seed}, sample, std::span(&radiance, 1));
    return radiance;
}

inline Ray ray_to(const Vec3& origin, const Vec3& target) {
    return {origin, normalized(target - origin)};
}

/// So many standard errors of sixteen lanes' mean an estimate may be off: Student's t with 15 degrees of freedom is
/// beyond in one of 40 000 cases, and the seeds are fixed.
inline constexpr double kSigmas = 6;

struct Estimate {
    Vec3 mean{};
    double error = 0;  ///< standard error of the mean of the first band
};

/// Mean of kLanes independent pixels' means of `samples` each; their scatter tells the error.
inline Estimate light_along(const RenderScene& render_scene, const BodyPoses& at, const Ray& ray,
                            const PathSettings& settings, std::uint32_t samples, std::uint64_t seed = 1) {
    const Hit first = render_scene.tracer().intersect(at, ray, kInfinity);
    PathRays rays(kLanes);
    for (std::size_t i = 0; i < kLanes; ++i) rays.put(i, ray, first, static_cast<std::uint32_t>(i));
    std::array<Vec3, kLanes> sum{};
    for (std::uint32_t s = 0; s < samples; ++s) {
        std::array<Rgb, kLanes> radiance;
        rays.trace({render_scene, at, settings, seed}, s, radiance);
        for (std::size_t i = 0; i < kLanes; ++i) sum[i] += vec_cast<double>(radiance[i]);
    }
    Estimate e;
    for (const Vec3& lane : sum) e.mean += lane / (samples * static_cast<double>(kLanes));
    double deviations = 0;
    for (const Vec3& lane : sum) deviations += std::pow(lane.x / samples - e.mean.x, 2);
    e.error = std::sqrt(deviations / (kLanes * (kLanes - 1.0)));
    return e;
}
inline Estimate light_along(const Scene& scene, const Ray& ray, const PathSettings& settings, std::uint32_t samples,
                            std::uint64_t seed = 1) {
    const auto render_scene = RenderScene::create(scene, 1);
    EXPECT_TRUE(render_scene);
    return light_along(*render_scene, placed(scene), ray, settings, samples, seed);
}

inline Material shining(float albedo, const Rgb& emission) {
    Material m = lambert(albedo);
    m.emission = emission;
    return m;
}
inline Material phong(float diffuse, float specular, float exponent) {
    Material m = lambert(diffuse);
    m.kind = &kinds::phong;
    m.specular = {specular, specular, specular};
    m.exponent = exponent;
    return m;
}
inline Material mirror(float reflectance) {
    Material m = lambert(0);
    m.kind = &kinds::mirror;
    m.specular = {reflectance, reflectance, reflectance};
    return m;
}
inline Material glass(float ior) {
    Material m = lambert(0);
    m.kind = &kinds::dielectric;
    m.ior = ior;
    return m;
}

}  // namespace narpa::test
