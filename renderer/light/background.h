/// renderer/light/background.h - radiance of escaped rays, from beyond all bodies.
///
/// A new kind is a class in its own files; of a Sky (sky_kind.h), or passed to RenderScene::create. The Sun's disc
/// is separate (sun_disc.h). Units: W m^-2 sr^-1; directions are unit, in world axes, away from the viewer.
#pragma once

#include <optional>

#include "base/vec3.h"

namespace narpa {

struct BackgroundSample {
    Vec3 direction{};
    Rgb radiance{};
    double pdf = 0;  ///< per solid angle
};

/// Thread-safe; allocates nothing when it is evaluated.
class Background {
public:
    virtual ~Background() = default;

    [[nodiscard]] virtual Rgb radiance(const Vec3& direction) const noexcept = 0;
    /// The radiance, if it is the same in all directions: parts of the image that can show nothing else are then
    /// filled without tracing.
    [[nodiscard]] virtual std::optional<Rgb> uniform() const noexcept { return std::nullopt; }

    /// True if `sample` serves next-event estimation, weighted against BSDF sampling by MIS; for backgrounds with
    /// small bright parts. False by default: only escaped rays find the background.
    [[nodiscard]] virtual bool is_sampled() const noexcept { return false; }
    [[nodiscard]] virtual BackgroundSample sample(double /*u*/, double /*v*/) const noexcept { return {}; }
    /// Density per solid angle with which `sample` returns the direction.
    [[nodiscard]] virtual double pdf(const Vec3& /*direction*/) const noexcept { return 0; }

    // Method "direct", which traces no rays from surface to surface:
    /// Radiance of uniform ambient light that all surfaces reflect, without shadows.
    [[nodiscard]] virtual Rgb ambient() const noexcept { return {}; }
    /// Radiance of escaped camera rays.
    [[nodiscard]] virtual Rgb direct_radiance(const Vec3& direction) const noexcept { return radiance(direction); }
};

/// The scene's ambient radiance, the same in all directions. Method "direct" shows black in its place.
class UniformBackground final : public Background {
public:
    explicit UniformBackground(const Rgb& radiance) : radiance_(radiance) {}

    [[nodiscard]] Rgb radiance(const Vec3&) const noexcept override { return radiance_; }
    [[nodiscard]] std::optional<Rgb> uniform() const noexcept override { return radiance_; }
    [[nodiscard]] Rgb ambient() const noexcept override { return radiance_; }
    [[nodiscard]] Rgb direct_radiance(const Vec3&) const noexcept override { return {}; }

private:
    Rgb radiance_;
};

}  // namespace narpa
