#include "renderer/ephemeris/observed_courses.h"

#include <cmath>
#include <utility>

#include "renderer/scene/mounting.h"

namespace narpa {
namespace {

/// Step of central differences: errors of 1e-7 m/s by rounding, and of 1e-5 m/s by the third derivative in a low
/// orbit.
constexpr double kStep_s = 0.05;

class OrbitCourse final : public Course {
public:
    OrbitCourse(const OrbitalElements& orbit, const Motion& turning) : orbit_(orbit), turning_(turning) {}
    [[nodiscard]] Motion at(double t_s) const noexcept override {
        Motion m = extrapolate(turning_, t_s);
        const OrbitalState state = state_of(orbit_, t_s);
        m.T_world_body.t = state.position_m;
        m.velocity_m_s = state.velocity_m_s;
        return m;
    }

private:
    OrbitalElements orbit_;
    Motion turning_;
};

class ApparentCourse final : public Course {
public:
    ApparentCourse(const Observing& observing, Body body) : observing_(observing), body_(std::move(body)) {}
    [[nodiscard]] Motion at(double t_s) const noexcept override {
        Motion m = motion_at(body_, t_s);
        m.T_world_body.t = place_at(t_s);
        m.velocity_m_s = (place_at(t_s + kStep_s) - place_at(t_s - kStep_s)) / (2 * kStep_s);
        return m;
    }

private:
    [[nodiscard]] Vec3 place_at(double t_s) const noexcept {
        const GroundObserver observer = observing_.at_start.after(t_s);
        const Motion m = motion_at(body_, t_s);
        const Vec3& at = m.T_world_body.t;
        return observer.position_m() + norm(at - observer.position_m()) *
                                           observer.apparent_direction(at, m.velocity_m_s, observing_.refracted);
    }

    Observing observing_;
    Body body_;
};

/// `Direction`: functor that returns the direction from an observer at a time, unit, world.
template <class Direction>
class CameraCourse final : public Course {
public:
    CameraCourse(const Observing& observing, Direction direction)
        : at_start_(observing.at_start), direction_(std::move(direction)) {}
    [[nodiscard]] Motion at(double t_s) const noexcept override {
        const Rigid3 before = pose_at(t_s - kStep_s), after = pose_at(t_s + kStep_s);
        return {pose_at(t_s), (after.t - before.t) / (2 * kStep_s),
                rotation_vector(conjugate(before.q) * after.q) / (2 * kStep_s)};
    }

private:
    [[nodiscard]] Rigid3 pose_at(double t_s) const noexcept {
        const GroundObserver observer = at_start_.after(t_s);
        const Vec3 forward = direction_(observer, t_s), right = cross(forward, observer.zenith());
        const Vec3 x = norm(right) > 1e-6 ? normalized(right) : observer.east();
        return {quat_from_columns(x, cross(forward, x), forward), observer.position_m()};
    }

    GroundObserver at_start_;
    Direction direction_;
};

template <class Direction>
std::shared_ptr<const Course> camera_course(const Observing& observing, Direction direction) {
    return std::make_shared<CameraCourse<Direction>>(observing, std::move(direction));
}

}  // namespace

std::shared_ptr<const Course> orbit_course(const OrbitalElements& orbit, const Motion& turning) {
    return std::make_shared<OrbitCourse>(orbit, turning);
}

std::shared_ptr<const Course> apparent_course(const Observing& observing, Body body) {
    return std::make_shared<ApparentCourse>(observing, std::move(body));
}

std::shared_ptr<const Course> camera_towards_sun(const Observing& observing) {
    return camera_course(observing, [refracted = observing.refracted](const GroundObserver& observer, double) {
        return observer.apparent_sun(refracted);
    });
}

std::shared_ptr<const Course> camera_towards(const Observing& observing, Body body) {
    return camera_course(observing, [body = std::move(body)](const GroundObserver& observer, double t_s) {
        return normalized(motion_at(body, t_s).T_world_body.t - observer.position_m());
    });
}

std::shared_ptr<const Course> camera_towards(const Observing& observing, double azimuth_rad, double elevation_rad) {
    return camera_course(observing, [azimuth_rad, elevation_rad](const GroundObserver& observer, double) {
        const Vec3 level = std::cos(azimuth_rad) * observer.north() + std::sin(azimuth_rad) * observer.east();
        return std::cos(elevation_rad) * level + std::sin(elevation_rad) * observer.zenith();
    });
}

}  // namespace narpa
