#include "renderer/lidar/air_echo.h"

#include <algorithm>

namespace narpa {
namespace {

/// Share of the detection threshold below which a gate is ignored: a crossing there would be due to noise, not to
/// the medium.
constexpr double kFaintestGate = 0.1;

}  // namespace

AirEcho::AirEcho(const LidarReceiverModel& model, double min_light, const LidarMedium* medium) noexcept
    : medium_(medium),
      min_light_(min_light),
      snr_(model.detection_snr),
      gate_m_(model.pulse_length_m),
      start_m_(std::max(model.range_min_m, model.pulse_length_m)) {
    if (medium == nullptr || !(min_light > 0)) return;
    reach_m_ = std::sqrt(medium->max_backscatter_1_m() * gate_m_ / (kFaintestGate * min_light));
}

LidarMedium::Backscatter AirEcho::first(const BodyPoses& at, const Ray& ray, double nearest_m, double noise,
                                        double u) const noexcept {
    double missed = 1;
    const double end_m = std::min(reach_m_, nearest_m) - gate_m_;
    for (double from_m = start_m_; from_m < end_m; from_m += gate_m_) {
        const LidarMedium::Backscatter gate = medium_->backscatter(at, ray, from_m, from_m + gate_m_);
        const double x = gate.light / min_light_;
        if (x < kFaintestGate) continue;
        missed *= 1 - detection_probability(x / noise, snr_);
        if (u >= missed) return gate;
    }
    return {};
}

double AirEcho::light_at(const BodyPoses& at, const Ray& ray, double range_m) const noexcept {
    if (range_m > reach_m_) return 0;
    const double half = std::min(0.5 * gate_m_, 0.5 * range_m);
    return medium_->backscatter(at, ray, range_m - half, range_m).light * (half > 0 ? gate_m_ / half : 0);
}

}  // namespace narpa
