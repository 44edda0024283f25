#include "estimator/view/frame_comparison.h"

#include <fmt/format.h>
#include <cassert>

#include <algorithm>
#include <cmath>
#include <functional>

namespace narpa {
namespace {

/// A pixel is lit if its signal is above 10 % of the 99th percentile and above five standard deviations of noise.
constexpr double kLitPart = 0.1, kBrightPart = 0.01, kLitSigmas = 5;
constexpr double kBeyondNoiseSigmas = 4;
/// The black level is taken from the frame if the render is empty in at least this part of the pixels.
constexpr double kEmptyPart = 0.01;
/// Variances below this part of the squares are rounding.
constexpr double kUniform = 1e-12;
/// Rounds of the light ratio, each without the pixels that are too bright for the frame.
constexpr int kGainRounds = 4;

/// The value exceeded by this part of the `count` largest values.
double exceeded_by(double part, std::size_t count, std::vector<double> values) {
    count = std::min(count, values.size());
    if (count == 0) return 0;
    const auto place = values.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(count));
    std::nth_element(values.begin(), place, values.end(), std::greater<>());
    return *place;
}

/// DN are rounded, so that their median is off by up to half a step: it only serves to select background pixels.
double black_of(const MeasuredImage& frame, const SensorModel& sensor, const ExpectedFrame& render) {
    if (!render.knows_background) return sensor.black_dn;
    std::vector<double> background;
    for (std::size_t p = 0; p < frame.dn.size(); ++p)
        if (render.signal[p] == 0 && render.body[p] < 0) background.push_back(static_cast<double>(frame.dn[p]));
    if (static_cast<double>(background.size()) < kEmptyPart * static_cast<double>(frame.dn.size()))
        return sensor.black_dn;
    const double median = exceeded_by(0.5, background.size(), background);
    const double most =
        std::sqrt(12 * sensor.rounding_dn2) + kLitSigmas * std::sqrt(sensor.variance_dn2(sensor.black_dn));
    double sum = 0, n = 0;
    for (const double dn : background)
        if (std::abs(dn - median) <= most) sum += dn, n += 1;
    return sum / n;
}

struct Signals {
    std::vector<double> frame, render;  ///< DN above black
    std::vector<std::uint8_t> lit_frame, lit_render;
};

std::vector<std::uint8_t> above(double least, const std::vector<double>& signal) {
    std::vector<std::uint8_t> out(signal.size());
    std::ranges::transform(signal, out.begin(), [least](double v) { return v > least; });
    return out;
}

/// Ratio of the frame's light to the render's in the usable pixels that either lights, up to `most` DN.
double light_ratio(const Signals& s, const std::vector<std::uint8_t>& usable, double most) {
    double gain = 0, limit = INFINITY;
    for (int round = 0; round < kGainRounds; ++round) {
        double frame = 0, render = 0;
        for (std::size_t p = 0; p < s.frame.size(); ++p) {
            if (!usable[p] || !(s.render[p] > 0 || s.lit_frame[p]) || s.render[p] > limit) continue;
            frame += s.frame[p], render += s.render[p];
        }
        if (!(frame > 0) || !(render > 0)) return gain;
        gain = frame / render, limit = most / gain;
    }
    return gain;
}

/// Variance of frame - gain * render at pixel p: of the sensor, and of the samples of both.
double difference_variance(const Signals& s, std::size_t p, const SensorModel& sensor, const ExpectedFrame& render,
                           double gain) {
    const double of_samples = render.variance.empty() ? 0 : gain * gain * static_cast<double>(render.variance[p]);
    return sensor.variance_dn2(sensor.black_dn + gain * s.render[p]) +
           of_samples * (1 + render.frame_variance_ratio);
}

std::size_t lit_one_beyond_noise(const Signals& s, const SensorModel& sensor, const ExpectedFrame& render,
                                 double gain) {
    std::size_t n = 0;
    for (std::size_t p = 0; p < s.frame.size(); ++p) {
        if (s.lit_frame[p] == s.lit_render[p]) continue;
        const double difference = s.frame[p] - gain * s.render[p];
        n += difference * difference >
             kBeyondNoiseSigmas * kBeyondNoiseSigmas * difference_variance(s, p, sensor, render, gain);
    }
    return n;
}

/// Compares the brightness in these pixels.
void compare_brightness(const Signals& s, const std::vector<std::size_t>& pixels, const SensorModel& sensor,
                        const ExpectedFrame& render, FrameComparison& out) {
    double n = 0, f = 0, r = 0, ff = 0, fr = 0, rr = 0;
    for (const std::size_t p : pixels) {
        n += 1, f += s.frame[p], r += s.render[p];
        ff += s.frame[p] * s.frame[p], fr += s.frame[p] * s.render[p], rr += s.render[p] * s.render[p];
    }
    out.gain = f / r, out.mean_dn = f / n;
    const double spread_f = n * ff - f * f, spread_r = n * rr - r * r;
    if (spread_f > kUniform * n * ff && spread_r > kUniform * n * rr)
        out.correlation = (n * fr - f * r) / std::sqrt(spread_f * spread_r);
    double squares = 0, over_noise = 0;
    for (const std::size_t p : pixels) {
        const double residual = s.frame[p] - out.gain * s.render[p];
        squares += residual * residual;
        over_noise += residual * residual / difference_variance(s, p, sensor, render, out.gain);
    }
    out.residual_dn = std::sqrt(squares / n);
    if (sensor.read_dn2 > 0 || sensor.shot_dn > 0) out.residual_noise = std::sqrt(over_noise / n);
}

}  // namespace

