/// renderer/light/render_scene.h - what a frame is rendered from: the scene's geometry and its light.
///
/// Made once at start; frames differ in the poses of the bodies alone.
#pragma once

#include "base/result.h"
#include "renderer/geometry/tracer.h"
#include "renderer/light/lights.h"

namespace narpa {

class RenderScene {
public:
    /// `scene` must outlive it. `threads` bounds the threads that build; 0 is all. Errors: of Tracer::create; a
    /// light that rides on a body that is not there or has no size.
    /// `shapes` as in Tracer::create.
    static Result<RenderScene> create(const Scene& scene, int threads = 0,
                                      const std::vector<std::shared_ptr<const Shape>>& shapes = {});

    [[nodiscard]] const Scene& scene() const noexcept { return tracer_.scene(); }
    [[nodiscard]] const Tracer& tracer() const noexcept { return tracer_; }
    [[nodiscard]] const Lights& lights() const noexcept { return lights_; }

private:
    explicit RenderScene(Tracer tracer) : tracer_(std::move(tracer)), lights_(tracer_) {}

    Tracer tracer_;
    Lights lights_;
};

}  // namespace narpa
