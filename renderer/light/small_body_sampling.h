/// renderer/light/small_body_sampling.h - rays towards bodies that look small from a vertex.
///
/// BSDF sampling alone would send one ray of a thousand to the Earth in the Moon's sky. So in scenes with a Sun a
/// part of the rays is sent, uniformly, into the cones about the bounding spheres of other bodies; the density is
/// that of the mixture, so the estimate is unbiased. Where other bodies fill much of the sky, and on meshes, which
/// may light themselves, that part is smaller; first surfaces whose sunlight is separate (Frame::separate_sun) and
/// not zero send none.
#pragma once

#include "renderer/geometry/tracer.h"
#include "renderer/light/lights.h"

namespace narpa {

class SmallBodySampling {
public:
    /// True where some body looks small from somewhere on another.
    [[nodiscard]] static bool may_help(const Tracer& tracer, const BodyPoses& at) noexcept;
    /// The BSDF alone.
    SmallBodySampling() = default;
    SmallBodySampling(const Tracer& tracer, const BodyPoses& at, const Receiver& to) noexcept;

    /// Part of the rays that it chooses, at most a half.
    [[nodiscard]] double share() const noexcept { return share_; }
    /// Into the cone that the first number chooses. `at` and `to` as for the constructor.
    [[nodiscard]] Vec3 direction(const Tracer& tracer, const BodyPoses& at, const Receiver& to, double choice,
                                 double u, double v) const noexcept;
    /// Density per solid angle of the above.
    [[nodiscard]] double pdf(const Tracer& tracer, const BodyPoses& at, const Receiver& to,
                             const Vec3& direction) const noexcept;

private:
    double share_ = 0;
    double sum_ = 0;  ///< of the importance of all cones
};

}  // namespace narpa
