#include "renderer/camera/scene_camera.h"

#include <cassert>
#include <cmath>

namespace narpa {
Camera scaled(const Camera& camera, double factor_x, double factor_y) {
    constexpr double kRounding = 1e-9;
    assert(camera.model && factor_x > 0 && factor_y > 0);
    Camera c = camera;
    c.width = static_cast<int>(camera.width * factor_x * (1 + kRounding));
    c.height = static_cast<int>(camera.height * factor_y * (1 + kRounding));
    c.model = camera.model->scaled(factor_x, factor_y);
    c.optics = scaled(camera.optics, std::sqrt(factor_x * factor_y));
    return c;
}

Camera windowed(const Camera& camera, int x, int y, int width, int height) {
    assert(camera.model && width > 0 && height > 0);
    Camera c = camera;
    c.width = width, c.height = height;
    c.model = camera.model->windowed(x, y);
    return c;
}

}  // namespace narpa
