/// renderer/lidar/lidar_receiver.h - from shots to what a LiDAR reports of them: footprint, echoes, threshold,
/// noise.
///
/// A beam is a cone. One ray along its axis is wrong where it meets an edge, or a surface at more than 60 degrees
/// of incidence, over which the footprint is spread by range * divergence * tan(incidence). Sub-rays sample the
/// cone; their returns, sorted by range, part into echoes wherever the next is farther than a pulse is long. An
/// echo is at the mean range of its light, rho / range^2 for each sub-ray.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/camera/counter_random.h"
#include "renderer/lidar/lidar_shot.h"
#include "renderer/scene/scene.h"

namespace narpa {

class LidarReceiver {
public:
    /// `seed`: the scene's; `lidar`: index, so that LiDARs differ. Allocates here and never again.
    LidarReceiver(const LidarReceiverModel& model, double range_max_m, std::uint64_t seed, std::size_t lidar);

    /// A batch of shots along the axes `beams`, numbered from `first` on: the numbers alone decide on their random
    /// draws. Writes beams.n returns: the reported echo's range with bias and noise, before quantisation; the
    /// reflectivity that the light stands for at that range, which is less where only a part of the beam is met;
    /// the body that sends most of it. With nothing modelled it is `shoot`.
    void receive(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, std::uint64_t first,
                 std::span<LidarReturn> returns) noexcept;

private:
    [[nodiscard]] LidarReturn echo_of(std::span<LidarReturn> sub_rays) const noexcept;
    void gather(const Tracer& tracer, const BodyPoses& at, const RayBatch& beams, const RandomLanes& random,
                std::span<LidarReturn> returns) noexcept;

    LidarReceiverModel model_;
    double range_max_m_;
    PhiloxSchedule schedule_;
    std::uint32_t stream_;
    std::vector<double> radius_, turn_;  ///< of each sub-ray: tangent of its angle from the axis, and about it
    std::vector<LidarReturn> met_;       ///< of the sub-rays of one shot after the other
};

}  // namespace narpa
