#include "estimator/features/model_matches.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "estimator/features/feature_matcher.h"
#include "estimator/least_squares/median.h"
#include "estimator/least_squares/symmetric.h"

namespace narpa {
namespace {

/// Median of the length of a residual of unit variance in u and in v: Rayleigh's.
constexpr double kRayleighMedian = 1.17741;

/// Infinite where the point has no image.
Pixel project(const CameraModel& camera, const Vec3& p) {
    const auto image = camera.project(p);
    return image ? Pixel{image->x, image->y} : Pixel{kInfinity, kInfinity};
}

double distance_px(const Pixel& a, const Pixel& b) {
    return std::hypot(a.u - b.u, a.v - b.v);
}

/// Part of a window's side that overlaps with another window at this distance.
double overlap_of_sides(double distance) {
    return std::max(0.0, 1 - std::abs(distance) / (2 * kFlowHalfWindow_px + 1));
}

}  // namespace

double overlap(const Pixel& a, const Pixel& b) {
    return overlap_of_sides(a.u - b.u) * overlap_of_sides(a.v - b.v);
}

double root_mean_square(const std::vector<double>& lengths) {
    const Eigen::Map<const Eigen::VectorXd> all(lengths.data(), static_cast<Eigen::Index>(lengths.size()));
    return lengths.empty() ? 0 : std::sqrt(all.squaredNorm() / static_cast<double>(lengths.size()));
}

double scale_of(std::vector<double> lengths) {
    return upper_median(std::span(lengths)) / kRayleighMedian;
}

void ModelMatches::keep(const std::vector<std::uint8_t>& wanted) {
    std::size_t n = 0;
    for (std::size_t i = 0; i < size(); ++i)
        if (wanted[i] != 0)
            body_m[n] = body_m[i], in_view[n] = in_view[i], pixels[n] = pixels[i], noise[n] = noise[i], ++n;
    body_m.resize(n), in_view.resize(n), pixels.resize(n), noise.resize(n);
}

Eigen::Matrix2d ModelMatches::match_covariance(std::size_t i, double floor_px) const {
    return noise[i] + floor_px * floor_px * Eigen::Matrix2d::Identity();
}

std::vector<PixelCovariance> ModelMatches::covariances(double floor_px) const {
    std::vector<PixelCovariance> all;
    all.reserve(size());
    for (std::size_t i = 0; i < size(); ++i) {
        const Eigen::Matrix2d S = match_covariance(i, floor_px);
        all.push_back({S(0, 0), S(0, 1), S(1, 1)});
    }
    return all;
}

PointObservations ModelMatches::observations() const {
    PointObservations out;
    out.body_m = body_m, out.seen = pixels, out.noise = covariances(0);
    out.beyond.assign(size(), {1, 0, 1});
    out.window_px = 2 * kFlowHalfWindow_px + 1;
    out.numbers.assign(size(), 2);
    return out;
}

std::vector<Matrix26> ModelMatches::jacobians(const CameraModel& camera, const Rigid3& T) const {
    std::vector<Matrix26> all;
    all.reserve(size());
    for (const Vec3& p : body_m) all.push_back(reprojection_jacobian(camera, T, p));
    return all;
}

std::vector<double> ModelMatches::residuals_px(const CameraModel& camera, const Rigid3& T) const {
    std::vector<double> lengths;
    lengths.reserve(size());
    for (std::size_t i = 0; i < size(); ++i)
        lengths.push_back(distance_px(project(camera, T * body_m[i]), pixels[i]));
    return lengths;
}

double ModelMatches::moved_px(const CameraModel& camera, const Rigid3& from, const Rigid3& to) const {
    std::vector<double> lengths;
    lengths.reserve(size());
    for (const Vec3& p : body_m) lengths.push_back(distance_px(project(camera, from * p), project(camera, to * p)));
    return root_mean_square(lengths);
}

ModelMatches::Sums ModelMatches::sums(const CameraModel& camera, const Rigid3& T, double floor_px) const {
    std::vector<Eigen::Matrix<double, 6, 2>> whitened;
    whitened.reserve(size());
    for (std::size_t i = 0; i < size(); ++i)
        whitened.emplace_back(match_covariance(i, floor_px)
                                  .llt()
                                  .matrixL()
                                  .solve(reprojection_jacobian(camera, T, body_m[i]))
                                  .transpose());
    Sums out;
    for (std::size_t i = 0; i < size(); ++i) {
        out.information += whitened[i] * whitened[i].transpose();
        for (std::size_t j = 0; j < i; ++j) {
            const double part = overlap(pixels[i], pixels[j]);
            if (part <= 0) continue;
            const Matrix6 pair = part * whitened[i] * whitened[j].transpose();
            out.shared += pair + pair.transpose();
        }
    }
    return out;
}

double ModelMatches::freedom(const CameraModel& camera, const Rigid3& T, double floor_px) const {
    const Sums s = sums(camera, T, floor_px);
    return 2 * static_cast<double>(size()) - 6 - ldlt_solve(s.information, s.shared).trace();
}

double ModelMatches::inflation(const CameraModel& camera, const Rigid3& T, const Matrix6& C,
                               const Matrix6& covariance, double floor_px) const {
    constexpr int kParts = 4;  // each way
    double left = kInfinity, top = kInfinity, right = -kInfinity, bottom = -kInfinity;
    for (const Pixel& p : pixels)
        left = std::min(left, p.u), right = std::max(right, p.u), top = std::min(top, p.v),
        bottom = std::max(bottom, p.v);
    const double side = std::max({right - left, bottom - top, 1.0}) * (1 + 1e-9) / kParts;
    std::array<Vector6, kParts * kParts> pulls;
    std::array<int, kParts * kParts> members{};
    pulls.fill(Vector6::Zero());
    for (std::size_t i = 0; i < size(); ++i) {
        const auto part = static_cast<std::size_t>((pixels[i].v - top) / side) * kParts +
                          static_cast<std::size_t>((pixels[i].u - left) / side);
        const Eigen::Matrix2d S = match_covariance(i, floor_px);
        const Pixel p = project(camera, T * body_m[i]);
        const Eigen::Vector2d r(pixels[i].u - p.u, pixels[i].v - p.v);
        pulls[part] += reprojection_jacobian(camera, T, body_m[i]).transpose() * S.inverse() * r;
        ++members[part];
    }
    Matrix6 scatter = Matrix6::Zero();
    for (const Vector6& pull : pulls) scatter += pull * pull.transpose();
    const auto parts = static_cast<double>(std::ranges::count_if(members, [](int n) { return n > 0; }));
    constexpr double kUnknowns = 6;
    const double few = parts / std::max(1.0, parts - kUnknowns);
    return std::max(1.0, few * (inverse(covariance) * C * scatter * C).trace() / kUnknowns);
}

double ModelMatches::floor_px(const CameraModel& camera, const Rigid3& T, double freedom) const {
    const auto chi2 = [&](double floor) {
        double sum = 0;
        for (std::size_t i = 0; i < size(); ++i) {
            const Pixel p = project(camera, T * body_m[i]);
            const Eigen::Vector2d r(p.u - pixels[i].u, p.v - pixels[i].v);
            sum += r.dot(match_covariance(i, floor).inverse() * r);
        }
        return sum;
    };
    double low = 0, high = 10;
    if (chi2(low) <= freedom) return 0;
    for (int k = 0; k < 40; ++k) (chi2(0.5 * (low + high)) > freedom ? low : high) = 0.5 * (low + high);
    return high;
}

}  // namespace narpa
