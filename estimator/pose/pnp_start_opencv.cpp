#include <opencv2/calib3d.hpp>

#include "estimator/pose/pnp_start.h"

namespace narpa {
namespace {

/// Of the plane z = 1.
const cv::Matx33d kUnitCamera = cv::Matx33d::eye();

struct OpencvPoints {
    std::vector<cv::Point3d> body_m;
    std::vector<cv::Point2d> seen;

    explicit OpencvPoints(std::span<const BodyPoint> points) {
        for (const BodyPoint& p : points) {
            body_m.emplace_back(p.body_m.x, p.body_m.y, p.body_m.z);
            seen.emplace_back(p.seen.u, p.seen.v);
        }
    }
};

void append(const std::vector<cv::Mat>& rotations, const std::vector<cv::Mat>& translations,
            std::vector<CentredPose>& out) {
    for (std::size_t i = 0; i < rotations.size(); ++i) {
        const auto r = rotations[i].ptr<double>(), t = translations[i].ptr<double>();
        const CentredPose pose{exp_rotation({r[0], r[1], r[2]}), {t[0], t[1], t[2]}};
        if (std::isfinite(norm(pose.q)) && is_finite(pose.centroid_m)) out.push_back(pose);
    }
}

/// OpenCV throws where a method cannot take the points: then it has no start.
template <class F>
void unless_refused(const F& f) {
    try {
        f();
    } catch (const cv::Exception&) {
    }
}

}  // namespace

void opencv_poses(std::span<const BodyPoint> points, bool flat, std::vector<CentredPose>& out) {
    const OpencvPoints p(points);
    std::vector<cv::Mat> rotations, translations;
    for (const auto method : {cv::SOLVEPNP_SQPNP, cv::SOLVEPNP_IPPE}) {
        if (method == cv::SOLVEPNP_IPPE && !flat) break;
        unless_refused([&] {
            cv::solvePnPGeneric(p.body_m, p.seen, kUnitCamera, cv::noArray(), rotations, translations, false,
                                method);
            append(rotations, translations, out);
        });
    }
}

void opencv_p3p(const std::array<BodyPoint, 3>& points, std::vector<CentredPose>& out) {
    const OpencvPoints p(points);
    std::vector<cv::Mat> rotations, translations;
    unless_refused([&] {
        cv::solveP3P(p.body_m, p.seen, kUnitCamera, cv::noArray(), rotations, translations, cv::SOLVEPNP_AP3P);
        append(rotations, translations, out);
    });
}

}  // namespace narpa
