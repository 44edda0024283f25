#include "estimator/cloud/own_body.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/constants.h"
#include "renderer/scene/scene.h"

namespace narpa {
namespace {

constexpr int kRim = 6;

class OwnBody {
public:
    OwnBody(const Tracer& tracer, const Lidar& lidar)
        : tracer_(tracer),
          at_(tracer.scene().bodies.size()),
          own_(static_cast<std::uint32_t>(lidar.mount)),
          T_own_lidar_(lidar.T_mount_lidar),
          tangent_(std::tan(0.55 * lidar.receiver.beam_divergence_rad)) {}  // a tenth more than the beam

    template <class Beam>
    void remove_from(std::vector<Beam>& beams) const {
        std::size_t kept = 0;
        for (std::size_t i = 0; i < beams.size(); i += kLanes) {
            const std::size_t n = std::min<std::size_t>(kLanes, beams.size() - i);
            const std::uint32_t met = meeting(beams, i, n);
            for (std::size_t k = 0; k < n; ++k)
                if (!is_set(met, k)) beams[kept++] = beams[i + k];
        }
        beams.resize(kept);
    }

private:
    /// Of n beams: the axis, then the rim of the beam.
    template <class Beam>
    [[nodiscard]] std::uint32_t meeting(const std::vector<Beam>& beams, std::size_t first, std::size_t n) const {
        RayBatch rays;
        HitBatch hits;
        rays.n = n;
        std::uint32_t met = 0;
        for (int rim = 0; rim <= (tangent_ > 0 ? kRim : 0); ++rim) {
            const double turn = 2 * kPi * rim / kRim, r = rim == 0 ? 0 : tangent_;
            for (std::size_t k = 0; k < n; ++k) {
                const Vec3 d = beams[first + k].direction;
                const Vec3 x = normalized(cross(d, std::abs(d.z) < 0.99 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}));
                const Vec3 y = cross(d, x);
                const Vec3 ray = normalized(d + r * (std::cos(turn) * x + std::sin(turn) * y));
                rays.put(k, {T_own_lidar_ * beams[first + k].origin_m, T_own_lidar_.q * ray});
            }
            tracer_.intersect(at_, rays, {&own_, 1}, hits);
            met |= hits.met;
        }
        return met;
    }

    const Tracer& tracer_;
    BodyPoses at_;  ///< own axes are the tracer's world
    std::uint32_t own_;
    Rigid3 T_own_lidar_;
    double tangent_;
};

}  // namespace

void remove_own_body(const Tracer& tracer, const Lidar& lidar, LidarSweep& sweep) {
    if (lidar.mount < 0) return;
    const OwnBody own(tracer, lidar);
    own.remove_from(sweep.points);
    own.remove_from(sweep.empty);
}

}  // namespace narpa
