#include "estimator/view/row_times.h"

#include <algorithm>
#include <cassert>

namespace narpa {

RowTimes RowTimes::scaled(double factor) const noexcept {
    const double more = factor - 1;  // rows
    return {at(0.5 * more), factor * row_s, std::max(exposure_s + more * row_s, 0.0)};
}

RowTimes RowTimes::part(int k, int n) const noexcept {
    assert(0 <= k && k < n);
    const double length = exposure_s / n;
    return {middle_s - 0.5 * exposure_s + (k + 0.5) * length, row_s, length};
}

RowTimes row_times(const Camera& camera) {
    if (!camera.shutter || !camera.detector) return {};
    const double row_s = 1e-9 * static_cast<double>(camera.shutter->row_time_ns);
    return {-0.5 * (camera.height - 1) * row_s, row_s, camera.detector->exposure_s};
}

CameraPose camera_path(const Rigid3& T_world_target, const Rigid3& T_camera_target, const ApparentMotion& motion,
                       const RowTimes& times, int rows) {
    if (motion == ApparentMotion{}) return T_world_target * inverse(T_camera_target);
    const auto T_world_camera = [&](double t_s) {
        return T_world_target * inverse(moved(T_camera_target, motion, t_s));
    };
    const double start_s = times.at(0) - 0.5 * times.exposure_s,
                 end_s = times.at(rows - 1) + 0.5 * times.exposure_s;
    if (!(end_s > start_s)) return T_world_camera(0);
    return {T_world_camera(start_s), T_world_camera(end_s), times.row_s / (end_s - start_s)};
}

void to_mid_exposure(const Rigid3& T_camera_target, const ApparentMotion& motion, const RowTimes& times,
                     std::span<const Pixel> pixels, std::span<Vec3> body_m) noexcept {
    assert(pixels.size() == body_m.size());
    if (times.at_once()) return;
    const Rigid3 T_target_camera = inverse(T_camera_target);
    for (std::size_t i = 0; i < body_m.size(); ++i)
        body_m[i] = T_target_camera * (moved(T_camera_target, motion, times.at(pixels[i].v)) * body_m[i]);
}

}  // namespace narpa
