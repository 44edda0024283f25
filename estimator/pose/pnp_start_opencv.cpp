#include <opencv2/calib3d.hpp>

#include "estimator/pose/pnp_start.h"

namespace narpa {
namespace {

cv::Mat camera_matrix(const Pinhole& c) {
    return (cv::Mat_<double>(3, 3) << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
}

void append(const std::vector<cv::Mat>& rotations, const std::vector<cv::Mat>& translations,
            std::vector<Rigid3>& out) {
    for (std::size_t i = 0; i < rotations.size(); ++i) {
        const auto r = rotations[i].ptr<double>(), t = translations[i].ptr<double>();
        const Rigid3 T{exp_rotation({r[0], r[1], r[2]}), {t[0], t[1], t[2]}};
        if (std::isfinite(norm(T.q)) && is_finite(T.t)) out.push_back(T);
    }
}

static_assert(sizeof(Vec3) == sizeof(cv::Point3d) && sizeof(Pixel) == sizeof(cv::Point2d));
/// OpenCV wants pointers to data that it may write, and does not write these.
cv::Mat as_mat(std::span<const Vec3> points) {
    return {static_cast<int>(points.size()), 1, CV_64FC3, const_cast<Vec3*>(points.data())};
}
cv::Mat as_mat(std::span<const Pixel> pixels) {
    return {static_cast<int>(pixels.size()), 1, CV_64FC2, const_cast<Pixel*>(pixels.data())};
}

/// OpenCV throws where a method cannot take the points: then there is no start.
template <class F>
void unless_refused(const F& f) {
    try {
        f();
    } catch (const cv::Exception&) {
    }
}

}  // namespace

void opencv_starts(const PnpInput& input, bool flat, std::vector<Rigid3>& out) {
    const cv::Mat K = camera_matrix(input.camera), points = as_mat(input.body_m), pixels = as_mat(input.pixels);
    std::vector<cv::Mat> rotations, translations;
    for (const auto method : {cv::SOLVEPNP_SQPNP, cv::SOLVEPNP_IPPE}) {
        if (method == cv::SOLVEPNP_IPPE && !flat) break;
        unless_refused([&] {
            cv::solvePnPGeneric(points, pixels, K, cv::noArray(), rotations, translations, false, method);
            append(rotations, translations, out);
        });
    }
}

void opencv_p3p(const Pinhole& camera, const std::array<Vec3, 3>& body_m, const std::array<Pixel, 3>& pixels,
                std::vector<Rigid3>& out) {
    std::vector<cv::Mat> rotations, translations;
    unless_refused([&] {
        cv::solveP3P(as_mat(body_m), as_mat(pixels), camera_matrix(camera), cv::noArray(), rotations, translations,
                     cv::SOLVEPNP_AP3P);
        append(rotations, translations, out);
    });
}

}  // namespace narpa
