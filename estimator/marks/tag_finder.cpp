#include "estimator/marks/tag_finder.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <optional>

namespace narpa {
namespace {

static_assert(cv::aruco::DICT_4X4_50 == 0 && cv::aruco::DICT_APRILTAG_36h11 == 20);

constexpr double kFromCorner = 0.12;   ///< part of a side at each end that is not used: the other side's edge
constexpr double kReach_px = 2.5;      ///< of a profile across the edge, to both sides
constexpr double kReachOfSide = 0.04;  ///< the same, at least: a part of the side's length
constexpr double kStep_px = 0.25;      ///< between points of a profile
constexpr int kFewestProfiles = 5;
constexpr double kEdgeOutlier = 3;  ///< standard deviations of edge points about their line
/// Standard deviation of an edge point that is always assumed: interpolation between pixels.
constexpr double kLeast_px = 0.02;

/// Eight bits, from the image's darkest to its brightest percentile.
cv::Mat eight_bits(const MeasuredImage& image) {
    std::vector<float> sorted = image.dn;
    const auto at = [&](double part) {
        const auto i = sorted.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(sorted.size() - 1));
        std::nth_element(sorted.begin(), i, sorted.end());
        return static_cast<double>(*i);
    };
    const double low = at(0.001), high = std::max(at(0.999), low + 1);
    cv::Mat out(image.height, image.width, CV_8U);
    for (std::size_t i = 0; i < image.dn.size(); ++i)
        out.data[i] =
            cv::saturate_cast<std::uint8_t>(255 * (static_cast<double>(image.dn[i]) - low) / (high - low));
    return out;
}

/// Bilinear between pixel centres; NaN outside.
double value_at(const MeasuredImage& image, double u, double v) {
    const double x = std::floor(u), y = std::floor(v);
    if (!(x >= 0 && y >= 0 && x + 1 < image.width && y + 1 < image.height)) return std::nan("");
    const int i = static_cast<int>(x), j = static_cast<int>(y);
    const double a = u - x, b = v - y;
    const auto dn = [&](int di, int dj) { return static_cast<double>(image.at(i + di, j + dj)); };
    return (1 - b) * ((1 - a) * dn(0, 0) + a * dn(1, 0)) + b * ((1 - a) * dn(0, 1) + a * dn(1, 1));
}

/// Distance of the edge from p along `outwards`, from dark to bright: where a step of the profile's range would
/// have the profile's area.
std::optional<double> edge_across(const MeasuredImage& image, const Pixel& p, const Pixel& outwards, double reach) {
    std::vector<double> profile;
    for (double d = -reach; d <= reach + 1e-9; d += kStep_px)
        profile.push_back(value_at(image, p.u + d * outwards.u, p.v + d * outwards.v));
    const std::size_t n = profile.size(), ends = std::max<std::size_t>(1, n / 6);
    double dark = 0, bright = 0, area = 0;
    for (std::size_t i = 0; i < ends; ++i)
        dark += profile[i] / double(ends), bright += profile[n - 1 - i] / double(ends);
    if (!(bright > dark)) return std::nullopt;  // or NaN
    for (std::size_t i = 0; i < n; ++i)
        area += (i == 0 || i == n - 1 ? 0.5 : 1) * kStep_px * (profile[i] - dark) / (bright - dark);
    const double length = kStep_px * static_cast<double>(n - 1), distance = length - area - reach;
    if (std::abs(distance) > reach) return std::nullopt;
    return distance;
}

/// The line through the edge between two corners, from edge points of profiles a pixel apart.
std::optional<TagSide> fit_side(const MeasuredImage& image, const Pixel& a, const Pixel& b) {
    const double length = std::hypot(b.u - a.u, b.v - a.v);
    const Pixel along{(b.u - a.u) / length, (b.v - a.v) / length}, across{along.v, -along.u};  // outwards, y down
    const double reach = std::max(kReach_px, kReachOfSide * length);
    std::vector<std::array<double, 2>> edge;  // along and across, from the middle
    const double middle = length / 2, half = (0.5 - kFromCorner) * length;
    const int profiles = static_cast<int>(2 * half);
    for (int i = 0; i <= profiles; ++i) {
        const double t = -half + 2 * half * i / std::max(1, profiles);
        const Pixel p{a.u + (middle + t) * along.u, a.v + (middle + t) * along.v};
        if (const auto d = edge_across(image, p, across, reach)) edge.push_back({t, *d});
    }
    double offset = 0, slope = 0, variance = 0;
    for (int round = 0; round < 3; ++round) {
        if (edge.size() < kFewestProfiles) return std::nullopt;
        const auto n = static_cast<double>(edge.size());
        double st = 0, sd = 0, stt = 0, std_ = 0;
        for (const auto& [t, d] : edge) st += t, sd += d, stt += t * t, std_ += t * d;
        slope = (n * std_ - st * sd) / (n * stt - st * st), offset = (sd - slope * st) / n;
        double squares = 0;
        for (const auto& [t, d] : edge) squares += std::pow(d - offset - slope * t, 2);
        variance = squares / (n - 2) + kLeast_px * kLeast_px;
        const double most = kEdgeOutlier * std::sqrt(variance);
        if (std::erase_if(edge, [&](const auto& e) { return std::abs(e[1] - offset - slope * e[0]) > most; }) == 0)
            break;
    }
    // Two points with independent errors of 2 s^2 / n have the variances of the line for n points evenly over its
    // length. On a slightly curved side they lie on the curve.
    TagSide side{.at = {}, .across = {}, .variance_px2 = 2 * variance / static_cast<double>(edge.size())};
    const double tilt = std::hypot(1, slope);
    side.across = {(across.u - slope * along.u) / tilt, (across.v - slope * along.v) / tilt};
    const auto parts = side_parts();
    for (std::size_t k = 0; k < 2; ++k) {
        const double t = (parts[k] - 0.5) * length, d = offset + slope * t;
        side.at[k] = {a.u + (middle + t) * along.u + d * across.u, a.v + (middle + t) * along.v + d * across.v};
    }
    return side;
}

}  // namespace

std::array<double, 2> side_parts() noexcept {
    const double off = (1 - 2 * kFromCorner) / std::sqrt(12.0);
    return {0.5 - off, 0.5 + off};
}

std::vector<FoundTag> find_tags(const MeasuredImage& image, int dictionary) {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
    const auto parameters = cv::aruco::DetectorParameters::create();
    parameters->cornerRefinementMethod = cv::aruco::CORNER_REFINE_SUBPIX;
    parameters->minMarkerPerimeterRate = 0.01;
    const auto known = cv::aruco::getPredefinedDictionary(dictionary);
    cv::aruco::detectMarkers(eight_bits(image), known, corners, ids, parameters);
    std::vector<FoundTag> tags;
    for (std::size_t i = 0; i < ids.size(); ++i) {
        FoundTag tag{ids[i], {}};
        bool complete = true;
        for (std::size_t k = 0; k < 4 && complete; ++k) {
            const cv::Point2f &a = corners[i][k], &b = corners[i][(k + 1) % 4];
            const auto side = fit_side(image, {double(a.x), double(a.y)}, {double(b.x), double(b.y)});
            if (side)
                tag.sides[k] = *side;
            else
                complete = false;
        }
        if (complete) tags.push_back(tag);
    }
    return tags;
}

}  // namespace narpa
