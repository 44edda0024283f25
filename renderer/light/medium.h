/// renderer/light/medium.h - participating media: absorb, emit and scatter light along rays.
///
/// A new kind (an atmosphere, a plume) is a class in its own files, passed to RenderScene::create. A scene without
/// one pays nothing.
#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "base/vec3.h"
#include "renderer/geometry/tracer.h"
#include "renderer/light/lidar_medium.h"

namespace narpa {

/// Effect of a medium along a segment of a ray.
struct MediumSegment {
    Rgb transmittance{1, 1, 1};  ///< part of the radiance from its end that reaches its start
    Rgb in_scattering{};         ///< radiance that arises along it and reaches its start, W m^-2 sr^-1
};

/// Arguments of Medium::along.
struct MediumRay {
    Ray ray;
    double range_m = 0, u = 0;
};

/// Thread-safe; allocates nothing when it is evaluated.
class Medium {
public:
    virtual ~Medium() = default;

    /// Along the ray from its origin (world, metres) to range_m, which is infinite for escaped rays. `u` is a
    /// random number in [0, 1) for media that estimate the integral from one point of the segment; the mean over u
    /// must be the integral.
    [[nodiscard]] virtual MediumSegment along(const BodyPoses& at, const Ray& ray, double range_m,
                                              double u) const noexcept = 0;
    /// False: the integral is exact, and `u` is not used.
    [[nodiscard]] virtual bool uses_random_numbers() const noexcept { return true; }
    /// The same for several rays with nearby origins, such as a tile's; by default one at a time.
    virtual void along_each(const BodyPoses& at, std::span<const MediumRay> rays,
                            std::span<MediumSegment> segments) const noexcept {
        for (std::size_t i = 0; i < rays.size(); ++i)
            segments[i] = along(at, rays[i].ray, rays[i].range_m, rays[i].u);
    }
    /// For shadow rays.
    [[nodiscard]] virtual Rgb transmittance(const BodyPoses& at, const Ray& ray, double range_m) const noexcept = 0;
    /// Method "direct": radiance of ambient light at a surface from the medium's scattering, in addition to
    /// Background::ambient.
    [[nodiscard]] virtual Rgb ambient(const BodyPoses& /*at*/, const Vec3& /*position*/, const Vec3& /*normal*/,
                                      double /*time*/) const noexcept {
        return {};
    }
    /// The same medium at the wavelength of LiDARs. It lives no longer than this one. By default a medium with the
    /// mean band's values that scatters no pulse back.
    [[nodiscard]] virtual std::shared_ptr<const LidarMedium> for_lidar() const;
    /// The body that the medium moves with; -1: it is at rest.
    [[nodiscard]] virtual int body() const noexcept { return -1; }
};

}  // namespace narpa
