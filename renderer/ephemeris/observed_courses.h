/// renderer/ephemeris/observed_courses.h - courses of bodies seen from the ground, and of cameras that follow them.
#pragma once

#include <memory>

#include "renderer/ephemeris/observer.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Along an orbit about the Earth. `turning`: attitude at time 0 and rate.
[[nodiscard]] std::shared_ptr<const Course> orbit_course(const OrbitalElements& orbit, const Motion& turning);

/// `at_start`: the observer at time 0.
struct Observing {
    GroundObserver at_start;
    bool refracted = true;
};
/// The apparent place of a body: in the direction in which it is seen, at its distance.
[[nodiscard]] std::shared_ptr<const Course> apparent_course(const Observing& observing, Body body);

/// A camera at the observer's place, with its x axis horizontal.
[[nodiscard]] std::shared_ptr<const Course> camera_towards_sun(const Observing& observing);
[[nodiscard]] std::shared_ptr<const Course> camera_towards(const Observing& observing, Body body);
/// Azimuth from north, positive towards east.
[[nodiscard]] std::shared_ptr<const Course> camera_towards(const Observing& observing, double azimuth_rad,
                                                           double elevation_rad);

}  // namespace narpa
