/// rehearsal/contact/terrain.h - the ground around a landing site: the true surface of the scene's body, by ray
/// tracing.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "renderer/geometry/tracer.h"

namespace narpa::rehearsal {

struct Scenario;

/// Axes of the site: the target's port, x up.
class Terrain {
public:
    /// Reads the scenario's scene. Errors: of the scene.
    static Result<std::unique_ptr<const Terrain>> create(const Scenario& scenario);

    struct Ground {
        double height_m = 0;  ///< along x
        Vec3 normal{};        ///< unit, upwards; of the triangle
    };
    /// The uppermost ground on the vertical through a point; none: the body does not reach there.
    [[nodiscard]] std::optional<Ground> below(const Vec3& point_m) const;

private:
    explicit Terrain(Scene scene) : scene_(std::move(scene)), at_(0) {}

    Scene scene_;
    std::optional<Tracer> tracer_;
    BodyPoses at_;
    std::uint32_t body_ = 0;
    double reach_m_ = 0;  ///< ray length that spans the whole body vertically
};

/// The ground that feet stand on.
struct Footing {
    double slope_rad = 0;  ///< slope of the plane that best fits the ground under the feet, against the horizontal
    double step_m = 0;     ///< largest height of the ground above that plane, within the circle around the feet
};
/// `feet_m`: three or more. Returns none if there is no ground under one of them.
[[nodiscard]] std::optional<Footing> footing(const Terrain& terrain, std::span<const Vec3> feet_m);

}  // namespace narpa::rehearsal
