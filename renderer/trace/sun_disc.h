/// renderer/trace/sun_disc.h - the Sun as a disc of even radiance: its centre, or a point of it.
#pragma once

#include <cmath>
#include <numbers>

#include "renderer/scene/scene.h"

namespace narpa {

class SunDisc {
public:
    explicit SunDisc(const Sun& sun)
        : centre_(normalized(sun.direction)),
          sin_half_angle_(std::sin(0.5 * sun.angular_diameter_rad)),
          irradiance_(static_cast<float>(sun.irradiance_w_m2)) {
        // Any frame about the centre will do, but it must not jump where one axis is singled out.
        const Vec3 c = centre_;
        const double s = std::copysign(1.0, c.z), a = -1 / (s + c.z), b = c.x * c.y * a;
        right_ = {1 + s * c.x * c.x * a, s * b, -s * c.x};  // Duff et al., JCGT 6(1), 2017
        up_ = {b, s + c.y * c.y * a, -c.y};
    }

    [[nodiscard]] const Vec3& centre() const { return centre_; }
    /// Irradiance of a surface that faces the centre, W m^-2.
    [[nodiscard]] float irradiance() const { return irradiance_; }

    /// Direction to a point of the disc, even in its projected area, for u, v in [0, 1).
    [[nodiscard]] Vec3 sample(double u, double v) const {
        const double r = sin_half_angle_ * std::sqrt(u), phi = 2 * std::numbers::pi * v;
        return r * std::cos(phi) * right_ + r * std::sin(phi) * up_ + std::sqrt(1 - r * r) * centre_;
    }

private:
    Vec3 centre_, right_{}, up_{};
    double sin_half_angle_;
    float irradiance_;
};

}  // namespace narpa
