/// renderer/light/small_body_sampling.h - sampling of rays towards bodies of small angular size.
///
/// BSDF sampling alone would send one ray in a thousand to the Earth in the Moon's sky. So in scenes with a Sun a
/// fraction of the rays is sampled uniformly in the cones around the bounding spheres of other bodies; the density
/// is that of the mixture, so the estimate is unbiased. If other bodies fill much of the sky, and on meshes, which
/// may light themselves, the fraction is smaller; first surfaces whose sunlight is separate (SunPathIntegrator)
/// and not zero use none.
#pragma once

#include "renderer/geometry/tracer.h"
#include "renderer/light/lights.h"

namespace narpa {

class SmallBodySampling {
public:
    /// True if some body has a small angular size from somewhere on another.
    [[nodiscard]] static bool may_help(const Tracer& tracer, const BodyPoses& at) noexcept;
    /// BSDF sampling only.
    SmallBodySampling() = default;
    SmallBodySampling(const Tracer& tracer, const BodyPoses& at, const Receiver& to) noexcept;

    /// Fraction of the rays that it samples, at most a half.
    [[nodiscard]] double share() const noexcept { return share_; }
    /// Samples a direction in the cone that `choice` selects. `at` and `to` as for the constructor.
    [[nodiscard]] Vec3 direction(const Tracer& tracer, const BodyPoses& at, const Receiver& to, double choice,
                                 double u, double v) const noexcept;
    /// Density per solid angle of `direction`.
    [[nodiscard]] double pdf(const Tracer& tracer, const BodyPoses& at, const Receiver& to,
                             const Vec3& direction) const noexcept;

private:
    double share_ = 0;
    double sum_ = 0;  ///< of the importance of all cones
};

}  // namespace narpa
