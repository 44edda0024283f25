// Points of a frame as residuals: measured minus predicted pixels.
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/constants.h"
#include "estimator/batch/camera_change.h"
#include "estimator/batch/measurement.h"

namespace narpa {
namespace {

Eigen::Matrix2d matrix_of(const PixelCovariance& c) {
    Eigen::Matrix2d m;
    m << c.uu, c.uv, c.uv, c.vv;
    return m;
}

class ImageMeasurement final : public Measurement {
public:
    ImageMeasurement(std::shared_ptr<const CameraModel> camera, const PointObservations& points)
        : camera_(std::move(camera)), points_(points) {
        if (points_.window_px > 0) set_parts();
    }

    int dimension() const noexcept override { return 2; }
    std::span<const BatchUnknown> unknowns() const noexcept override {
        static constexpr auto kUnknowns = [] {
            std::array<BatchUnknown, 1 + kCameraUnknowns.size()> all{BatchUnknown::scale};
            std::ranges::copy(kCameraUnknowns, all.begin() + 1);
            return all;
        }();
        return kUnknowns;
    }
    void associate(const Rigid3&, const BatchValues&) override {}

    bool evaluate(const Rigid3& T, const BatchValues& values, Residuals& out) const override {
        const ChangedCamera camera(*camera_, values);
        const double size = 1 + at(values, BatchUnknown::scale);
        const auto n = static_cast<Eigen::Index>(points_.size());
        out.value.resize(2 * n);
        out.jacobian.resize(2 * n, 7 + static_cast<Eigen::Index>(kCameraUnknowns.size()));
        ChangedImage image;
        for (Eigen::Index i = 0; i < n; ++i) {
            const auto k = static_cast<std::size_t>(i);
            const Vec3 turned = T.q * points_.body_m[k];
            if (!camera.project(size * turned + T.t, image)) return false;
            out.value.segment<2>(2 * i) = Eigen::Vector2d(points_.seen[k].u, points_.seen[k].v) - image.pixel;
            auto rows = out.jacobian.middleRows<2>(2 * i);
            rows.leftCols<3>() = image.by_point * skew(to_eigen(size * turned));
            rows.middleCols<3>(3) = -image.by_point;
            rows.col(6) = -image.by_point * to_eigen(turned);
            rows.rightCols<kCameraUnknowns.size()>() = -image.by_camera;
        }
        return true;
    }

    Eigen::Matrix2d noise(std::size_t i) const override { return matrix_of(points_.noise[i]); }
    Eigen::Matrix2d beyond(std::size_t i) const override { return matrix_of(points_.beyond[i]); }
    bool has_shared() const noexcept override { return points_.window_px > 0; }
    double shared(std::size_t i, std::size_t j) const override {
        const auto overlap = [&](double distance) {
            return std::max(0.0, 1 - std::abs(distance) / points_.window_px);
        };
        return overlap(points_.seen[i].u - points_.seen[j].u) * overlap(points_.seen[i].v - points_.seen[j].v);
    }
    std::size_t parts() const noexcept override { return parts_.empty() ? 0 : kAcross * kAcross; }
    std::size_t part(std::size_t i) const override { return parts_[i]; }
    double common(std::size_t i) const override { return points_.common_px.empty() ? 0 : points_.common_px[i]; }
    double scatter_min() const noexcept override { return points_.scatter_min; }
    double inflation() const noexcept override { return points_.inflation; }
    int numbers(std::size_t i) const override { return points_.numbers[i]; }

private:
    static constexpr std::size_t kAcross = 4;

    void set_parts() {
        Pixel low{kInfinity, kInfinity}, high{-kInfinity, -kInfinity};
        for (const Pixel& p : points_.seen) {
            low = {std::min(low.u, p.u), std::min(low.v, p.v)};
            high = {std::max(high.u, p.u), std::max(high.v, p.v)};
        }
        const double side = std::max({high.u - low.u, high.v - low.v, 1.0}) * (1 + 1e-9) / kAcross;
        for (const Pixel& p : points_.seen)
            parts_.push_back(static_cast<std::size_t>((p.v - low.v) / side) * kAcross +
                             static_cast<std::size_t>((p.u - low.u) / side));
    }

    std::shared_ptr<const CameraModel> camera_;
    PointObservations points_;
    std::vector<std::size_t> parts_;  ///< of each point, in squares that divide the points' image
};

}  // namespace

std::unique_ptr<Measurement> measurement_of(std::shared_ptr<const CameraModel> camera,
                                            const PointObservations& points) {
    return std::make_unique<ImageMeasurement>(std::move(camera), points);
}

}  // namespace narpa
