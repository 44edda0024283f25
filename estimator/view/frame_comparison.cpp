#include "estimator/view/frame_comparison.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace narpa {
namespace {

/// Lit: above this part of what so many of the lit pixels exceed, and above so many standard deviations of noise.
constexpr double kLitPart = 0.1, kBrightPart = 0.01, kLitSigmas = 5;
/// The frame's black is its own where the render shows nothing in at least this part of the pixels.
constexpr double kEmptyPart = 0.01;

/// The value that this part of the largest `count` of them exceed.
double exceeded_by(double part, std::size_t count, std::vector<double> values) {
    count = std::min(count, values.size());
    if (count == 0) return 0;
    const auto place = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(count));
    std::nth_element(values.begin(), place, values.end(), std::greater<>());
    return *place;
}

struct Signals {
    std::vector<double> frame, render;  ///< DN above black
    std::vector<std::uint8_t> lit_frame, lit_render;
};

double black_of(const MeasuredImage& frame, const SensorModel& sensor, const std::vector<double>& render,
                std::span<const std::int32_t> body) {
    std::vector<double> background;
    for (std::size_t p = 0; p < render.size(); ++p)
        if (render[p] == 0 && body[p] < 0) background.push_back(static_cast<double>(frame.dn[p]));
    if (static_cast<double>(background.size()) < kEmptyPart * static_cast<double>(render.size()))
        return sensor.black_dn;
    return exceeded_by(0.5, background.size(), background);
}

std::vector<std::uint8_t> above(double least, const std::vector<double>& signal) {
    std::vector<std::uint8_t> out(signal.size());
    std::ranges::transform(signal, out.begin(), [least](double v) { return v > least; });
    return out;
}

/// The rectangle of what is lit, with a border of two pixels within the image.
cv::Rect extent(const std::vector<std::uint8_t>& lit, int width, int height) {
    int left = width, top = height, right = -1, bottom = -1;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            if (!lit[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)])
                continue;
            left = std::min(left, x), right = std::max(right, x), top = std::min(top, y), bottom = y;
        }
    left = std::max(0, left - 2), top = std::max(0, top - 2);
    return {left, top, std::min(width, right + 3) - left, std::min(height, bottom + 3) - top};
}

/// Of a parabola through three neighbouring values, from the middle one.
double peak(double before, double at, double after) {
    const double bend = before - 2 * at + after;
    return bend < 0 ? std::clamp(0.5 * (before - after) / bend, -0.5, 0.5) : 0;
}

/// `most`: of the render, where the frame clips.
void find_shift(const Signals& s, double most, int width, int height, FrameComparison& out) {
    const auto image = [&](const std::vector<double>& signal, double limit) {
        cv::Mat m(height, width, CV_32F);
        std::ranges::transform(signal, m.begin<float>(),
                               [limit](double v) { return static_cast<float>(std::min(v, limit)); });
        return m;
    };
    constexpr int kMost = kMostComparedShift_px;
    const cv::Rect box = extent(s.lit_render, width, height);
    cv::Mat wide, match;
    cv::copyMakeBorder(image(s.frame, INFINITY), wide, kMost, kMost, kMost, kMost, cv::BORDER_CONSTANT, 0);
    cv::matchTemplate(wide({box.x, box.y, box.width + 2 * kMost, box.height + 2 * kMost}),
                      image(s.render, most)(box), match, cv::TM_CCOEFF_NORMED);
    cv::Point best;
    cv::minMaxLoc(match, nullptr, &out.shifted_correlation, nullptr, &best);
    const auto at = [&](int x, int y) {
        return static_cast<double>(
            match.at<float>(std::clamp(y, 0, match.rows - 1), std::clamp(x, 0, match.cols - 1)));
    };
    out.shift_x_px = best.x - kMost + peak(at(best.x - 1, best.y), at(best.x, best.y), at(best.x + 1, best.y));
    out.shift_y_px = best.y - kMost + peak(at(best.x, best.y - 1), at(best.x, best.y), at(best.x, best.y + 1));
}

}  // namespace

Result<FrameComparison> compare_frame(const MeasuredImage& frame, const SensorModel& sensor,
                                      const RadianceImage& render, std::span<const std::int32_t> body,
                                      std::size_t target) {
    const auto is_clipped = [&](std::size_t p) { return !frame.clipped.empty() && frame.clipped[p] != 0; };
    FrameComparison out;
    Signals s;
    for (const Rgb& L : render.pixels) s.render.push_back(sensor.signal(L));
    out.black_dn = black_of(frame, sensor, s.render, body);
    std::size_t shown = 0;
    double light_frame = 0, light_render = 0;
    for (std::size_t p = 0; p < frame.dn.size(); ++p) {
        const bool of_another = body[p] >= 0 && static_cast<std::size_t>(body[p]) != target;
        s.frame.push_back(of_another ? 0 : static_cast<double>(frame.dn[p]) - out.black_dn);
        if (of_another) s.render[p] = 0;
        shown += s.render[p] > 0;
        if (is_clipped(p)) continue;
        light_frame += s.frame[p], light_render += s.render[p];
    }
    if (!(light_render > 0)) return Error{"the target is not lit in the render, expected a pose in view and light"};
    const double least = std::max(kLitPart * exceeded_by(kBrightPart, shown, s.frame),
                                  kLitSigmas * std::sqrt(sensor.variance_dn2(sensor.black_dn)));
    s.lit_frame = above(least, s.frame);
    if (std::ranges::count(s.lit_frame, 1) == 0 || !(light_frame > 0))
        return Error{"nothing is lit in the frame, expected the target"};
    s.lit_render = above(least * light_render / light_frame, s.render);

    double n = 0, f = 0, r = 0, ff = 0, fr = 0, rr = 0;
    std::vector<std::size_t> counted;
    for (std::size_t p = 0; p < s.frame.size(); ++p) {
        out.lit_frame += s.lit_frame[p], out.lit_render += s.lit_render[p];
        out.lit_both += s.lit_frame[p] && s.lit_render[p];
        if (is_clipped(p) || !(s.lit_frame[p] || s.lit_render[p])) continue;
        counted.push_back(p);
        n += 1, f += s.frame[p], r += s.render[p];
        ff += s.frame[p] * s.frame[p], fr += s.frame[p] * s.render[p], rr += s.render[p] * s.render[p];
    }
    if (!(rr > 0) || !(n > 1)) return Error{"all lit pixels of the frame are clipped, expected a shorter exposure"};
    out.gain = fr / rr;
    if (!(out.gain > 0)) return Error{"the frame is dark where the render is lit, expected the target nearer by"};
    out.mean_dn = f / n;
    out.correlation = (n * fr - f * r) / std::sqrt(std::max((n * ff - f * f) * (n * rr - r * r), 1e-300));
    double squares = 0, over_noise = 0;
    for (const std::size_t p : counted) {
        const double residual = s.frame[p] - out.gain * s.render[p];
        squares += residual * residual;
        over_noise += residual * residual / sensor.variance_dn2(sensor.black_dn + out.gain * s.render[p]);
    }
    out.residual_dn = std::sqrt(squares / n);
    if (sensor.read_dn2 > 0 || sensor.shot_dn > 0) out.residual_noise = std::sqrt(over_noise / n);
    find_shift(s, (sensor.top_dn - out.black_dn) / out.gain, frame.width, frame.height, out);
    return out;
}

}  // namespace narpa
