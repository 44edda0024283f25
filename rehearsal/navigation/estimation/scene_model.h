/// rehearsal/navigation/estimation/scene_model.h - the navigation's model of what its sensors see: the scene with
/// the target at its estimated pose.
#pragma once

#include <memory>
#include <vector>

#include "base/result.h"
#include "rehearsal/scenario/scenario.h"
#include "renderer/light/render_scene.h"

namespace narpa::rehearsal {

class SceneModel {
public:
    /// Reads the scenario's scene, or that of its [navigation], applies its `model_error`, and builds the tracer.
    /// Errors: of the scene.
    static Result<std::unique_ptr<SceneModel>> create(const Scenario& scenario);

    [[nodiscard]] const Scene& scene() const noexcept { return scene_; }
    [[nodiscard]] const RenderScene& render_scene() const noexcept { return *render_scene_; }
    [[nodiscard]] const Tracer& tracer() const noexcept { return render_scene_->tracer(); }
    [[nodiscard]] std::size_t target() const noexcept { return target_; }
    [[nodiscard]] std::size_t chaser() const noexcept { return chaser_; }
    /// Indices in the scene of the sensors that the scenario navigates by, in its order.
    [[nodiscard]] const std::vector<std::size_t>& cameras() const noexcept { return cameras_; }
    [[nodiscard]] const std::vector<std::size_t>& lidars() const noexcept { return lidars_; }
    [[nodiscard]] const std::vector<std::size_t>& velocimeters() const noexcept { return velocimeters_; }

    /// Model uncertainty as stated to the navigation.
    [[nodiscard]] const ModelUncertainty& uncertainty() const noexcept { return uncertainty_; }

    /// Poses at t_s: the target's centre of mass at the world's origin, the attractor at the orbit's radius below
    /// it, the chaser at `T_target_chaser` (body axes of both). Other bodies stay as the scene has them at time 0.
    [[nodiscard]] const BodyPoses& place(double t_s, const Quat& q_world_target, const Rigid3& T_target_chaser);

private:
    SceneModel() : at_(0) {}

    Scene scene_;
    ModelUncertainty uncertainty_;
    std::optional<RenderScene> render_scene_;
    Orbit orbit_;
    Vec3 target_centre_of_mass_m_{};
    std::size_t target_ = 0, chaser_ = 0;
    std::optional<std::size_t> attractor_;
    std::vector<std::size_t> cameras_, lidars_, velocimeters_;
    BodyPoses at_;
};

}  // namespace narpa::rehearsal
