/// renderer/lidar/air_echo.h - backscatter of a LiDAR's pulse by a medium, as detected by its receiver.
///
/// The receiver divides the range into gates as long as a pulse, from `range_min_m` on, and not before its own
/// pulse has left. A gate's light is that of the lidar equation (LidarMedium::backscatter). It falls as 1 /
/// range^2, so the first gate whose light crosses the threshold is the medium's echo; later gates belong to the
/// same echo. A surface's echo also contains the light of its own gate. Light below a tenth of the threshold is
/// ignored.
#pragma once

#include <cmath>
#include <numbers>

#include "renderer/light/lidar_medium.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// Detection probability of an echo x times as strong as the threshold. `snr`: at the threshold; 0: a sharp limit.
[[nodiscard]] inline double detection_probability(double x, double snr) noexcept {
    if (snr > 0) return 0.5 * std::erfc(snr * (1 - x) / std::numbers::sqrt2);
    return x < 1 ? 0 : 1;
}

class AirEcho {
public:
    /// A vacuum: no echo.
    AirEcho() = default;
    /// `min_light`: rho / range^2 at the detection threshold. 0: a receiver without a threshold, for which a
    /// medium gives no echo.
    AirEcho(const LidarReceiverModel& model, double min_light, const LidarMedium* medium) noexcept;

    /// Decided at start: false where the medium is too faint for this receiver.
    [[nodiscard]] bool is_possible() const noexcept { return reach_m_ > start_m_; }

    /// The medium's own echo of a shot along this ray, whose nearest surface is at `nearest_m` (or infinite);
    /// without one the light is 0. `noise`: the threshold over that in the dark; `u`: uniform in (0, 1).
    [[nodiscard]] LidarMedium::Backscatter first(const BodyPoses& at, const Ray& ray, double nearest_m,
                                                 double noise, double u) const noexcept;
    /// Light of the gate in which an echo from this range lies.
    [[nodiscard]] double light_at(const BodyPoses& at, const Ray& ray, double range_m) const noexcept;

private:
    const LidarMedium* medium_ = nullptr;
    double min_light_ = 0, snr_ = 0, gate_m_ = 0;
    double start_m_ = 0, reach_m_ = 0;
};

}  // namespace narpa
