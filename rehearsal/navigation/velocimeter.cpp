#include "rehearsal/navigation/velocimeter.h"

#include <algorithm>
#include <cmath>

namespace narpa::rehearsal {

Velocimeter::Velocimeter(const SceneModel& model, std::size_t lidar)
    : lidar_(model.scene().lidars[lidar]), index_(lidar) {
    const BodyBounds& target = model.tracer().bounds(model.target());
    target_centre_m_ = target.centre_m;
    target_radius_m_ = std::max({target.semi_axes_m.x, target.semi_axes_m.y, target.semi_axes_m.z});
    std::vector<LidarShot> shots(lidar_.model->spec().shots_per_packet);
    for (std::int64_t packet = 0; lidar_.model->sweep(packet) == 0; ++packet) {
        lidar_.model->shots(packet, shots);
        for (const LidarShot& shot : shots) {
            const auto beam = static_cast<std::size_t>(shot.beam);
            if (beam >= beams_.size()) beams_.resize(beam + 1);
            beams_[beam] = shot;
        }
    }
}

std::optional<TargetVelocity> Velocimeter::measure(const LidarBeamReport& report,
                                                   const Rigid3& T_chaser_target) const {
    if (!(report.range_m > 0) || !std::isfinite(report.velocity_m_s) || report.beam >= beams_.size())
        return std::nullopt;
    const LidarShot& shot = beams_[report.beam];
    TargetVelocity v{.t_ns = report.t_ns,
                     .origin_m = lidar_.T_mount_lidar * shot.origin_m,
                     .direction = lidar_.T_mount_lidar.q * shot.direction,
                     .range_m = report.range_m,
                     .velocity_m_s = report.velocity_m_s,
                     .sigma_m_s = std::hypot(lidar_.receiver.velocity_noise_m_s,
                                             lidar_.model->spec().velocity_resolution_m_s / std::sqrt(12.0))};
    const Vec3 point = v.origin_m + v.range_m * v.direction;
    if (norm(point - T_chaser_target * target_centre_m_) > target_radius_m_) return std::nullopt;
    return v;
}

}  // namespace narpa::rehearsal
