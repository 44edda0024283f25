// A sweep's returns as residuals: distances of the measured points from the model's tangent planes.
#include <array>
#include <cmath>

#include "estimator/batch/measurement.h"

namespace narpa {
namespace {

class SweepMeasurement final : public Measurement {
public:
    SweepMeasurement(const Tracer& tracer, std::size_t target, const RangeNoise& noise,
                     const SweepObservations& sweep)
        : noise_(noise), sweep_(sweep), association_(tracer, target) {}

    int dimension() const noexcept override { return 1; }
    std::span<const BatchUnknown> unknowns() const noexcept override {
        static constexpr std::array kUnknowns{BatchUnknown::scale, BatchUnknown::range_bias};
        return kUnknowns;
    }

    /// Traces the beams, shortened by the bias, into the model at this pose.
    void associate(const Rigid3& T, const BatchValues& values) override {
        std::vector<RangePoint> points = sweep_.points;
        for (RangePoint& p : points) p.range_m -= at(values, BatchUnknown::range_bias);
        association_.take(points, sweep_.motion);
        association_.set_scale(1 + at(values, BatchUnknown::scale));
        association_.find_edges(T, noise_);
        association_.associate(T, noise_, 0, 1, planes_);
        met_.clear();
        for (std::size_t i = 0; i < planes_.size(); ++i)
            if (planes_[i].fate == BeamClass::met &&
                std::abs(planes_[i].distance_m) < kFarthest_sigmas * planes_[i].sigma_m)
                met_.push_back(i);
        size_ = 1 + at(values, BatchUnknown::scale);
    }

    bool evaluate(const Rigid3& T, const BatchValues& values, Residuals& out) const override {
        const double size = 1 + at(values, BatchUnknown::scale), bias = at(values, BatchUnknown::range_bias);
        const auto n = static_cast<Eigen::Index>(met_.size());
        out.value.resize(n);
        out.jacobian.resize(n, 8);
        for (Eigen::Index k = 0; k < n; ++k) {
            const std::size_t i = met_[static_cast<std::size_t>(k)];
            const RangePoint& p = sweep_.points[i];
            const PointToPlane& plane = planes_[i];
            // The target moves during the sweep: back to the time of the pose, about the target's origin.
            const Quat back = conjugate(exp_rotation(p.t_s * sweep_.motion.rate_rad_s));
            const Vec3 direction = back * p.direction;
            const Vec3 from_target =
                back * (p.origin_m + (p.range_m - bias) * p.direction - p.t_s * sweep_.motion.velocity_m_s - T.t);
            const Vec3 normal = T.q * plane.normal, surface = (1 / size_) * plane.surface_m;  // of the model
            out.value[k] = dot(normal, from_target) - size * dot(plane.normal, surface);
            auto row = out.jacobian.row(k);
            row.head<3>() = to_eigen(cross(normal, from_target)).transpose();
            row.segment<3>(3) = -to_eigen(conjugate(back) * normal).transpose();
            row[6] = -dot(plane.normal, surface);
            row[7] = -dot(normal, direction);
        }
        return true;
    }

    Eigen::Matrix2d noise(std::size_t i) const override {
        const double sigma_m = planes_[met_[i]].sigma_m;
        return sigma_m * sigma_m * Eigen::Matrix2d::Identity();
    }
    /// Errors beyond the noise grow with it.
    Eigen::Matrix2d beyond(std::size_t i) const override { return noise(i); }

private:
    /// Returns further from the surface are of something else.
    static constexpr double kFarthest_sigmas = 30;

    RangeNoise noise_;
    const SweepObservations& sweep_;
    BeamAssociation association_;
    double size_ = 1;  ///< for which the planes were found
    std::vector<PointToPlane> planes_;
    std::vector<std::size_t> met_;  ///< points with a plane
};

}  // namespace

std::unique_ptr<Measurement> measurement_of(const Tracer& tracer, std::size_t target, const RangeNoise& noise,
                                            const SweepObservations& sweep) {
    return std::make_unique<SweepMeasurement>(tracer, target, noise, sweep);
}

}  // namespace narpa
