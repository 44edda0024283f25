#include "emulator/replay/image_compare.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

namespace narpa {
namespace {

constexpr int kWindow = 2;          // px each side of an edge's pixel
constexpr int kBesides = 2;         // px around a body that may hold some of its light
constexpr double kEdge = 1.0 / 16;  // of the full scale, a pixel

cv::Mat mean_bands(const RadianceImage& image, double full_scale) {
    cv::Mat out(image.height, image.width, CV_64F);
    std::transform(image.pixels.begin(), image.pixels.end(), out.begin<double>(),
                   [&](const Rgb& p) { return mean_band(vec_cast<double>(p)) / full_scale; });
    return out;
}

double mean_ssim(const cv::Mat& a, const cv::Mat& b) {
    const auto blurred = [](const cv::Mat& m) {
        cv::Mat out;
        cv::GaussianBlur(m, out, {11, 11}, 1.5);
        return out;
    };
    constexpr double c1 = 0.01 * 0.01, c2 = 0.03 * 0.03;
    const cv::Mat mean_a = blurred(a), mean_b = blurred(b);
    const cv::Mat aa = blurred(a.mul(a)) - mean_a.mul(mean_a), bb = blurred(b.mul(b)) - mean_b.mul(mean_b),
                  ab = blurred(a.mul(b)) - mean_a.mul(mean_b);
    const cv::Mat top = (2 * mean_a.mul(mean_b) + c1).mul(2 * ab + c2);
    const cv::Mat bottom = (mean_a.mul(mean_a) + mean_b.mul(mean_b) + c1).mul(aa + bb + c2);
    cv::Mat ratio;
    cv::divide(top, bottom, ratio);
    return cv::mean(ratio)[0];
}

/// Shifts of the picture's edges from the reference's, at pixels where the gradient has a maximum along its own
/// direction.
ShiftStatistics edge_shifts(const cv::Mat& picture, const cv::Mat& reference) {
    const int width = reference.cols, height = reference.rows;
    const auto slope = [&](int x, int y) {
        const auto at = [&](int column, int row) { return reference.at<double>(row, column); };
        return std::array<double, 2>{0.5 * (at(x + 1, y) - at(x - 1, y)), 0.5 * (at(x, y + 1) - at(x, y - 1))};
    };
    ShiftStatistics s;
    std::vector<double> sizes;
    double sum = 0, squares = 0;
    constexpr int border = kWindow + 1;
    for (int y = border; y < height - border; ++y)
        for (int x = border; x < width - border; ++x) {
            const auto [gx, gy] = slope(x, y);
            const double steepness = std::hypot(gx, gy);
            if (steepness < kEdge) continue;
            const double nx = gx / steepness, ny = gy / steepness;
            double along = 0, steep = 0;
            for (int v = y - kWindow; v <= y + kWindow; ++v)
                for (int u = x - kWindow; u <= x + kWindow; ++u) {
                    const auto [hx, hy] = slope(u, v);
                    const double h = hx * nx + hy * ny;
                    along -= (picture.at<double>(v, u) - reference.at<double>(v, u)) * h;
                    steep += h * h;
                }
            const double shift = along / steep;
            sizes.push_back(std::abs(shift));
            sum += shift;
            squares += shift * shift;
        }
    s.count = sizes.size();
    if (s.count > 0) {
        const auto p99 = sizes.begin() + static_cast<std::ptrdiff_t>(0.99 * static_cast<double>(s.count - 1));
        std::nth_element(sizes.begin(), p99, sizes.end());
        s.p99_px = *p99;
        s.mean_px = sum / static_cast<double>(s.count);
        s.rms_px = std::sqrt(squares / static_cast<double>(s.count));
    }
    return s;
}

/// For each body a mask of the pixels that hold its light and no other body's.
std::map<int, cv::Mat> masks_of(std::span<const std::int32_t> body, int width, int height) {
    const cv::Mat bodies(height, width, CV_32S, const_cast<std::int32_t*>(body.data()));
    const cv::Mat around = cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * kBesides + 1, 2 * kBesides + 1});
    std::map<int, cv::Mat> wide;
    for (const int b : std::set<int>(body.begin(), body.end()))
        if (b >= 0) cv::dilate(bodies == b, wide[b], around);
    std::map<int, cv::Mat> alone;
    for (const auto& [b, mask] : wide) {
        cv::Mat own = mask.clone();
        for (const auto& [other, theirs] : wide)
            if (other != b) own.setTo(0, theirs);
        alone[b] = own;
    }
    return alone;
}

/// Centroid of the light under the mask; none without light, or where the border cuts it.
std::optional<cv::Point2d> centre_of_light(const cv::Mat& image, const cv::Mat& mask) {
    cv::Mat light = cv::Mat::zeros(image.size(), CV_64F);
    image.copyTo(light, mask);
    const cv::Moments m = cv::moments(light);
    if (!(m.m00 > 0)) return std::nullopt;
    return cv::Point2d{m.m10 / m.m00, m.m01 / m.m00};
}

bool touches_border(const cv::Mat& mask) {
    return cv::countNonZero(mask.row(0)) + cv::countNonZero(mask.row(mask.rows - 1)) +
               cv::countNonZero(mask.col(0)) + cv::countNonZero(mask.col(mask.cols - 1)) >
           0;
}

}  // namespace

ImageDifference compare(const RadianceImage& picture, const RadianceImage& reference,
                        std::span<const std::int32_t> body, double full_scale) {
    const cv::Mat a = mean_bands(picture, full_scale), b = mean_bands(reference, full_scale);
    const cv::Mat difference = a - b;
    ImageDifference d;
    d.full_scale = full_scale;
    d.rmse = full_scale * std::sqrt(cv::mean(difference.mul(difference))[0]);
    d.bias = full_scale * cv::mean(difference)[0];
    d.ssim = mean_ssim(a, b);
    d.edges = edge_shifts(a, b);
    for (const auto& [index, mask] : masks_of(body, reference.width, reference.height)) {
        if (touches_border(mask)) continue;
        const auto ours = centre_of_light(a, mask), theirs = centre_of_light(b, mask);
        if (ours && theirs) d.bodies.push_back({index, ours->x - theirs->x, ours->y - theirs->y});
    }
    return d;
}

}  // namespace narpa
