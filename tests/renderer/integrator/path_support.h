/// tests/renderer/integrator/path_support.h - the light along a ray, with how well it is known.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "renderer/integrator/path.h"
#include "tests/support/shapes.h"

namespace narpa::test {

/// Direct light only.
inline const PathSettings kDirectLight{.max_depth = 1};

/// This sample for every lane.
inline Lanes<std::uint32_t> the_same(std::uint32_t sample) {
    Lanes<std::uint32_t> all;
    all.fill(sample);
    return all;
}
/// 0, 1, 2 ...: a pixel of its own for each lane.
inline const Lanes<std::uint32_t> kOwnPixels = [] {
    Lanes<std::uint32_t> all;
    for (std::uint32_t i = 0; i < kLanes; ++i) all[i] = i;
    return all;
}();

/// Radiance along one ray by one sample.
inline Rgb light_along(const RenderScene& render_scene, const BodyPoses& at, const Ray& ray, const Hit& first,
                       const PathSettings& settings, std::uint64_t seed, std::uint32_t pixel,
                       std::uint32_t sample) {
    Rgb radiance;
    path_radiance(render_scene, at, settings, std::span(&ray, 1), std::span(&first, 1),
                  {seed, 0, std::span(&pixel, 1), std::span(&sample, 1)}, std::span(&radiance, 1));
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
    std::array<Ray, kLanes> rays;
    rays.fill(ray);
    std::array<Hit, kLanes> first;
    first.fill(render_scene.tracer().intersect(at, ray, kInfinity));
    std::array<Vec3, kLanes> sum{};
    for (std::uint32_t s = 0; s < samples; ++s) {
        std::array<Rgb, kLanes> radiance;
        const Lanes<std::uint32_t> sample = the_same(s);
        path_radiance(render_scene, at, settings, rays, first, {seed, 0, kOwnPixels, sample}, radiance);
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
