/// renderer/trace/cone_frame.h - axes about a direction, for points of a disc or a cone around it.
#pragma once

#include <cmath>

#include "base/vec3.h"

namespace narpa {

/// Two unit vectors that are at right angles to an axis and to each other.
struct ConeFrame {
    Vec3 axis{}, right{}, up{};

    /// `unit_axis` has length 1. Any frame about it will do, but it must not jump where one axis is singled out.
    explicit ConeFrame(const Vec3& unit_axis) : axis(unit_axis) {
        const Vec3 c = unit_axis;
        const double s = std::copysign(1.0, c.z), a = -1 / (s + c.z), b = c.x * c.y * a;
        right = {1 + s * c.x * c.x * a, s * b, -s * c.x};  // Duff et al., JCGT 6(1), 2017
        up = {b, s + c.y * c.y * a, -c.y};
    }
    /// The unit direction at this angle from the axis, turned by `phi` about it.
    [[nodiscard]] Vec3 direction(double sine, double cosine, double phi) const {
        return sine * std::cos(phi) * right + sine * std::sin(phi) * up + cosine * axis;
    }
};

}  // namespace narpa
