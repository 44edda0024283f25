#include <narpa/estimator/filter/pose_filter.h>

int main() {
    narpa::PoseMeasurement first;
    first.T_sensor_target.t = {0, 0, 10};
    first.covariance = 1e-4 * narpa::Matrix6::Identity();
    auto filter = narpa::PoseFilter::create({}, first, 0.1, 0.01);
    return filter && filter->update(first).outcome == narpa::UpdateOutcome::taken ? 0 : 1;
}
