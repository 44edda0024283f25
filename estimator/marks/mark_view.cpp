#include "estimator/marks/mark_view.h"

#include <cmath>

#include "base/constants.h"

namespace narpa {
namespace {

/// Least cosine between a disc's normal and the line of sight: flatter discs are thin lines in the image.
constexpr double kLeastCosine = 0.2;
constexpr int kRimPoints = 24;
constexpr double kLeastRadius_px = 0.45;  ///< smaller discs are single pixels, or none

/// The disc whose rim a camera sees, in camera axes. Of a sphere: where the lines of sight touch it.
struct SeenDisc {
    Vec3 centre_m, normal;
    double radius_m;
};
SeenDisc seen_disc(const Mark& mark, const Rigid3& T_camera_mark) {
    const Vec3 centre = T_camera_mark.t;
    if (!mark.is_spherical) return {centre, T_camera_mark.q * Vec3{0, 0, 1}, mark.radius_m};
    const double d = norm(centre), part = std::min(1.0, mark.radius_m / d);
    return {(1 - part * part) * centre, (-1 / d) * centre, mark.radius_m * std::sqrt(1 - part * part)};
}

}  // namespace

std::optional<DiscView> disc_view(const Mark& mark, const Rigid3& T_camera_body, const CameraModel& model) {
    if (mark.kind == Mark::Kind::tag) return std::nullopt;
    const Rigid3 T_camera_mark = T_camera_body * mark.T_body_mark;
    const auto centre = model.project(T_camera_mark.t);
    if (!centre) return std::nullopt;
    const SeenDisc disc = seen_disc(mark, T_camera_mark);
    if (dot(disc.normal, T_camera_mark.t) > -kLeastCosine * norm(T_camera_mark.t)) return std::nullopt;
    const Vec3 across = std::abs(disc.normal.x) < 0.7 ? Vec3{1, 0, 0} : Vec3{0, 1, 0};
    const Vec3 x = normalized(cross(disc.normal, across)), y = cross(disc.normal, x);
    std::array<ImagePoint, kRimPoints> rim;
    for (int k = 0; k < kRimPoints; ++k) {
        const double angle = 2 * kPi * k / kRimPoints;
        const auto p = model.project(disc.centre_m + disc.radius_m * (std::cos(angle) * x + std::sin(angle) * y));
        if (!p) return std::nullopt;
        rim[static_cast<std::size_t>(k)] = {p->x - centre->x, p->y - centre->y};
    }
    // Area and centroid of the polygon (Green's theorem).
    double area = 0, u = 0, v = 0;
    for (std::size_t k = 0; k < kRimPoints; ++k) {
        const ImagePoint &a = rim[k], &b = rim[(k + 1) % kRimPoints];
        const double twice = a.x * b.y - b.x * a.y;
        area += twice / 2, u += (a.x + b.x) * twice / 6, v += (a.y + b.y) * twice / 6;
    }
    if (!(std::abs(area) > 0)) return std::nullopt;
    return DiscView{.centre = {centre->x, centre->y},
                    .centroid = {centre->x + u / area, centre->y + v / area},
                    .radius_px = std::sqrt(std::abs(area) / kPi),
                    .area_px2 = std::abs(area)};
}

bool is_in_view(const DiscView& view, int width, int height) {
    const Pixel& p = view.centroid;
    return p.u > 0 && p.v > 0 && p.u < width - 1 && p.v < height - 1 && view.radius_px > kLeastRadius_px;
}

std::array<Vec3, 4> tag_corners(const Mark& mark) {
    const double h = mark.side_m / 2;
    return {mark.T_body_mark * Vec3{-h, h, 0}, mark.T_body_mark * Vec3{h, h, 0}, mark.T_body_mark * Vec3{h, -h, 0},
            mark.T_body_mark * Vec3{-h, -h, 0}};
}

}  // namespace narpa
