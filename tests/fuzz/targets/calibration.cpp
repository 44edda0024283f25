// A camera's or a LiDAR's calibration in YAML.
#include "renderer/assets/calibration_file.h"
#include "renderer/assets/lidar_calibration.h"
#include "tests/fuzz/fuzz.h"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace narpa;
    static const fuzz::InputFolder folder;
    const std::string file = folder.write("c.yaml", fuzz::text_of(data, size));
    if (const auto beams = read_lidar_calibration(file, 2)) {
        for (const LidarBeam& beam : *beams) fuzz::require(std::abs(beam.elevation_rad) < 1.7, "an elevation");
        return fuzz::count(true), 0;
    }
    const auto calibration = read_calibration(file);
    if (!fuzz::count(bool(calibration)))
        return fuzz::require(!calibration.error().what.empty(), "an error has words"), 0;
    fuzz::require(calibration->width > 0 && calibration->height > 0 && calibration->model, "it is valid");
    fuzz::require(calibration->model->parameters().pinhole.is_valid(), "its intrinsics are valid");
    const Vec3 d = calibration->model->direction({0.5 * calibration->width, 0.25 * calibration->height});
    fuzz::require(std::abs(norm(d) - 1) < 1e-9 || !calibration->model->is_valid(), "directions are unit");
    return 0;
}
