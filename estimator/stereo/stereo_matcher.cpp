#include "estimator/stereo/stereo_matcher.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

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
/// Least variance of a patch, in units of its noise.
constexpr double kMinContrast = 2;
/// Corners matched at once, by all threads.
constexpr std::size_t kCornersAtOnce = 256;

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
    if (s.patch_radius_px < 2 || s.patch_radius_px > 50 || s.points_max < 1 || s.grid_px < 0)
        return Error{"expected a patch radius of 2 .. 50 px, at least one point and a grid spacing >= 0"};
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

std::vector<cv::Point2f> grid(const MeasuredImage& image, int spacing_px) {
    std::vector<cv::Point2f> all;
    for (int v = 0; v < image.height; v += spacing_px)
        for (int u = 0; u < image.width; u += spacing_px)
            all.emplace_back(static_cast<float>(u), static_cast<float>(v));
    return all;
}

/// True if the patch varies by more than its noise.
bool has_contrast(const Patch& patch, const SensorModel& sensor) {
    double sum = 0, squares = 0;
    for (const double dn : patch.dn) sum += dn, squares += dn * dn;
    const auto n = static_cast<double>(patch.dn.size());
    const double mean = sum / n;
    return squares / n - mean * mean > kMinContrast * kSoftNoise * sensor.variance_dn2(mean);
}

/// The part of the range in which the ray, of z = 1, is within the sphere; nothing where there is none.
std::optional<InverseDepths> within(const StereoSphere& sphere, const Eigen::Vector3d& ray, InverseDepths range) {
    const Eigen::Vector3d c = to_eigen(sphere.centre_m);
    const double a = ray.squaredNorm(), b = ray.dot(c) / a;
    const double square = b * b - (c.squaredNorm() - sphere.radius_m * sphere.radius_m) / a;
    if (!(square > 0)) return {};
    const double first = b - std::sqrt(square), last = b + std::sqrt(square);
    if (!(last > 0)) return {};
    range.low = std::max(range.low, 1 / last);
    if (first > 0) range.high = std::min(range.high, 1 / first);
    if (!(range.low < range.high)) return {};
    return range;
}

/// Of a corner: what became of it, and the point if it was accepted.
struct TakenCorner {
    int StereoCounts::*outcome = &StereoCounts::cut_off;
    StereoPoint point;
};

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

    [[nodiscard]] TakenCorner take_corner(int u, int v) const {
        const Eigen::Vector3d direction = to_eigen(pair_.left.model->on_plane({1.0 * u, 1.0 * v}));
        std::optional<InverseDepths> range{{1 / settings_.farthest_m, 1 / settings_.nearest_m}};
        if (settings_.within) range = within(*settings_.within, direction, *range);
        if (!range) return {&StereoCounts::outside, {}};
        Patch patch;
        if (!cut_patch(left_, u, v, settings_.patch_radius_px, patch)) return {&StereoCounts::cut_off, {}};
        if (!has_contrast(patch, left_.sensor)) return {&StereoCounts::flat, {}};
        const auto whole = search_line(patch, there_, right_, *range);
        if (!whole) return {&StereoCounts::cut_off, {}};
        if (whole->correlation < kMinCorrelation) return {&StereoCounts::unlike, {}};
        if (whole->ambiguity > kMaxAmbiguity) return {&StereoCounts::ambiguous, {}};
        if (!is_consistent(patch, *whole, *range)) return {&StereoCounts::inconsistent, {}};
        const auto match = fit_patch(patch, left_, there_, right_, *whole);
        if (!match) return {&StereoCounts::unsettled, {}};
        StereoPoint p{patch.centre_px(), *whole, *match, {}};
        p.point = triangulate(pair_, exact_pixel(p.left_px), {match->px, match->covariance_px2});
        if (p.point.epipolar_sigmas > kFarthestOff_sigmas) return {&StereoCounts::off_line, {}};
        if (p.point.status != TriangulationStatus::good) return {&StereoCounts::without_depth, {}};
        const double depth_m = p.point.point_m.z();
        p.range_m_per_px = depth_m * depth_m * direction.norm() /
                           there_.px_slope(there_.ray(patch.centre_px()), 1 / depth_m).norm();
        return {&StereoCounts::accepted, p};
    }

