/// renderer/lidar/air_echo.h - what a medium sends back of a LiDAR's pulse, as its receiver sees it.
///
/// The receiver listens from `range_min_m` on, and not before its own pulse has left, in gates that are as long as
/// a pulse. A gate's light is that of the lidar equation (Medium::lidar_backscatter). It falls as 1 / range^2, so
/// the first gate whose light crosses the threshold is the medium's echo: the gates behind it belong to the same
/// one. A surface's echo has the light of its own gate besides. Light below a tenth of the threshold is not looked
/// at.
#pragma once

#include <cmath>
#include <numbers>

#include "renderer/light/medium.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Of an echo that is x times as strong as one that is just detected; `snr` of the latter, 0: a sharp limit.
[[nodiscard]] inline double detection_probability(double x, double snr) noexcept {
    if (snr > 0) return 0.5 * std::erfc(snr * (1 - x) / std::numbers::sqrt2);
    return x < 1 ? 0 : 1;
}

class AirEcho {
public:
    /// None: a vacuum.
    AirEcho() = default;
    /// `least_light`: rho / range^2 of what is just detected. 0: of a receiver without a threshold, which no medium
    /// crosses.
    AirEcho(const LidarReceiverModel& model, double least_light, const Medium* medium) noexcept;

    /// Decided at start: false where the medium is too faint for this receiver.
    [[nodiscard]] bool is_possible() const noexcept { return reach_m_ > start_m_; }

    /// The medium's own echo of a shot along this ray, whose nearest surface is at `nearest_m` (or infinite);
    /// without one the light is 0. `noise`: the threshold over that in the dark; `u`: uniform in (0, 1).
    [[nodiscard]] Medium::Backscatter first(const BodyPoses& at, const Ray& ray, double nearest_m, double noise,
                                            double u) const noexcept;
    /// Of the gate in which an echo from this range lies.
    [[nodiscard]] double light_at(const BodyPoses& at, const Ray& ray, double range_m) const noexcept;

private:
    const Medium* medium_ = nullptr;
    double least_light_ = 0, snr_ = 0, gate_m_ = 0;
    double start_m_ = 0, reach_m_ = 0;
};

}  // namespace narpa
