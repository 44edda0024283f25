/// dataset/scene/image_scene.h - the scene that an image shows: one variant of the recipe's scene before one of its
/// backgrounds.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dataset/image/image_draw.h"
#include "renderer/light/render_scene.h"
#include "renderer/scene/scene.h"

namespace narpa::dataset {

/// Indices of a scene's bodies and of its camera.
struct Roles {
    std::size_t camera = 0, target = 0;
    int mount = -1;                       ///< body that carries the camera; -1: the world
    std::vector<std::size_t> attached{};  ///< to the target
    int backdrop = -1;                    ///< behind the target; -1: none
};

/// Where camera and bodies are in an image, world.
struct Placement {
    Rigid3 T_world_camera{};
    std::vector<Rigid3> T_world_body{};
    [[nodiscard]] BodyPoses poses() const;
};

class ImageScene {
public:
    /// Removes what is not in the background, and builds the ray tracer. Errors: those of RenderScene::create; a
    /// backdrop that a scene does not have.
    static Result<std::shared_ptr<ImageScene>> create(Scene scene, Roles roles, const Backdrop& backdrop,
                                                      int threads);
    ImageScene(const ImageScene&) = delete;
    ImageScene& operator=(const ImageScene&) = delete;

    [[nodiscard]] const Scene& scene() const { return scene_; }
    [[nodiscard]] const RenderScene& render_scene() const { return *render_scene_; }
    [[nodiscard]] const Tracer& tracer() const { return render_scene_->tracer(); }
    [[nodiscard]] const Roles& roles() const { return roles_; }
    /// Number of each body in masks and labels: from 1, by its place in the whole scene, whatever the background.
    [[nodiscard]] const std::vector<int>& body_ids() const { return body_ids_; }
    [[nodiscard]] const Camera& camera() const { return scene_.cameras[roles_.camera]; }

    /// The target's origin stays where it is in the scene, and so do bodies without a role; the camera is placed
    /// around it.
    [[nodiscard]] Placement place(const ImageDraw& draw) const;
    /// Multiplies the albedo of the target's materials, each band limited so that it reflects no more light than
    /// it receives. Not while it is being rendered.
    void set_albedo_factor(double factor);

private:
    ImageScene() = default;

    Scene scene_;
    Roles roles_;
    std::vector<int> body_ids_;
    std::vector<Rigid3> T_world_body_;  ///< in the scene at time 0
    std::vector<std::pair<std::size_t, Rgb>>
        albedos_;  ///< index of each of the target's materials, and its own albedo
    std::optional<RenderScene> render_scene_;
};

}  // namespace narpa::dataset
