/// renderer/lidar/lidar_receiver.h - from shots to the echoes that a LiDAR measures: footprint, detection, noise.
///
/// A beam is a cone. One ray along its axis is wrong where it meets an edge, or a surface at more than 60 degrees
/// of incidence, over which the footprint is spread by range * divergence * tan(incidence). Sub-rays sample the
/// cone; their returns, sorted by range, are split into echoes wherever the next is farther than a pulse is long.
/// An echo is at the mean range of its light, rho / range^2 for each sub-ray. Beams on a flat surface are sampled
/// by a few of their sub-rays (renderer/lidar/beam_probes.h).
///
/// The strength x of an echo is its light in units of the least that is detected in the dark, that of a diffuse
/// surface of 10 % at LidarReceiverModel::range_at_10_percent_m. Sunlight raises the noise, and the threshold with
/// it, by s = sqrt(1 + sunlight_noise * radiance). An echo is detected with the probability Phi(snr * (x / s - 1)),
/// its range has the standard deviation hypot(noise, noise_at_limit * s / x), and it is late by walk / x: a pulse
/// that rises in proportion to its strength crosses a fixed threshold after a time in proportion to 1 / x.
///
/// A medium that sends light back itself adds to the echoes of surfaces, and gives one of its own, before them,
/// where it crosses the threshold (renderer/lidar/air_echo.h).
#pragma once

#include <cstdint>
#include <vector>

#include "base/counter_random.h"
#include "protocols/lidar/lidar_model.h"
#include "renderer/lidar/air_echo.h"
#include "renderer/lidar/beam_cone.h"
#include "renderer/lidar/beam_culling.h"
#include "renderer/lidar/beam_probes.h"
#include "renderer/lidar/diffuse_multipath.h"
#include "renderer/lidar/lidar_shot.h"
#include "renderer/scene/scene.h"

namespace narpa {

class LidarReceiver {
public:
    /// Most echoes of one shot; farther ones are lost.
    static constexpr std::size_t kMaxEchoes = 4;

    /// `seed`: the scene's; `index`: of the LiDAR, so that LiDARs have different noise. The tracer must outlive it.
    /// Allocates only here.
    LidarReceiver(const Tracer& tracer, const Lidar& lidar, std::uint64_t seed, std::size_t index);

    /// The medium dims the returns, scatters light of the pulses back, and scatters sunlight into the beams; null,
    /// the default: a vacuum. It must outlive this.
    void set_medium(const LidarMedium* medium) noexcept {
        medium_ = medium;
        bright_air_ = medium != nullptr && sunlight_ && tracer_.scene().sun.has_value();
        air_ = AirEcho(model_, min_light_, medium);
    }

    /// Measures a batch of shots along the axes `beams`, numbered from `first` on: the random draws depend on the
    /// numbers alone. `motions`: of all bodies, for velocities; empty: velocities are 0. Returns a bit for each
    /// shot that may have a return, and writes the echoes of these alone: range with bias and noise, before a
    /// packet's rounding; the reflectivity equivalent to the light at that range, which is less if only a part of
    /// the beam hits the surface.
    std::uint32_t receive(const BodyPoses& at, const RayBatch& beams, std::uint64_t first,
                          std::span<const Motion> motions, std::span<LidarEchoes> echoes) noexcept;

private:
    /// Light and range of one echo, and the ranges of its nearest and farthest return.
    struct Echo {
        double light = 0, range_m = 0, velocity_m_s = 0;
        double first_m = 0, last_m = 0;
    };
    using EchoList = std::array<Echo, kMaxEchoes>;
    class Draws;

    /// `first`: number of the first beam.
    void trace(const BodyPoses& at, const RayBatch& beams, std::uint64_t first, std::uint32_t wanted,
               const ShotSettings& settings, Draws& draws) noexcept;
    void trace(const BodyPoses& at, const RayBatch& beams, std::uint64_t first, std::uint32_t wanted,
               std::size_t begin, std::size_t end, ShotSettings settings) noexcept;
    [[nodiscard]] std::span<LidarReturn> met_by(std::size_t shot) noexcept;
    [[nodiscard]] static Echo echo_of_plane(std::span<const LidarReturn> probes,
                                            const BeamProbes::Ratios& ratios) noexcept;
    [[nodiscard]] static Echo echo_of(std::span<const LidarReturn> met, double nearest_m, double farthest_m,
                                      double n) noexcept;
    static void add_light(const LidarReturn& r, double n, Echo& echo) noexcept;
    [[nodiscard]] std::size_t part(std::span<LidarReturn> sub_rays, EchoList& echoes) const noexcept;
    [[nodiscard]] std::size_t add_multipath(std::span<LidarReturn> late, EchoList& echoes,
                                            std::size_t n) const noexcept;
    [[nodiscard]] float sunlight_in_air(const BodyPoses& at, const Ray& beam, double axis_m,
                                        double u) const noexcept;
    [[nodiscard]] double noise_in(double sunlight) const noexcept;
    [[nodiscard]] LidarEcho detect(const Echo& echo, double noise, std::size_t lane, std::size_t number,
                                   Draws& draws) const noexcept;
    [[nodiscard]] LidarEcho measure(const Echo& echo, double noise, std::size_t lane, std::size_t number,
                                    Draws& draws) const noexcept;
    [[nodiscard]] Echo air_echo(const BodyPoses& at, const Ray& beam, const ShotSettings& settings,
                                std::span<const LidarReturn> met, double noise, double u) const noexcept;

    const Tracer& tracer_;
    LidarReceiverModel model_;
    double range_max_m_;
    double shot_range_max_m_;  ///< beyond `range_max_m_` where ranges wrap
    int mount_;
    bool sunlight_;            ///< is computed
    bool reports_sunlight_;    ///< also where there is no echo
    bool bright_air_ = false;  ///< the medium scatters sunlight, which is computed
    double min_light_;         ///< rho / range^2; 0: all is detected
    bool random_;
    PhiloxSchedule schedule_;
    std::uint32_t stream_;
    BeamCone cone_;
    const LidarMedium* medium_ = nullptr;
    AirEcho air_;
    BeamCulling culling_;
    BeamProbes probes_;
    // Of the shots that may meet a body.
    Lanes<BeamCone::Across> across_{};
    Lanes<std::size_t> first_{};          ///< sub-ray in `met_`
    std::vector<LidarReturn> met_;        ///< of the sub-rays of one shot after the other
    std::uint32_t on_plane_ = 0;          ///< those whose probes alone are traced
    Lanes<BeamProbes::Ratios> ratios_{};  ///< of these
    DiffuseMultipath multipath_;
};

}  // namespace narpa
