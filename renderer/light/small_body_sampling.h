/// renderer/light/small_body_sampling.h - rays towards bodies that look small: a planet's light on the night side of its moon.
///
/// The BSDF alone would send one ray of a thousand to the Earth in the Moon's sky. So in scenes with a Sun a part
/// of the rays is sent, evenly, into the cones about the bounding spheres of other bodies; the density is that of
/// the mixture, and nothing is biased. Where other bodies fill much of the sky they are likelier to send the light,
/// and fewer rays are guided. So are those from a mesh, which may light itself.
#pragma once

#include "renderer/light/lights.h"
#include "renderer/geometry/tracer.h"

namespace narpa {

class SmallBodySampling {
public:
    /// Does any body look small from anywhere on another?
    [[nodiscard]] static bool may_help(const Tracer& tracer, const BodyPoses& at) noexcept;
    /// No ray is guided.
    SmallBodySampling() = default;
    SmallBodySampling(const Tracer& tracer, const BodyPoses& at, const Receiver& to) noexcept;

    /// Part of the rays to be guided, at most a half.
    [[nodiscard]] double share() const noexcept { return share_; }
    /// Into the cone that the first number chooses. Receiver and placement as before.
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
