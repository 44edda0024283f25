/// renderer/light/sun_disc.h - the Sun as a disc of uniform radiance.
#pragma once

#include <cmath>
#include <numbers>

#include "renderer/material/directions.h"
#include "renderer/scene/scene.h"

namespace narpa {

class SunDisc {
public:
    explicit SunDisc(const Sun& sun)
        : frame_(normalized(sun.direction)),
          sin_half_angle_(std::sin(0.5 * sun.angular_diameter_rad)),
          irradiance_(static_cast<float>(sun.irradiance_w_m2)) {}

    [[nodiscard]] const Vec3& centre() const { return frame_.z; }
    /// Irradiance of a surface that faces the centre, W m^-2.
    [[nodiscard]] float irradiance() const { return irradiance_; }

    /// Direction to a point of the disc, uniform in projected area, for u, v in [0, 1).
    [[nodiscard]] Vec3 sample(double u, double v) const {
        const double r = sin_half_angle_ * std::sqrt(u);
        return frame_.to_world(direction_at(r, std::sqrt(1 - r * r), v));
    }

    /// True for a point source, which no ray hits.
    [[nodiscard]] bool is_point() const { return sin_half_angle_ < 1e-12; }
    /// Density of `sample` per solid angle in a unit direction, 0 outside the disc. Not for a point source.
    [[nodiscard]] double pdf(const Vec3& direction) const {
        const double cosine = dot(direction, frame_.z);
        const Vec3 across = cross(direction, frame_.z);  // as long as the sine, without cancellation
        if (cosine <= 0 || !(dot(across, across) < sin_half_angle_ * sin_half_angle_)) return 0;
        return cosine / projected_solid_angle();
    }
    /// Radiance of the disc, W m^-2 sr^-1. Not for a point source.
    [[nodiscard]] float radiance() const {
        return static_cast<float>(static_cast<double>(irradiance_) / projected_solid_angle());
    }

private:
    /// On the plane that faces the disc.
    [[nodiscard]] double projected_solid_angle() const {
        return std::numbers::pi * sin_half_angle_ * sin_half_angle_;
    }

    Basis frame_;
    double sin_half_angle_;
    float irradiance_;
};

}  // namespace narpa
