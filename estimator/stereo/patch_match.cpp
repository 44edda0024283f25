#include "estimator/stereo/patch_match.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "estimator/pose/pose_estimate.h"

namespace narpa {
EpipolarWarp::EpipolarWarp(const Pinhole& from, const Pinhole& to, const Rigid3& T_to_from)
    : t_(to_eigen(T_to_from.t)), to_(to) {
    const auto [origin, per_x, per_y] = from.rays(T_to_from.q);
    origin_ = to_eigen(origin), across_ = to_eigen(per_x), down_ = to_eigen(per_y);
}

namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// Shift (2), slopes (2) and curvatures (3) of the inverse depth over the patch, gain, offset.
using Vector = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;

constexpr int kIterationsMax = 20;
constexpr double kSettled_px = 1e-4, kFarthest_px = 1.5;
/// Error of a pixel's position in the other image that neither plane nor curvature describes, including
/// interpolation and aliasing; independent between pixels. Measured on scenes/descent: with it the predicted
/// scatter across epipolar lines, which relief does not affect, equals the measured one at a quarter to twice the
/// exposure.
constexpr double kUnexplained_px = 0.06;
/// How far ground that is not flat may move the image of a patch's edge, as craters of scenes/descent do.
constexpr double kCurvature_px = 0.1;
/// Correlations that differ by less than this are the same.
constexpr double kAlike = 1e-3;
/// Along an epipolar line every so many pixels of a patch are compared each way; all of them where these correlate
/// nearly as well as the best, to kNearlyBest.
constexpr int kSearchStride = 2;
constexpr double kNearlyBest = 0.1;
/// Pixels above this part of the largest value count as saturated.
constexpr double kFull = 0.98;

/// Stops and returns false when a visit returns false.
template <class Visit>  // bool(Vector2d offset, double dn)
bool for_each_pixel(const Patch& patch, Visit visit) {
    const double* dn = patch.dn.data();
    for (int y = -patch.radius_px; y <= patch.radius_px; ++y)
        for (int x = -patch.radius_px; x <= patch.radius_px; ++x)
            if (!visit(Vector2d(x, y), *dn++)) return false;
    return true;
}

class Correlation {
public:
    void add(double a, double b) { ++n_, a_ += a, b_ += b, aa_ += a * a, bb_ += b * b, ab_ += a * b; }
    [[nodiscard]] double value() const {
        const double va = aa_ - a_ * a_ / n_, vb = bb_ - b_ * b_ / n_;
        return va > 0 && vb > 0 ? (ab_ - a_ * b_ / n_) / std::sqrt(va * vb) : 0;
    }

private:
    double n_ = 0, a_ = 0, b_ = 0, aa_ = 0, bb_ = 0, ab_ = 0;
};

/// A place along an epipolar line.
struct LinePlace {
    Vector2d px;
    double inverse_depth, correlation;
};

/// Correlation of the patch with the other image, sampled where a camera-facing plane would appear, at whole
/// pixels. Of every `stride`-th pixel of it each way.
std::optional<double> correlation(const Patch& patch, const EpipolarWarp& warp, const StereoView& there,
                                  const LinePlace& at, int stride) {
    Correlation c;
    const Vector2d shift = at.px - warp.px(warp.ray(patch.centre_px()), at.inverse_depth);
    const int r = patch.radius_px, row = 2 * r + 1;
    for (int y = -r; y <= r; y += stride)
        for (int x = -r; x <= r; x += stride) {
            const Vector3d ray = warp.ray(patch.centre_px() + Vector2d(x, y));
            if (!warp.is_before(ray, at.inverse_depth)) return {};
            const Vector2d px = warp.px(ray, at.inverse_depth) + shift;
            if (!there.spline.holds(px)) return {};
            c.add(patch.dn[static_cast<std::size_t>((y + r) * row + x + r)], there.spline.dn(px));
        }
    return c.value();
}

/// Sums of a step of the fit.
struct Normal {
    Matrix9 H = Matrix9::Zero();      ///< weighted by window and noise
    Matrix9 noise = Matrix9::Zero();  ///< covariance of `b`
    Vector b = Vector::Zero();
    double squares = 0, expected_squares = 0;  ///< of the residuals
};

class PatchFit {
public:
    PatchFit(const Patch& patch, const StereoView& here, const EpipolarWarp& warp, const StereoView& there,
             double inverse_depth)
        : patch_(patch),
          here_(here),
          warp_(warp),
          there_(there),
          inverse_depth_(inverse_depth),
          per_px_(1 / warp.px_slope(warp.ray(patch.centre_px()), inverse_depth).norm()) {}

