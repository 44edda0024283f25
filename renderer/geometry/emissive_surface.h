/// renderer/geometry/emissive_surface.h - the light that a shape sends out, as next-event estimation samples it.
#pragma once

#include <cstdint>

#include "renderer/geometry/ray_batch.h"

namespace narpa {

/// A body as a receiver of its light sees it. From the receiver to the body's origin it is `apart - offset`, metres
/// in world axes; the two are never added, so that a common offset of the whole scene cancels.
struct EmitterView {
    Quat q_world_body{};
    Vec3 apart{}, offset{};
    bool own = false;  ///< the receiver is a point of the body's own surface

    /// From the receiver to a point of the body's frame, world axes.
    [[nodiscard]] Vec3 way_to(const Vec3& point_body) const { return apart + (q_world_body * point_body - offset); }
    [[nodiscard]] Vec3 to_body(const Vec3& v) const { return conjugate(q_world_body) * v; }
};

/// In the body's frame. It shines from both its sides.
class EmissiveSurface {
public:
    virtual ~EmissiveSurface() = default;
    EmissiveSurface() = default;
    EmissiveSurface(const EmissiveSurface&) = delete;
    EmissiveSurface& operator=(const EmissiveSurface&) = delete;

    struct Properties {
        Vec3 centre_m{};      ///< of a sphere that holds what shines
        double radius_m = 0;  ///< of it
        double power = 0;     ///< mean band of radiance times area, W/sr
    };
    [[nodiscard]] const Properties& properties() const noexcept { return properties_; }

    /// False where sampling it is of no use: the light cannot arrive, or every ray finds it.
    [[nodiscard]] virtual bool is_worth_sampling(const EmitterView&) const noexcept { return true; }
    struct Sample {
        Vec3 direction{};        ///< world, unit, from the receiver
        std::uint32_t face = 0;  ///< light counts only from this one
    };
    [[nodiscard]] virtual Sample sample(const EmitterView& view, double choice, double u,
                                        double v) const noexcept = 0;
    /// Density per solid angle with which `sample` finds the hit of a ray from the receiver.
    [[nodiscard]] virtual double pdf(const EmitterView& view, const Vec3& direction,
                                     const Hit& met) const noexcept = 0;

protected:
    Properties properties_;
};

}  // namespace narpa
