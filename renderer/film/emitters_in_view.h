/// renderer/film/emitters_in_view.h - which tiles may show light where rays meet no body: the Sun's disc, lights
/// with extent, a background that is not uniform, a medium.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/camera/camera_model.h"
#include "renderer/film/g_buffer.h"
#include "renderer/light/lights.h"

namespace narpa {

class EmittersInView {
public:
    EmittersInView(const Frame& f, const Lens* lens) : f_(f) {
        everywhere_ = !f.quick && (f.render_scene.lights().any_with_extent() ||
                                   !f.render_scene.background().uniform() || f.render_scene.medium() != nullptr);
        if (f.quick || f.path.direct || !f.sun || f.sun->is_point()) return;
        // Generous bounds of half the disc and of the way from point to point of a lens.
        const double disc_rad = f.tracer.scene().sun->angular_diameter_rad;
        const double lens_rad = lens != nullptr ? lens->aperture_diameter_m / lens->focus_distance_m : 0;
        within_rad_ = disc_rad + lens_rad;
        sun_ = true;
    }
    /// Through a tile that begins here.
    [[nodiscard]] bool any(int x, int y) const {
        if (everywhere_ || !sun_) return everywhere_;
        const DirectionCone tile = f_.model->bounds({x - 0.5, y - 0.5, x + kTile - 0.5, y + kTile - 0.5});
        const Vec3 to_tile = f_.T_world_camera.q * tile.axis, &to_sun = f_.sun->centre();
        return std::atan2(norm(cross(to_tile, to_sun)), dot(to_tile, to_sun)) < within_rad_ + tile.half_angle_rad;
    }

private:
    const Frame& f_;
    bool everywhere_ = false, sun_ = false;
    double within_rad_ = 0;
};

}  // namespace narpa
