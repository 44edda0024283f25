/// tests/support/cameras.h - a small camera for tests of estimators.
#pragma once

#include "renderer/scene/scene.h"

namespace narpa::test {

/// GREY, square, 35 degrees wide, with a detector of 12 bits.
inline Camera square_camera(int size) {
    Camera camera;
    camera.width = camera.height = size;
    camera.fx = camera.fy = 1.6 * size;
    camera.cx = camera.cy = 0.5 * (size - 1);
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