    /// Image of the patch's centre without a shift.
    [[nodiscard]] Vector2d start_px() const { return warp_.px(warp_.ray(patch_.centre_px()), inverse_depth_); }

    /// Nothing where the patch leaves the other image.
    [[nodiscard]] std::optional<Normal> linearise(const Vector& p) const {
        Normal n;
        if (!for_each_pixel(patch_, [&](const Vector2d& offset, double dn) { return add(offset, dn, p, n); }))
            return {};
        const Eigen::Vector3d information = Eigen::Vector3d::Constant(1 / (kCurvature_px * kCurvature_px));
        n.H.diagonal().segment<3>(4) += information;
        n.noise.diagonal().segment<3>(4) += information;
        n.b.segment<3>(4) -= information.cwiseProduct(p.segment<3>(4));
        return n;
    }

private:
    bool add(const Vector2d& offset, double dn, const Vector& p, Normal& n) const {
        const Vector3d ray = warp_.ray(patch_.centre_px() + offset);
        const Vector2d at = offset / patch_.radius_px;
        Eigen::Matrix<double, 5, 1> relief;  // in pixels at the patch's edge
        relief << at, at.x() * at.x(), at.x() * at.y(), at.y() * at.y();
        const double inverse_depth = inverse_depth_ + per_px_ * p.segment<5>(2).dot(relief);
        if (!warp_.is_before(ray, inverse_depth)) return false;
        const Vector2d px = warp_.px(ray, inverse_depth) + p.head<2>();
        if (!there_.spline.holds(px)) return false;

        const auto s = there_.spline.sample(px);
        const double gain = p[7], residual = gain * dn + p[8] - s.dn;
        Vector J;
        J << s.gradient, per_px_ * s.gradient.dot(warp_.px_slope(ray, inverse_depth)) * relief, -dn, -1;
        const double noise = there_.sensor.variance_dn2(s.dn) + gain * gain * here_.sensor.variance_dn2(dn);
        const double unexplained = kUnexplained_px * kUnexplained_px * s.gradient.squaredNorm();
        const double w = window(offset), weight = w / (noise + unexplained);
        n.H += weight * J * J.transpose();
        n.noise += w * weight * J * J.transpose();
        n.b += weight * residual * J;
        n.squares += weight * residual * residual;
        n.expected_squares += weight * (kSoftNoise * noise + unexplained);
        return true;
    }
    /// A pixel's weight, less towards the patch's edge.
    [[nodiscard]] double window(const Vector2d& offset) const {
        const double sigma = 0.5 * (patch_.radius_px + 0.5);
        return std::exp(-offset.squaredNorm() / (2 * sigma * sigma));
    }

    const Patch& patch_;
    const StereoView& here_;
    const EpipolarWarp& warp_;
    const StereoView& there_;
    double inverse_depth_, per_px_;
};

MeasuredImage softened(const MeasuredImage& image) {
    MeasuredImage out = image;
    cv::Mat pixels(image.height, image.width, CV_32F, out.dn.data());
    const cv::Matx13d kernel(kSoftNeighbour, kSoftMiddle, kSoftNeighbour);
    cv::sepFilter2D(pixels, pixels, CV_32F, kernel, kernel, {-1, -1}, 0, cv::BORDER_REPLICATE);
    return out;
}

}  // namespace

StereoView::StereoView(const Camera& c, const MeasuredImage& frame)
    : camera(c), sensor(sensor_model(c)), image(frame), soft(softened(frame)), spline(soft) {}

