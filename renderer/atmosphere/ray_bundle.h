/// renderer/atmosphere/ray_bundle.h - air along the rays of a few pixels, integrated along fewer of them.
///
/// Along rays from one point that reach space, what the air does is a smooth function of direction; along rays that
/// end near the ground, of direction and of the height of the end. It is integrated at the corners of the bundle
/// and in its middle, and interpolated linearly where the middle agrees; elsewhere (at the horizon, at the limb)
/// the bundle is divided, and at last each ray integrated.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "renderer/atmosphere/scattered_light.h"

namespace narpa {

/// What air does to light along a ray.
struct AirLight {
    Rgb transmittance{1, 1, 1};  ///< of the light that comes from its end
    Rgb in_scattering{};         ///< in the bands, for an irradiance of 1
};

/// From `origin` as far as range_m, which may be infinite. `to_sun` null: no sunlight. Positions are metres from
/// the planet's centre, directions unit.
[[nodiscard]] AirLight air_along(const ScatteredLight& light, const Vec3& origin, const Vec3& direction,
                                 double range_m, const Vec3* to_sun) noexcept;

class RayBundle {
public:
    static constexpr std::size_t kMost = 128;  ///< rays
    /// Largest relative difference in the middle. Errors of pixels are smaller: the difference is largest there.
    static constexpr float kTolerance = 2e-3f;

    struct Ray {
        Vec3 direction{};
        double range_m = 0;
    };

    /// `light` and `to_sun` (may be null) outlive it. Tolerance 0: each ray is integrated.
    RayBundle(const ScatteredLight& light, const Vec3& origin, const Vec3* to_sun,
              float tolerance = kTolerance) noexcept;

    /// Of up to kMost rays, `out` one for each. Allocates nothing.
    void trace(std::span<const Ray> rays, std::span<AirLight> out) noexcept;

    /// How often the air was integrated.
    [[nodiscard]] std::size_t integrals() const noexcept { return integrals_; }

private:
    using Index = std::uint8_t;
    enum class End : std::uint8_t { space, ground, elsewhere };
    /// Tangents of the angles off the bundle's axis; of ends near the ground the aerosol's relative density, of
    /// which what the air does is nearly a linear function.
    using Place = std::array<double, 3>;
    struct Box {
        Place low{}, high{};
    };
    struct Grid;

    void aim() noexcept;
    void place(Index i) noexcept;
    void trace(std::span<Index> set, End end, int divisions) noexcept;
    [[nodiscard]] bool interpolate(std::span<const Index> set, End end, const Box& box) noexcept;
    [[nodiscard]] Box bounds(std::span<const Index> set) const noexcept;
    [[nodiscard]] std::optional<AirLight> at(const Place& p, End end) noexcept;
    [[nodiscard]] AirLight integrate(const Vec3& direction, double range_m) noexcept;

    const ScatteredLight& light_;
    const Vec3 origin_;
    const Vec3* const to_sun_;
    const float tolerance_;
    std::size_t integrals_ = 0;
    std::span<const Ray> rays_;
    std::span<AirLight> out_;
    Vec3 axis_{}, across_{}, upright_{};
    std::array<Place, kMost> place_;
    std::array<End, kMost> end_;
};

}  // namespace narpa
