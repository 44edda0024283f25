// The same result whatever the vector flags of this program (CMakeLists.txt): layouts do not depend on them.
#include <narpa/estimator/filter/pose_filter.h>
#include <cmath>
#include <vector>

static_assert(alignof(narpa::Matrix6) == alignof(double) && alignof(narpa::Matrix12) == alignof(double));

int main() {
    narpa::PoseMeasurement first;
    first.T_sensor_target.t = {0, 0, 10};
    first.covariance = 1e-4 * narpa::Matrix6::Identity();
    std::vector<narpa::PoseMeasurement> measurements(3, first);
    auto filter = narpa::PoseFilter::create({}, first, 0.1, 0.01);
    if (!filter) return 1;
    for (std::size_t i = 0; i < measurements.size(); ++i) {
        measurements[i].t_ns = static_cast<std::int64_t>(i + 1) * 1'000'000'000;
        if (filter->update(measurements[i]).outcome != narpa::UpdateOutcome::taken) return 2;
    }
    const double variance = filter->covariance()(0, 0);
    return std::isfinite(variance) && variance > 0 && variance < 1e-4 &&
                   std::abs(filter->state().position_m.z - 10) < 1e-6
               ? 0
               : 3;
}