bool cut_patch(const StereoView& view, int u, int v, int radius_px, Patch& patch) {
    if (u < radius_px || v < radius_px || u >= view.image.width - radius_px || v >= view.image.height - radius_px)
        return false;
    patch.u = u, patch.v = v, patch.radius_px = radius_px;
    patch.dn.clear();
    for (int y = v - radius_px; y <= v + radius_px; ++y)
        for (int x = u - radius_px; x <= u + radius_px; ++x) {
            if (view.image.at(x, y) >= kFull * view.sensor.top_dn) return false;
            patch.dn.push_back(view.soft.at(x, y));
        }
    return true;
}

std::optional<WholePixelMatch> search_line(const Patch& patch, const EpipolarWarp& warp, const StereoView& there,
                                           const InverseDepths& range) {
    std::vector<LinePlace> candidates;
    const Vector3d ray = warp.ray(patch.centre_px());
    if (!warp.is_before(ray, range.low)) return {};
    const Vector2d first = warp.px(ray, range.low), along = warp.px_slope(ray, range.low);
    if (!(along.norm() > 0)) return {};
    // One pixel for each row or each column, whichever the line crosses more of.
    const int axis = std::abs(along.x()) >= std::abs(along.y()) ? 0 : 1;
    const double edge = axis == 0 ? there.image.width - 1 : there.image.height - 1;
    const double last =
        warp.is_before(ray, range.high) ? warp.px(ray, range.high)[axis] : std::copysign(edge + 1, along[axis]);
    const double from = std::round(std::min(first[axis], last)), to = std::round(std::max(first[axis], last));
    for (double c = std::max(from, 0.0); c <= std::min(to, edge); ++c) {
        const Vector2d px = first + (c - first[axis]) / along[axis] * along;
        const double rho = std::clamp(warp.inverse_depth_at(ray, axis, c), range.low, range.high);
        LinePlace place{px.array().round(), rho, 0};
        if (const auto match = correlation(patch, warp, there, place, kSearchStride)) {
            place.correlation = *match;
            candidates.push_back(place);
        }
    }
    if (candidates.empty()) return {};
    const double nearly =
        std::ranges::max_element(candidates, {}, &LinePlace::correlation)->correlation - kNearlyBest;
    for (LinePlace& c : candidates)
        if (c.correlation >= nearly) c.correlation = correlation(patch, warp, there, c, 1).value_or(-1);
    const auto best = std::ranges::max_element(candidates, {}, &LinePlace::correlation);
    double second = -1;
    for (const LinePlace& c : candidates)
        if ((c.px - best->px).lpNorm<Eigen::Infinity>() >= kApart_px) second = std::max(second, c.correlation);
    return WholePixelMatch{best->px, best->inverse_depth, best->correlation,
                           (1 - best->correlation + kAlike) / (1 - second + kAlike)};
}

std::optional<SubPixelMatch> fit_patch(const Patch& patch, const StereoView& here, const EpipolarWarp& warp,
                                       const StereoView& there, const WholePixelMatch& start) {
    const PatchFit fit(patch, here, warp, there, start.inverse_depth);
    const Vector2d px0 = fit.start_px();
    Vector p = Vector::Zero();
    p.head<2>() = start.px - px0, p[7] = 1;
    for (int iteration = 0; iteration <= kIterationsMax; ++iteration) {
        const auto n = fit.linearise(p);
        if (!n) return {};
        const Eigen::LDLT<Matrix9> factors(n->H);
        if (!factors.isPositive()) return {};
        const Vector step = factors.solve(n->b);
        if (!step.allFinite()) return {};
        if (step.head<2>().norm() < kSettled_px) {
            const Matrix9 C = factors.solve(factors.solve(n->noise).transpose());
            const double misfit = n->squares / n->expected_squares;
            return SubPixelMatch{px0 + p.head<2>(), std::max(1.0, misfit) * C.topLeftCorner<2, 2>(), misfit};
        }
        p += step;
        if ((px0 + p.head<2>() - start.px).norm() > kFarthest_px) return {};
    }
    return {};
}

}  // namespace narpa
