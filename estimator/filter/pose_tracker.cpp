#include "estimator/filter/pose_tracker.h"

namespace narpa {

Status PoseTracker::start(std::int64_t t_ns, const RelativeState& state, const Matrix12& covariance) {
    auto made = PoseFilter::create(settings_.filter, t_ns, state, covariance);
    if (!made) return made.error();
    filter_ = *std::move(made);
    return Ok{};
}

UpdateResult PoseTracker::update(const PoseMeasurement& measurement) {
    UpdateResult result{
        UpdateOutcome::bad, 0,
        "it cannot start a filter: expected finite numbers, unit quaternions, a positive definite covariance"};
    if (filter_) {
        result = filter_->update(measurement);
        if (result.outcome != UpdateOutcome::gated || filter_->counts().gated_in_a_row < settings_.gated_in_a_row)
            return result;
    }
    auto made =
        PoseFilter::create(settings_.filter, measurement, settings_.first_velocity_m_s, settings_.first_rate_rad_s);
    if (!made) return result;
    restarts_ += filter_ ? 1 : 0;
    filter_ = *std::move(made);
    return {UpdateOutcome::taken, 0, ""};
}

}  // namespace narpa
