/// renderer/trace/guide.h - rays towards bodies that look small: a planet's light on the night side of its moon.
///
/// The BSDF alone would send one ray of a thousand to the Earth in the Moon's sky. So in scenes with a Sun a part
/// of the rays is sent, evenly, into the cones about the bounding spheres of other bodies; the density is that of
/// the mixture, and nothing is biased. Where other bodies fill much of the sky they are likelier to send the light,
/// and fewer rays are guided. So are those from a mesh, which may light itself.
#pragma once

#include "renderer/trace/lights.h"
#include "renderer/trace/tracer.h"

namespace narpa {

class Guide {
public:
    /// Does any body look small from anywhere on another?
    [[nodiscard]] static bool may_help(const Tracer& tracer, const Placement& at) noexcept;
    /// No ray is guided.
    Guide() = default;
    Guide(const Tracer& tracer, const Placement& at, const Receiver& to) noexcept;

    /// Part of the rays to be guided, at most a half.
    [[nodiscard]] double share() const noexcept { return share_; }
    /// Into the cone that the first number chooses. Receiver and placement as before.
    [[nodiscard]] Vec3 direction(const Tracer& tracer, const Placement& at, const Receiver& to, double choice,
                                 double u, double v) const noexcept;
    /// Density per solid angle of the above.
    [[nodiscard]] double pdf(const Tracer& tracer, const Placement& at, const Receiver& to,
                             const Vec3& direction) const noexcept;

private:
    double share_ = 0;
    double sum_ = 0;  ///< of the importance of all cones
};

}  // namespace narpa