Result<FrameComparison> compare_frame(const MeasuredImage& frame, const SensorModel& sensor,
                                      const ExpectedFrame& render, std::size_t target) {
    assert(render.signal.size() == frame.dn.size() && render.body.size() == frame.dn.size());
    assert(render.variance.empty() || render.variance.size() == frame.dn.size());
    FrameComparison out;
    Signals s;
    out.black_dn = black_of(frame, sensor, render);
    std::size_t shown = 0;
    for (std::size_t p = 0; p < frame.dn.size(); ++p) {
        const bool of_another =
            render.body[p] >= 0 ? static_cast<std::size_t>(render.body[p]) != target : !render.knows_background;
        const bool is_clipped = !frame.clipped.empty() && frame.clipped[p] != 0;
        s.frame.push_back(of_another ? 0 : static_cast<double>(frame.dn[p]) - out.black_dn);
        s.render.push_back(of_another ? 0 : static_cast<double>(render.signal[p]));
        out.usable.push_back(!of_another && !is_clipped);
        shown += s.render.back() > 0;
    }
    if (shown < kFewestLit)
        return Error{
            fmt::format("the render shows the target lit in {} pixels, expected at least {}: see the poses "
                        "and the light",
                        shown, kFewestLit)};
    const double least = std::max(kLitPart * exceeded_by(kBrightPart, shown, s.frame),
                                  kLitSigmas * std::sqrt(sensor.variance_dn2(sensor.black_dn)));
    s.lit_frame = above(least, s.frame);
    out.lit_frame = static_cast<std::size_t>(std::ranges::count(s.lit_frame, 1));
    if (out.lit_frame == 0) return Error{"nothing in it is brighter than its background, expected the target"};
    const double brightest = sensor.top_dn - out.black_dn, gain = light_ratio(s, out.usable, brightest);
    s.lit_render = above(gain > 0 ? least / gain : 0, s.render);
    std::vector<std::size_t> counted;
    for (std::size_t p = 0; p < s.frame.size(); ++p) {
        out.lit_render += s.lit_render[p], out.lit_both += s.lit_frame[p] && s.lit_render[p];
        if (gain * s.render[p] > brightest) out.usable[p] = 0;
        if (out.usable[p] && (s.lit_frame[p] || s.lit_render[p])) counted.push_back(p);
    }
    if (counted.size() < kFewestLit)
        return Error{fmt::format("{} of its lit pixels are not clipped, expected at least {}: a shorter exposure",
                                 counted.size(), kFewestLit)};
    out.lit_one_beyond_noise = lit_one_beyond_noise(s, sensor, render, gain);
    compare_brightness(s, counted, sensor, render, out);
    if (out.lit_render == 0 || !(out.gain > 0) || !std::isfinite(out.gain))
        return Error{
            "it is dark where the render is lit, or lit where the render is dark: expected the target there"};
    std::vector<double> shown_by_frame = s.render;  // clipped as the frame is
    for (double& signal : shown_by_frame) signal = std::min(signal, brightest / out.gain);
    out.shift = find_shift({s.frame, shown_by_frame, s.lit_render, frame.width, frame.height});
    return out;
}

}  // namespace narpa
