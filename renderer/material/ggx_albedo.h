/// renderer/material/ggx_albedo.h - albedo of a rough GGX surface for the first bounce.
///
/// With F = 1 the light missing to 1 is scattered several times between the facets; C. Kulla, A. Conty, "Revisiting
/// Physically Based Shading at Imageworks" (SIGGRAPH 2017 course) restore it. Values come from the tables of
/// ggx_table.h, which assume Smith's height-correlated masking. They err upwards, by at most 0.006 (E) and 0.015
/// (with Fresnel's equations, grazing at roughness below 0.3), so that the total reflectance never exceeds 1.
#pragma once

#include "renderer/material/fresnel.h"

namespace narpa {

/// One roughness (0..1) looked up once for the several directions of a sample.
class GgxAlbedo {
public:
    explicit GgxAlbedo(double roughness) noexcept;

    /// Directional albedo E at cosine mu (0..1] for perfectly reflecting facets.
    [[nodiscard]] double at(double mu) const noexcept;
    /// Its cosine-weighted mean over the hemisphere.
    [[nodiscard]] double mean() const noexcept;

    /// The dielectric interface: `ior` 1..3, Fresnel's equations or Schlick's approximation.
    struct Interface {
        double ior = 1.5;
        bool schlick = false;
    };
    /// Directional albedo of the first bounce off a dielectric's facets, and its mean.
    [[nodiscard]] double dielectric(Interface i, double mu) const noexcept;
    [[nodiscard]] double dielectric_mean(Interface i) const noexcept;
    /// Hemispherical mean of the first bounce weighted by Schlick's (1 - cosine)^5.
    [[nodiscard]] double mean_schlick_power() const noexcept;

private:
    double roughness_, alpha_;
};

/// Fresnel's reflectance averaged over a hemisphere, cosine-weighted: Schlick's form by its integral, the exact one
/// by Kulla and Conty's fit (within 0.001).
[[nodiscard]] inline double mean_fresnel(GgxAlbedo::Interface i) noexcept {
    if (i.schlick) return (1 + 20 * normal_reflectance(i.ior)) / 21;
    return (i.ior - 1) / (4.08567 + 1.00071 * i.ior);
}

}  // namespace narpa
