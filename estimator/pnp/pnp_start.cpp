#include "estimator/pnp/pnp_start.h"

#include <Eigen/Eigenvalues>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <vector>

namespace narpa {
namespace {

constexpr int kPerspectiveSteps = 6;
constexpr double kSettled = 1e-3;  // of the depth: the refinement does the rest
constexpr double kDiverged = 0.1;  // of the depth in the last step: diverges, as perspective is too strong

/// Scaled orthography of flat points: A / s is the upper left block of a rotation, whose singular values are 1 and
/// |cos of the tilt|. `sign` chooses which side is nearer.
struct ScaledRows {
    Vec3 r1, r2;
    double scale = 0;
};

ScaledRows flat_rows(const Vec3& a1, const Vec3& a2, double sign) {
    const double p = a1.x * a1.x + a1.y * a1.y, q = a2.x * a2.x + a2.y * a2.y, c = a1.x * a2.x + a1.y * a2.y;
    const double s2 = 0.5 * (p + q + std::hypot(p - q, 2 * c));
    // The third entries make both rows of length s and perpendicular.
    const double w1 = std::sqrt(std::max(0.0, s2 - p)), w2 = std::sqrt(std::max(0.0, s2 - q));
    const double scale = std::sqrt(s2);
    return {Vec3{a1.x, a1.y, sign * w1} / scale, Vec3{a2.x, a2.y, (c > 0 ? -sign : sign) * w2} / scale, scale};
}

ScaledRows solid_rows(const Vec3& a1, const Vec3& a2) {
    const double scale = 0.5 * (norm(a1) + norm(a2));
    Vec3 r1 = normalized(a1), r2 = normalized(a2);
    for (int i = 0; i < 2; ++i) {
        const double c = 0.5 * dot(r1, r2);
        const Vec3 both = r1;
        r1 = normalized(r1 - c * r2), r2 = normalized(r2 - c * both);
    }
    return {r1, r2, scale};
}

/// p: a point's coordinates along the axes of PointExtent.
struct AlongAxes {
    Vec3 p;
    Pixel seen;
};

bool posit(std::span<const BodyPoint> points, const PointExtent& spread, bool flat, double sign, CentredPose& out) {
    const double n = static_cast<double>(points.size());
    const Vec3 inverse{1 / (n * spread.rms_m.x * spread.rms_m.x), 1 / (n * spread.rms_m.y * spread.rms_m.y),
                       flat ? 0 : 1 / (n * spread.rms_m.z * spread.rms_m.z)};
    const auto along_axes = [&](const Vec3& a) {
        return Vec3{dot(spread.axis[0], a), dot(spread.axis[1], a), dot(spread.axis[2], a)};
    };
    Vec3 r3_over_z{};  // perspective: a point's depth is z (1 + r3 . p / z)
    Vec3 r1{}, r2{}, r3{}, t{};
    double moved = 0;  // in the last step, of the depth
    for (int step = 0; step < kPerspectiveSteps; ++step) {
        Vec3 a1{}, a2{};
        double mean_u = 0, mean_v = 0;
        for (const BodyPoint& point : points) {
            const Vec3 p = along_axes(point.body_m);
            const double depth = 1 + dot(r3_over_z, p);
            const double u = point.seen.u * depth, v = point.seen.v * depth;
            a1 += u * p, a2 += v * p;
            mean_u += u, mean_v += v;
        }
        const Vec3 row1 = a1 * inverse, row2 = a2 * inverse;
        const ScaledRows rows = flat ? flat_rows(row1, row2, sign) : solid_rows(row1, row2);
        if (!(rows.scale > 0) || !std::isfinite(rows.scale)) return false;
        r3 = normalized(cross(rows.r1, rows.r2));
        r1 = rows.r1, r2 = cross(r3, r1);
        t = Vec3{mean_u / n, mean_v / n, 1} / rows.scale;
        moved = norm(r3 * rows.scale - r3_over_z) * spread.rms_m.x;
        r3_over_z = r3 * rows.scale;
        if (moved < kSettled) break;
    }
    if (!(moved < kDiverged)) return false;
    const auto to_body = [&](const Vec3& r) {
        return r.x * spread.axis[0] + r.y * spread.axis[1] + r.z * spread.axis[2];
    };
    const Vec3 x = to_body(r1), y = to_body(r2), z = to_body(r3);
    out = {quat_from_columns({x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}), t};
    return std::isfinite(norm(out.q)) && is_finite(t);
}

}  // namespace

PointExtent extent_of(std::span<const BodyPoint> points) {
    Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
    for (const BodyPoint& p : points) {
        const Eigen::Vector3d a = to_eigen(p.body_m);
        M += a * a.transpose();
    }
    M /= static_cast<double>(points.size());
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(M);
    const Vec3 widest = to_vec3(eigen.eigenvectors().col(2)), middle = to_vec3(eigen.eigenvectors().col(1));
    const auto rms = [&](int i) { return std::sqrt(std::max(0.0, eigen.eigenvalues()[i])); };
    return {{widest, middle, cross(widest, middle)}, {rms(2), rms(1), rms(0)}};
}

InitialPoses orthographic_poses(std::span<const BodyPoint> points, const PointExtent& spread, bool flat) {
    InitialPoses starts;
    if (spread.is_a_line()) return starts;
    for (const double sign : {1.0, -1.0}) {
        if (posit(points, spread, flat, sign, starts.pose[starts.count])) ++starts.count;
        if (!flat) break;
    }
    return starts;
}

InitialPoses three_point_poses(std::array<BodyPoint, 3> points) {
    const Vec3 mean = (points[0].body_m + points[1].body_m + points[2].body_m) / 3.0;
    for (BodyPoint& p : points) p.body_m -= mean;
    InitialPoses starts = orthographic_poses(points, extent_of(points), true);
    for (std::size_t i = 0; i < starts.count; ++i) starts.pose[i].centroid_m -= starts.pose[i].q * mean;
    return starts;
}

CentredPose depth_reversed(const CentredPose& pose, const PointExtent& spread) {
    // Two reflections are a rotation by half a turn about each normal: q' = (0, sight) q (0, normal).
    const Vec3 sight = normalized(pose.centroid_m), normal = spread.axis[2];
    return {normalized(Quat{0, sight.x, sight.y, sight.z} * pose.q * Quat{0, normal.x, normal.y, normal.z}),
            pose.centroid_m};
}

std::optional<CentredPose> sqpnp_pose(std::span<const BodyPoint> points) {
    std::vector<cv::Point3d> body_m;
    std::vector<cv::Point2d> seen;
    for (const BodyPoint& p : points) {
        body_m.emplace_back(p.body_m.x, p.body_m.y, p.body_m.z);
        seen.emplace_back(p.seen.u, p.seen.v);
    }
    cv::Vec3d r, t;
    const cv::Matx33d plane_z_1 = cv::Matx33d::eye();
    try {
        if (!cv::solvePnP(body_m, seen, plane_z_1, cv::noArray(), r, t, false, cv::SOLVEPNP_SQPNP)) return {};
    } catch (const cv::Exception&) {  // it cannot take the points
        return {};
    }
    const CentredPose pose{exp_rotation({r[0], r[1], r[2]}), {t[0], t[1], t[2]}};
    if (!std::isfinite(norm(pose.q)) || !is_finite(pose.centroid_m)) return {};
    return pose;
}

}  // namespace narpa
