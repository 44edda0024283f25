/// estimator/filter/pose_tracker.h - a pose filter that starts from its first measurement, and starts again once
/// several measurements in a row contradict it.
#pragma once

#include <optional>

#include "estimator/filter/pose_filter.h"

namespace narpa {

struct PoseTrackerSettings {
    FilterSettings filter{};
    /// Standard deviations of velocity and rate, about zero, where the filter starts from a measurement.
    double first_velocity_m_s = 1, first_rate_rad_s = 0.1;
    /// So many gated measurements in a row mean that the filter is wrong, not they.
    std::uint64_t gated_in_a_row = 5;
};

class PoseTracker {
public:
    explicit PoseTracker(const PoseTrackerSettings& settings) : settings_(settings) {}

    /// Starts from a known state. Errors: those of PoseFilter::create; the filter then stays as it was.
    Status start(std::int64_t t_ns, const RelativeState& state, const Matrix12& covariance);
    /// Updates the filter; starts it, or starts it again, from this measurement. Only a start allocates.
    UpdateResult update(const PoseMeasurement& measurement);
    /// The next measurement starts the filter.
    void stop() noexcept { filter_.reset(); }

    [[nodiscard]] bool started() const noexcept { return filter_.has_value(); }
    /// Once it has started.
    [[nodiscard]] PoseFilter& filter() noexcept { return *filter_; }
    [[nodiscard]] const PoseFilter& filter() const noexcept { return *filter_; }
    /// After measurements that contradicted it.
    [[nodiscard]] std::uint64_t restarts() const noexcept { return restarts_; }

private:
    PoseTrackerSettings settings_;
    std::optional<PoseFilter> filter_;
    std::uint64_t restarts_ = 0;
};

}  // namespace narpa
