#include "renderer/lidar/beam_cone.h"

#include <cmath>
#include <numbers>

namespace narpa {

BeamCone::BeamCone(double divergence_rad, int rays) : offsets_(static_cast<std::size_t>(rays)) {
    if (rays == 1) return;
    tangent_ = std::tan(0.5 * divergence_rad);
    for (int i = 0; i < rays; ++i) {
        const double radius = tangent_ * std::sqrt((i + 0.5) / rays),
                     turn = 2 * std::numbers::pi * i / std::numbers::phi;
        offsets_[static_cast<std::size_t>(i)] = {radius * std::cos(turn), radius * std::sin(turn)};
    }
}

BeamCone::Across BeamCone::across(const Vec3& beam, std::uint32_t turn) noexcept {
    const Vec3 any = std::abs(beam.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    const Vec3 x = normalized(cross(any, beam)), y = cross(beam, x);
    const double angle = 2 * std::numbers::pi * (turn + 0.5) * 0x1p-32, c = std::cos(angle), s = std::sin(angle);
    return {c * x + s * y, c * y - s * x};
}

}  // namespace narpa
