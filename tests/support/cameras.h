/// tests/support/cameras.h - cameras made by hand.
#pragma once

#include <memory>
#include <vector>

#include "renderer/projection/brown_conrady.h"
#include "renderer/projection/kannala_brandt.h"
#include "renderer/scene/scene.h"

namespace narpa::test {

/// fx, fy, cx, cy, whatever else its projection has.
inline Pinhole pinhole_of(const Camera& c) {
    return c.model->parameters().pinhole;
}
inline void set_pinhole(Camera& c, double fx, double fy, double cx, double cy) {
    c.model = std::make_shared<const Pinhole>(fx, fy, cx, cy);
}
/// Of a pinhole.
inline void set_principal_point(Camera& c, double cx, double cy) {
    const Pinhole p = pinhole_of(c);
    set_pinhole(c, p.fx, p.fy, cx, cy);
}
/// Coefficients in OpenCV's order.
inline std::shared_ptr<const CameraModel> brown_conrady(const Pinhole& pinhole, std::vector<double> coefficients) {
    return make_projection({&kBrownConrady, pinhole, std::move(coefficients)});
}
inline std::shared_ptr<const CameraModel> kannala_brandt(const Pinhole& pinhole, std::vector<double> coefficients) {
    return make_projection({&kKannalaBrandt, pinhole, std::move(coefficients)});
}

/// GREY, square, 35 degrees wide, with a detector of 12 bits.
inline Camera square_camera(int size) {
    Camera camera;
    camera.width = camera.height = size;
    set_pinhole(camera, 1.6 * size, 1.6 * size, 0.5 * (size - 1), 0.5 * (size - 1));
    camera.format = PixelFormat::grey;
    camera.detector = Detector{.exposure_s = 3e-5,
                               .pixel_pitch_m = 5e-6,
                               .f_number = 4,
                               .quantum_efficiency = 0.5,
                               .full_well_e = 20000,
                               .read_noise_e = 12,
                               .shot_noise = true,
                               .black_level_dn = 32,
                               .bits = 12};
    return camera;
}

}  // namespace narpa::test
