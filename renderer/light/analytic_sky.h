/// renderer/light/analytic_sky.h - Hosek and Wilkie's sky (renderer/atmosphere/scattering/hosek_wilkie.h) as a
/// background and a light, over flat ground; and the air that attenuates the Sun in it.
#pragma once

#include <vector>

#include "renderer/atmosphere/scattering/hosek_wilkie.h"
#include "renderer/light/sky_kind.h"
#include "renderer/material/directions.h"

namespace narpa {

/// Hosek and Wilkie's clear sky, seen from flat ground.
class AnalyticSky final : public Sky {
public:
    Vec3 up{0, 0, 1};  ///< world
    double turbidity = 3;
    double ground_albedo = 0.1;

    [[nodiscard]] std::string problem(const Scene& scene) const override;
    /// Nothing without a Sun.
    [[nodiscard]] SkyLight make(const Scene& scene) const override;
};
extern const SkyKind kHosekWilkie;

/// Below the horizon is ground of the sky's albedo, uniformly lit by sky and Sun. Importance-sampled by a table of
/// its radiance over 64 x 128 cells of equal solid angle.
class AnalyticSkyBackground final : public Background {
public:
    AnalyticSkyBackground(const AnalyticSky& sky, const Sun& sun);

    [[nodiscard]] Rgb radiance(const Vec3& direction) const noexcept override;
    [[nodiscard]] bool is_sampled() const noexcept override { return true; }
    [[nodiscard]] BackgroundSample sample(double u, double v) const noexcept override;
    [[nodiscard]] double pdf(const Vec3& direction) const noexcept override;
    /// Irradiance of a horizontal surface by the sky, divided by pi.
    [[nodiscard]] Rgb ambient() const noexcept override { return ambient_; }

private:
    static constexpr std::size_t kRows = 64, kColumns = 128;
    [[nodiscard]] Rgb sky(const Vec3& local) const noexcept;

    Basis frame_;  ///< z up
    HosekWilkieSky model_;
    float irradiance_;
    Vec3 to_sun_;  ///< in the frame
    Rgb ground_{}, ambient_{};
    std::vector<double> row_end_, column_end_;  ///< cumulative distributions of the rows, and within each row
    std::vector<double> density_;               ///< per solid angle, by cell
};

/// Attenuates direct sunlight by air of the sky's turbidity; nothing else is attenuated.
class SunThroughAir final : public Medium {
public:
    SunThroughAir(const AnalyticSky& sky, const Sun& sun);
    [[nodiscard]] MediumSegment along(const BodyPoses&, const Ray& ray, double range_m,
                                      double) const noexcept override {
        return {transmittance_of_ray(ray, range_m), {}};
    }
    [[nodiscard]] Rgb transmittance(const BodyPoses&, const Ray& ray, double range_m) const noexcept override {
        return transmittance_of_ray(ray, range_m);
    }

private:
    [[nodiscard]] Rgb transmittance_of_ray(const Ray& ray, double range_m) const noexcept;
    Vec3 to_sun_;
    double cosine_;  ///< of the disc's edge
    Rgb transmittance_;
};

/// Transmittance of sunlight to the ground through the Earth's air of this turbidity.
[[nodiscard]] Rgb sunlight_transmittance(double turbidity, double sun_elevation_rad);

}  // namespace narpa
