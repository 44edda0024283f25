/// renderer/material/ggx_albedo.h - how much light a rough GGX surface sends back on the first bounce.
///
/// What is missing to 1 with F = 1 bounced between the facets; C. Kulla, A. Conty, "Revisiting Physically Based
/// Shading at Imageworks" (SIGGRAPH 2017 course) give it back. The tables are integrals over the visible normals,
/// with Smith's height-correlated masking, written by make_ggx_albedo.py. They err upwards, by at most 0.006 (E)
/// and 0.015 (with Fresnel's equations, grazing at roughness below 0.3): so the sum of all that is reflected never
/// exceeds 1.
#pragma once

namespace narpa {

/// One roughness (0..1) looked up once for the several directions of a sample.
class GgxAlbedo {
public:
    explicit GgxAlbedo(double roughness) noexcept;

    /// Directional albedo E at cosine mu (0..1] where every facet reflects all.
    [[nodiscard]] double at(double mu) const noexcept;
    /// Its cosine-weighted mean over the hemisphere.
    [[nodiscard]] double mean() const noexcept;

    /// Fresnel of which interface: `ior` 1..3, exact or by Schlick's approximation.
    struct Interface {
        double ior = 1.5;
        bool schlick = false;
    };
    /// Directional albedo of the first bounce off a dielectric's facets, and its mean.
    [[nodiscard]] double dielectric(Interface i, double mu) const noexcept;
    [[nodiscard]] double dielectric_mean(Interface i) const noexcept;
    /// Mean over the hemisphere of the first bounce's part that Schlick's (1 - cosine)^5 weighs.
    [[nodiscard]] double mean_schlick_power() const noexcept;

private:
    double roughness_, alpha_;
};

/// Fresnel's reflectance averaged over a hemisphere, cosine-weighted: Schlick's form by its integral, the exact one
/// by Kulla and Conty's fit (within 0.001).
[[nodiscard]] double mean_fresnel(GgxAlbedo::Interface i) noexcept;

/// Table layout. A roughness r in 0..1 lies on even steps; a cosine mu on even steps of sqrt(mu (1 + a) / (mu + a))
/// with a = r^2, dense where masking sets in; an index n on even steps of sqrt((n - 1) / (n + 1)), n = 1..3,
/// Schlick after the last.
namespace ggx_table {
inline constexpr int kRoughnessNodes = 32, kMuNodes = 32;
inline constexpr int kCosineRoughnessNodes = 16, kCosineMuNodes = 24, kIndexNodes = 6;
extern const float kAlbedo[kRoughnessNodes * kMuNodes];
extern const float kMeanAlbedo[kRoughnessNodes];
/// Cosine at which Fresnel's reflectance is the first bounce's mean, over (mu + a).
extern const float kCosine[(kIndexNodes + 1) * kCosineRoughnessNodes * kCosineMuNodes];
/// The first bounce's hemispherical mean: over `mean_fresnel` for an index, of (1 - cosine)^5 for Schlick.
extern const float kMeanReflected[(kIndexNodes + 1) * kCosineRoughnessNodes];
}  // namespace ggx_table

}  // namespace narpa
