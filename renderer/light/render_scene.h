/// renderer/light/render_scene.h - geometry and light of a scene, prepared for rendering.
///
/// Created once at start; only the poses of the bodies change between frames.
#pragma once

#include <memory>

#include "base/result.h"
#include "renderer/geometry/tracer.h"
#include "renderer/light/background.h"
#include "renderer/light/lights.h"
#include "renderer/light/medium.h"

namespace narpa {

class RenderScene {
public:
    /// `scene` must outlive it. `threads` limits the threads that build; 0 is all.
    /// `background` null: the scene's sky, or its ambient radiance; `medium` null: its atmosphere, or a vacuum.
    /// Errors: those of Tracer::create; a light whose mount is not a body of the scene, or that has no size.
    static Result<RenderScene> create(const Scene& scene, int threads = 0,
                                      std::unique_ptr<const Background> background = nullptr,
                                      std::unique_ptr<const Medium> medium = nullptr);
    template <class... Rest>
    static Result<RenderScene> create(const Scene&& temporary, Rest&&...) = delete;

    [[nodiscard]] const Scene& scene() const noexcept { return tracer_.scene(); }
    [[nodiscard]] const Tracer& tracer() const noexcept { return tracer_; }
    [[nodiscard]] const Lights& lights() const noexcept { return lights_; }
    [[nodiscard]] const Background& background() const noexcept { return *background_; }
    /// Null: a vacuum.
    [[nodiscard]] const Medium* medium() const noexcept { return medium_.get(); }
    /// The medium at the wavelength of LiDARs; null: a vacuum.
    [[nodiscard]] const LidarMedium* lidar_medium() const noexcept { return lidar_medium_.get(); }

private:
    RenderScene(Tracer tracer, std::unique_ptr<const Background> background, std::unique_ptr<const Medium> medium)
        : tracer_(std::move(tracer)),
          lights_(tracer_),
          background_(std::move(background)),
          medium_(std::move(medium)),
          lidar_medium_(medium_ ? medium_->for_lidar() : nullptr) {}

    Tracer tracer_;
    Lights lights_;
    std::unique_ptr<const Background> background_;
    std::unique_ptr<const Medium> medium_;
    std::shared_ptr<const LidarMedium> lidar_medium_;
};

}  // namespace narpa
