// Brightness of blocks as residuals: measured minus predicted, as parts of the model's mean.
#include <array>
#include <cmath>

#include "estimator/batch/measurement.h"

namespace narpa {
namespace {

class BrightnessMeasurement final : public Measurement {
public:
    explicit BrightnessMeasurement(const BrightnessObservations& brightness)
        : blocks_(brightness.blocks), light_rad_(brightness.light_rad) {
        for (const BrightnessBlock& b : blocks_) mean_ += b.model / static_cast<double>(blocks_.size());
    }

    int dimension() const noexcept override { return 1; }
    std::span<const BatchUnknown> unknowns() const noexcept override { return kBrightnessUnknowns; }
    bool has_pose() const noexcept override { return false; }
    void associate(const Rigid3&, const BatchValues&) override {}

    /// As brightness by the cosine of the angle of incidence changes if light is turned by an angle.
    bool evaluate(const Rigid3&, const BatchValues& values, Residuals& out) const override {
        const double x = at(values, BatchUnknown::light_x) - light_rad_[0],
                     y = at(values, BatchUnknown::light_y) - light_rad_[1];
        const double angle = std::hypot(x, y), along = std::cos(angle);
        const double across = angle > 0 ? std::sin(angle) / angle : 1;
        const double gain = (1 + at(values, BatchUnknown::albedo)) / mean_;
        const auto n = static_cast<Eigen::Index>(blocks_.size());
        out.value.resize(n);
        out.jacobian = Eigen::MatrixXd::Zero(n, 9);
        for (Eigen::Index i = 0; i < n; ++i) {
            const BrightnessBlock& b = blocks_[static_cast<std::size_t>(i)];
            const double lit = along * b.model + across * (x * b.by_light[0] + y * b.by_light[1]);
            out.value[i] = b.measured / mean_ - gain * lit;
            out.jacobian(i, 6) = -lit / mean_;
            out.jacobian(i, 7) = -gain * (across * b.by_light[0] - x * across * b.model);
            out.jacobian(i, 8) = -gain * (across * b.by_light[1] - y * across * b.model);
        }
        return true;
    }

    Eigen::Matrix2d noise(std::size_t i) const override {
        return blocks_[i].variance / (mean_ * mean_) * Eigen::Matrix2d::Identity();
    }
    /// Errors of surfaces are parts of their brightness.
    Eigen::Matrix2d beyond(std::size_t i) const override {
        constexpr double kPart = 0.01;
        const double sigma = kPart * blocks_[i].model / mean_;
        return sigma * sigma * Eigen::Matrix2d::Identity();
    }
    std::size_t parts() const noexcept override { return BrightnessObservations::kParts; }
    std::size_t part(std::size_t i) const override { return blocks_[i].part; }

private:
    const std::vector<BrightnessBlock>& blocks_;
    std::array<double, 2> light_rad_;
    double mean_ = 0;  ///< DN
};

}  // namespace

std::unique_ptr<Measurement> measurement_of(const BrightnessObservations& brightness) {
    return std::make_unique<BrightnessMeasurement>(brightness);
}

}  // namespace narpa
