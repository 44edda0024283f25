#include "estimator/stereo/stereo_matcher.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <string>

namespace narpa {
namespace {

using Eigen::Vector2d;

/// Eigenvalue of the weakest corner over that of the strongest; block size of corners, px.
constexpr double kMinStrength = 1e-4;
constexpr int kCornerBlock_px = 5, kCornersPerPoint = 10;
constexpr int kCornersApart_px = 12;
/// Standard deviation of an exact pixel: small beside any match, large beside rounding.
constexpr double kExact_px = 1e-4;
/// Largest left-right-left error of the whole-pixel search.
constexpr double kStereoRoundTrip_px = 1.5;

Status check(const StereoPair& pair, const MeasuredImage& left, const MeasuredImage& right,
             const StereoSettings& s) {
    if (auto good = check_image(pair.left, left, "the left frame"); !good) return good;
    if (auto good = check_image(pair.right, right, "the right frame"); !good) return good;
    const PixelMeasurement somewhere = exact_pixel({0, 0});
    if (triangulate(pair, somewhere, somewhere).status == TriangulationStatus::bad_input)
        return Error{
            "a stereo pair with no focal length or a pose that is not one, expected finite numbers and a unit "
            "quaternion"};
    if (norm(pair.T_right_left.t) == 0) return Error{"a stereo pair without a baseline, expected two places"};
    if (!(s.nearest_m > 0 && s.farthest_m > s.nearest_m))
        return Error{"depths from " + std::to_string(s.nearest_m) + " to " + std::to_string(s.farthest_m) +
                     " m, expected 0 < nearest < farthest"};
    if (s.patch_radius_px < 2 || s.patch_radius_px > 50 || s.points_max < 1)
        return Error{"expected a patch radius of 2 .. 50 px and at least one point"};
    return Ok{};
}

Camera as_pinhole(Camera camera) {
    camera.model = std::make_shared<const Pinhole>(paraxial_pinhole(*camera.model));
    return camera;
}

/// The image as as_pinhole(camera) would have taken it. Pixels outside the frame are marked as saturated, so that
/// no patch is cut there.
MeasuredImage through_pinhole(const Camera& camera, const MeasuredImage& image) {
    const CameraModel& lens = *camera.model;
    if (lens.pinhole() != nullptr) return image;
    const Pinhole pinhole = paraxial_pinhole(lens);
    cv::Mat x(image.height, image.width, CV_32F), y(image.height, image.width, CV_32F);
    for (int v = 0; v < image.height; ++v)
        for (int u = 0; u < image.width; ++u) {
            const auto p = lens.project(pinhole.direction({1.0 * u, 1.0 * v}));
            x.at<float>(v, u) = p ? static_cast<float>(p->x) : -1e4F;
            y.at<float>(v, u) = p ? static_cast<float>(p->y) : -1e4F;
        }
    const double saturated = sensor_model(camera).top_dn;
    MeasuredImage out = image;
    cv::Mat to(image.height, image.width, CV_32F, out.dn.data());
    cv::remap(cv::Mat(image.height, image.width, CV_32F, const_cast<float*>(image.dn.data())), to, x, y,
              cv::INTER_CUBIC, cv::BORDER_CONSTANT, saturated);
    return out;
}

std::vector<cv::Point2f> corners(const MeasuredImage& image, const StereoSettings& settings) {
    const cv::Mat pixels(image.height, image.width, CV_32F, const_cast<float*>(image.dn.data()));
    std::vector<cv::Point2f> found;
    cv::goodFeaturesToTrack(pixels, found, kCornersPerPoint * settings.points_max, kMinStrength, kCornersApart_px,
                            {}, kCornerBlock_px);
    return found;
}

class Matching {
public:
    Matching(const StereoPair& pair, const MeasuredImage& left, const MeasuredImage& right,
             const StereoSettings& settings)
        : pair_(pair),
          settings_(settings),
          left_(pair.left, left),
          right_(pair.right, right),
          there_(pinhole(pair.left), pinhole(pair.right), pair.T_right_left),
          back_(pinhole(pair.right), pinhole(pair.left), inverse(pair.T_right_left)) {}

    void take_corner(int u, int v, StereoPoints& out) {
        StereoCounts& n = out.counts;
        if (!cut_patch(left_, u, v, settings_.patch_radius_px, patch_)) return void(++n.cut_off);
        const InverseDepths range{1 / settings_.farthest_m, 1 / settings_.nearest_m};
        const auto whole = search_line(patch_, there_, right_, range);
        if (!whole) return void(++n.cut_off);
        if (whole->correlation < kMinCorrelation) return void(++n.unlike);
        if (whole->ambiguity > kMaxAmbiguity) return void(++n.ambiguous);
        if (!is_consistent(*whole, range)) return void(++n.inconsistent);
        const auto match = fit_patch(patch_, left_, there_, right_, *whole);
        if (!match) return void(++n.unsettled);
        StereoPoint p{patch_.centre_px(), *whole, *match, {}};
        p.point = triangulate(pair_, exact_pixel(p.left_px), {match->px, match->covariance_px2});
        if (p.point.epipolar_sigmas > kFarthestOff_sigmas) return void(++n.off_line);
        if (p.point.status != TriangulationStatus::good) return void(++n.without_depth);
        ++n.accepted;
        out.points.push_back(p);
    }

private:
    static Pinhole pinhole(const Camera& camera) { return *camera.model->pinhole(); }

    /// Left-right consistency: the search from the right frame ends where it began in the left one.
    bool is_consistent(const WholePixelMatch& whole, const InverseDepths& range) {
        const Eigen::Vector3d ray = there_.ray(patch_.centre_px());
        const double a = there_.inverse_depth_there(ray, range.low);
        const double b = there_.inverse_depth_there(ray, range.high);
        if (!cut_patch(right_, static_cast<int>(whole.px.x()), static_cast<int>(whole.px.y()),
                       settings_.patch_radius_px, right_patch_))
            return false;
        const auto home = search_line(right_patch_, back_, left_, {std::min(a, b), std::max(a, b)});
        return home && (home->px - patch_.centre_px()).norm() < kStereoRoundTrip_px;
    }

    const StereoPair& pair_;
    const StereoSettings& settings_;
    StereoView left_, right_;
    EpipolarWarp there_, back_;
    Patch patch_, right_patch_;
};

}  // namespace

PixelMeasurement exact_pixel(const Vector2d& px) {
    return {px, kExact_px * kExact_px * Eigen::Matrix2d::Identity()};
}

Result<StereoPoints> match_stereo(const StereoPair& pair, const MeasuredImage& left, const MeasuredImage& right,
                                  const StereoSettings& settings) {
    if (auto good = check(pair, left, right, settings); !good) return good.error();
    const StereoPair pinholes{as_pinhole(pair.left), as_pinhole(pair.right), pair.T_right_left};
    const MeasuredImage seen_left = through_pinhole(pair.left, left),
                        seen_right = through_pinhole(pair.right, right);
    Matching matching(pinholes, seen_left, seen_right, settings);
    StereoPoints out;
    for (const cv::Point2f& corner : corners(seen_left, settings)) {
        if (out.counts.accepted == settings.points_max) break;
        matching.take_corner(cvRound(corner.x), cvRound(corner.y), out);
    }
    return out;
}

}  // namespace narpa
