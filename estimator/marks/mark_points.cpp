#include "estimator/marks/mark_points.h"

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "estimator/marks/mark_matcher.h"

namespace narpa {
namespace {

/// Variance of an image point by errors of the lens and of the marks' places, for a scatter of one, px^2.
constexpr double kPlace_px2 = 0.07 * 0.07;
constexpr double kAlongSide_px2 = 1e6;  ///< a side does not say where along it a point lies
/// Blob::mixed over a sixth of the rim's length, in images that integrate over pixels (docking scene, 64 samples a
/// pixel).
constexpr double kMixedOfMeans = 0.8;

}  // namespace

void MarkPoints::add_disc(const Mark& mark, const Blob& blob, const DiscView& view) {
    const double beyond = variance_of_disc(view.radius_px) + kPlace_px2;
    points_.push_back(
        {.mark = &mark,
         .body_m = mark.T_body_mark.t,
         .seen = {blob.at.u - view.centroid.u + view.centre.u, blob.at.v - view.centroid.v + view.centre.v},
         .noise = blob.noise,
         .beyond = {beyond, 0, beyond},
         .numbers = 2});
    mixed_ += blob.mixed, rim_px_ += 2 * kPi * view.radius_px;
}

void MarkPoints::add_tag(const Mark& mark, const FoundTag& tag) {
    const auto corners = tag_corners(mark);
    for (std::size_t k = 0; k < 4; ++k) {
        const TagSide& side = tag.sides[k];
        const auto [nu, nv] = side.across;
        const auto covariance = [nu = nu, nv = nv](double across, double along) {
            return PixelCovariance{across * nu * nu + along * nv * nv, (across - along) * nu * nv,
                                   across * nv * nv + along * nu * nu};
        };
        for (std::size_t i = 0; i < 2; ++i) {
            const Vec3 &a = corners[k], &b = corners[(k + 1) % 4];
            points_.push_back({.mark = &mark,
                               .body_m = a + side_parts()[i] * (b - a),
                               .seen = side.at[i],
                               .noise = covariance(side.variance_px2, kAlongSide_px2),
                               .beyond = covariance(kPlace_px2, 0),
                               .numbers = 1});
        }
    }
}

void MarkPoints::remove(const Mark& mark) {
    std::erase_if(points_, [&](const MarkPoint& p) { return p.mark == &mark; });
}

int MarkPoints::numbers() const {
    int sum = 0;
    for (const MarkPoint& p : points_) sum += p.numbers;
    return sum;
}

std::vector<const Mark*> MarkPoints::marks() const {
    std::vector<const Mark*> marks;
    for (const MarkPoint& p : points_)
        if (std::ranges::find(marks, p.mark) == marks.end()) marks.push_back(p.mark);
    return marks;
}

std::vector<PixelCovariance> MarkPoints::covariances(double scatter) const {
    std::vector<PixelCovariance> all;
    for (const MarkPoint& p : points_)
        all.push_back({p.noise.uu + scatter * p.beyond.uu, p.noise.uv + scatter * p.beyond.uv,
                       p.noise.vv + scatter * p.beyond.vv});
    return all;
}

double MarkPoints::undersampled() const {
    return rim_px_ > 0 ? std::clamp(1 - 6 * mixed_ / (kMixedOfMeans * rim_px_), 0.0, 1.0) : 0;
}

}  // namespace narpa
