// Points of a frame as residuals: measured minus predicted pixels.
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/constants.h"
#include "estimator/batch/measurement.h"

namespace narpa {
namespace {

/// Image point of a direction through the changed camera, and its derivatives.
struct ChangedImage {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> by_point;
    Eigen::Matrix<double, 2, 5> by_camera;  ///< by focal, centre x and y, k1, k2
};

/// The model's camera with the changes of focal length, principal point and distortion.
class ChangedCamera {
public:
    ChangedCamera(const CameraModel& model, const BatchValues& unknowns)
        : model_(model),
          focal_(at(unknowns, BatchUnknown::focal)),
          k1_(at(unknowns, BatchUnknown::k1)),
          k2_(at(unknowns, BatchUnknown::k2)) {
        const auto centre = model.project({0, 0, 1});
        centre_ = centre ? Eigen::Vector2d(centre->x, centre->y) : Eigen::Vector2d::Zero();
        shift_ = {at(unknowns, BatchUnknown::centre_x), at(unknowns, BatchUnknown::centre_y)};
    }

    /// `p`: camera axes. False if it has no image.
    [[nodiscard]] bool project(const Vec3& p, ChangedImage& out) const {
        if (!(p.z > 0)) return false;
        const double u = p.x / p.z, v = p.y / p.z, s = u * u + v * v;
        const double stretch = 1 + s * (k1_ + s * k2_), stretch_by_s = k1_ + 2 * s * k2_;
        const Vec3 bent{u * stretch, v * stretch, 1};
        const auto image = model_.project(bent);
        if (!image) return false;
        const Eigen::Matrix<double, 2, 3> J = (1 + focal_) * to_eigen(model_.jacobian(bent));
        const Eigen::Matrix2d by_bent = J.leftCols<2>();
        const Eigen::Vector2d plane(u, v);
        Eigen::Matrix2d bent_by_plane = stretch * Eigen::Matrix2d::Identity();
        bent_by_plane += 2 * stretch_by_s * plane * plane.transpose();
        Eigen::Matrix<double, 2, 3> plane_by_point;
        plane_by_point << 1 / p.z, 0, -u / p.z, 0, 1 / p.z, -v / p.z;
        const Eigen::Vector2d at_model(image->x, image->y), from_centre = at_model - centre_;
        out.pixel = centre_ + (1 + focal_) * from_centre + shift_;
        out.by_point = by_bent * bent_by_plane * plane_by_point;
        out.by_camera.col(0) = from_centre;
        out.by_camera.middleCols<2>(1).setIdentity();
        out.by_camera.col(3) = by_bent * (s * plane);
        out.by_camera.col(4) = by_bent * (s * s * plane);
        return true;
    }

private:
    const CameraModel& model_;
    double focal_, k1_, k2_;
    Eigen::Vector2d centre_, shift_;
};

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
        static constexpr std::array kUnknowns{BatchUnknown::scale,    BatchUnknown::focal, BatchUnknown::centre_x,
                                              BatchUnknown::centre_y, BatchUnknown::k1,    BatchUnknown::k2};
        return kUnknowns;
    }
    void associate(const Rigid3&, const BatchValues&) override {}

    bool evaluate(const Rigid3& T, const BatchValues& values, Residuals& out) const override {
        const ChangedCamera camera(*camera_, values);
        const double size = 1 + at(values, BatchUnknown::scale);
        const auto n = static_cast<Eigen::Index>(points_.size());
        out.value.resize(2 * n);
        out.jacobian.resize(2 * n, 12);
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
            rows.rightCols<5>() = -image.by_camera;
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
