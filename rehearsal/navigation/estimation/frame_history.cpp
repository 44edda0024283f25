#include "rehearsal/navigation/estimation/frame_history.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string_view>

#include "base/fnv1a.h"
#include "protocols/video/embedded_line.h"

namespace narpa::rehearsal {

bool FrameHistory::has_noise() const {
    return camera_.detector && (camera_.detector->shot_noise || camera_.detector->read_noise_e > 0);
}

/// By translation and turn of the target as the camera sees it.
double FrameHistory::moved_px(const Rigid3& a, const Rigid3& b) const {
    const double nearest_m = std::max(std::min(norm(a.t), norm(b.t)), 1e-9);
    const Quat turn = conjugate(a.q) * b.q;
    const double turn_rad = 2 * std::atan2(norm(Vec3{turn.x, turn.y, turn.z}), std::abs(turn.w));
    return camera_.model->pixels_per_radian() * (norm(a.t - b.t) / nearest_m + turn_rad);
}

std::string FrameHistory::staleness(std::span<const std::uint8_t> bytes, std::int64_t t_ns,
                                    const Rigid3& T_camera_target) {
    if (camera_.embedded_line) {
        const auto line = decode_embedded_line(bytes.last(bytes.size() / static_cast<std::size_t>(camera_.height)));
        if (line && 2 * std::abs(line->t_exposure_mid_ns - t_ns) > camera_.period_ns)
            return fmt::format("it is a frame of another time: its embedded line says {:+.3f} s",
                               static_cast<double>(line->t_exposure_mid_ns - t_ns) * 1e-9);
    }
    const std::uint64_t hash = fnv1a({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    for (std::size_t back = 1; back <= std::min(seen_, kKept); ++back) {
        const Frame& before = kept_[(seen_ - back) % kKept];
        if (before.hash != hash) continue;
        if (!has_noise() && moved_px(before.T_camera_target, T_camera_target) < 1) break;
        return fmt::format("its image is the same, byte for byte, as {} frame{} before: the camera repeats it",
                           back, back == 1 ? "" : "s");
    }
    kept_[seen_++ % kKept] = {hash, T_camera_target};
    return {};
}

}  // namespace narpa::rehearsal
