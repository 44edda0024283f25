#include "renderer/camera/scene_camera.h"

#include <cmath>

namespace narpa {
namespace {

void set_intrinsics(Camera& camera, const Pinhole& p) {
    camera.fx = p.fx, camera.fy = p.fy, camera.cx = p.cx, camera.cy = p.cy;
}

}  // namespace

Camera scaled(const Camera& camera, double factor_x, double factor_y) {
    constexpr double kRounding = 1e-9;
    Camera c = camera;
    c.width = static_cast<int>(camera.width * factor_x * (1 + kRounding));
    c.height = static_cast<int>(camera.height * factor_y * (1 + kRounding));
    set_intrinsics(c, pinhole_of(camera).with_scale(factor_x, factor_y));
    if (camera.model) c.model = camera.model->scaled(factor_x, factor_y);
    const double factor = std::sqrt(factor_x * factor_y);
    if (c.ghost) c.ghost->radius_px *= factor;
    if (c.point_spread) {
        c.point_spread->sigma_px *= factor, c.point_spread->cutoff_per_px /= factor;
        c.point_spread->samples_per_px /= factor;
    }
    return c;
}

Camera windowed(const Camera& camera, int x, int y, int width, int height) {
    Camera c = camera;
    c.width = width, c.height = height;
    set_intrinsics(c, pinhole_of(camera).with_origin(x, y));
    if (camera.model) c.model = camera.model->windowed(x, y);
    return c;
}

}  // namespace narpa