private:
    static Pinhole pinhole(const Camera& camera) { return *camera.model->pinhole(); }

    /// Left-right consistency: the search from the right frame ends where it began in the left one.
    [[nodiscard]] bool is_consistent(const Patch& patch, const WholePixelMatch& whole,
                                     const InverseDepths& range) const {
        const Eigen::Vector3d ray = there_.ray(patch.centre_px());
        const double a = there_.inverse_depth_there(ray, range.low);
        const double b = there_.inverse_depth_there(ray, range.high);
        Patch right;
        if (!cut_patch(right_, static_cast<int>(whole.px.x()), static_cast<int>(whole.px.y()),
                       settings_.patch_radius_px, right))
            return false;
        const auto home = search_line(right, back_, left_, {std::min(a, b), std::max(a, b)});
        return home && (home->px - patch.centre_px()).norm() < kStereoRoundTrip_px;
    }

    const StereoPair& pair_;
    const StereoSettings& settings_;
    StereoView left_, right_;
    EpipolarWarp there_, back_;
};

}  // namespace

double StereoPoint::range_sigma_m() const {
    const Eigen::Vector3d along = point.point_m.normalized();
    return std::sqrt(along.dot(point.covariance_m2 * along));
}

PixelMeasurement exact_pixel(const Vector2d& px) {
    return {px, kExact_px * kExact_px * Eigen::Matrix2d::Identity()};
}

Result<StereoPoints> match_stereo(const StereoPair& pair, const MeasuredImage& left, const MeasuredImage& right,
                                  const StereoSettings& settings) {
    if (auto good = check(pair, left, right, settings); !good) return good.error();
    const StereoPair pinholes{as_pinhole(pair.left), as_pinhole(pair.right), pair.T_right_left};
    const MeasuredImage seen_left = through_pinhole(pair.left, left),
                        seen_right = through_pinhole(pair.right, right);
    const Matching matching(pinholes, seen_left, seen_right, settings);
    const bool of_grid = settings.grid_px > 0;
    const std::vector<cv::Point2f> places =
        of_grid ? grid(seen_left, settings.grid_px) : corners(seen_left, settings);
    StereoPoints out;
    std::vector<TakenCorner> taken;
    for (std::size_t first = 0; first < places.size(); first += taken.size()) {
        taken.assign(std::min(kCornersAtOnce, places.size() - first), {});
        tbb::parallel_for(std::size_t{0}, taken.size(), [&](std::size_t i) {
            const cv::Point2f& at = places[first + i];
            taken[i] = matching.take_corner(cvRound(at.x), cvRound(at.y));
        });
        for (const TakenCorner& t : taken) {
            ++(out.counts.*t.outcome);
            if (t.outcome == &StereoCounts::accepted) out.points.push_back(t.point);
            if (!of_grid && out.counts.accepted == settings.points_max) return out;
        }
    }
    return out;
}

std::string to_text(const StereoCounts& n) {
    constexpr std::array<std::pair<const char*, int StereoCounts::*>, 10> kOutcomes{
        {{"accepted", &StereoCounts::accepted},
         {"outside the sphere", &StereoCounts::outside},
         {"without contrast", &StereoCounts::flat},
         {"cut off or saturated", &StereoCounts::cut_off},
         {"unlike", &StereoCounts::unlike},
         {"ambiguous", &StereoCounts::ambiguous},
         {"inconsistent", &StereoCounts::inconsistent},
         {"not settled", &StereoCounts::unsettled},
         {"off the epipolar line", &StereoCounts::off_line},
         {"without depth", &StereoCounts::without_depth}}};
    std::string text;
    for (const auto& [name, count] : kOutcomes)
        if (n.*count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", n.*count, name);
    return text;
}

}  // namespace narpa
