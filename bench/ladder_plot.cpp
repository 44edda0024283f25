#include "bench/ladder_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "emulator/log/plot.h"

namespace narpa {
namespace {

using namespace plot;

constexpr int kColumns = 3, kColumnWidth = 560, kHeader = 96;
constexpr int kLeft = 92, kTop = 40, kWidth = 400, kHeight = 320;
constexpr int kBars = kTop + kHeight + 60, kBar = 14, kBarStep = 19;  // below a panel's corner; height, step
constexpr double kSmall = 0.42;

const cv::Scalar kLoopColour{110, 110, 110}, kFixedColour{176, 96, 16}, kAdaptiveColour{30, 80, 210};

/// Parts of a frame's time as the bars show them: the phases of the radiance, then detector and conversion.
constexpr std::size_t kParts = kPhases + 1;
const std::array<cv::Scalar, kParts> kPartColours{
    {{190, 190, 120}, {176, 96, 16}, {60, 160, 60}, {120, 60, 20}, {30, 80, 210}, {170, 170, 170}, {60, 190, 235}}};

struct Kind {
    const char* name;
    cv::Scalar colour;
    bool loop, adaptive;
};
const std::array<Kind, 3> kKinds{{{"plain loop, fixed spp", kLoopColour, true, false},
                                  {"narpa, fixed spp", kFixedColour, false, false},
                                  {"narpa, budget in rays/px", kAdaptiveColour, false, true}}};

std::vector<const Rung*> rungs_of(const Ladder& ladder, const Kind& kind) {
    std::vector<const Rung*> rungs;
    for (const Rung& r : ladder.rungs)
        if (r.loop == kind.loop && r.adaptive == kind.adaptive && r.rmse.value > 0) rungs.push_back(&r);
    return rungs;
}

/// "16" of "loop 16 spp".
std::string number_in(const std::string& name) {
    const auto first = name.find_first_of("0123456789");
    return name.substr(first, name.find_first_not_of("0123456789.", first) - first);
}

struct Panel {
    const SceneLadder& scene;
    cv::Point at;  ///< top left corner
    [[nodiscard]] double x_of(const Rung& r) const { return 1e3 * r.median_s(); }
    [[nodiscard]] double percent(double radiance) const { return 100 * radiance / scene.ladder.level; }
};

void draw_kind(cv::Mat& image, const Panel& panel, const Kind& kind, const Axis& x, const Axis& y) {
    const std::vector<const Rung*> rungs = rungs_of(panel.scene.ladder, kind);
    const auto point = [&](const Rung& r, double radiance) {
        return cv::Point2d{x.at(panel.x_of(r)), y.at(panel.percent(radiance))};
    };
    for (std::size_t i = 1; i < rungs.size(); ++i) {
        const Rung &a = *rungs[i - 1], &b = *rungs[i];
        line(image, point(a, a.rmse.value), point(b, b.rmse.value), kind.colour, 2);
        if (a.predicted.value_or(0) > 0 && b.predicted.value_or(0) > 0)
            line(image, point(a, *a.predicted), point(b, *b.predicted), kind.colour, 1);
    }
    for (const Rung* r : rungs) {
        const cv::Point2d at = point(*r, r->rmse.value);
        dot(image, at, 4, kind.colour);
        if (!r->knows_its_error()) dot(image, at, 2, cv::Scalar::all(255));
        const bool below = kind.adaptive;  // its curve lies on the left of the others
        const cv::Point shift = below ? cv::Point{-7, 15} : cv::Point{4, -8};
        text(image, number_in(r->name), cv::Point(at) + shift, kSmall, below ? 1 : 0, kind.colour);
    }
}

void draw_errors(cv::Mat& image, const Panel& panel) {
    std::vector<double> xs, ys;
    for (const Rung& r : panel.scene.ladder.rungs) {
        if (r.rmse.value <= 0) continue;
        xs.push_back(panel.x_of(r));
        ys.push_back(panel.percent(r.rmse.value));
        if (r.predicted.value_or(0) > 0) ys.push_back(panel.percent(*r.predicted));
    }
    const cv::Rect frame{panel.at.x + kLeft, panel.at.y + kTop, kWidth, kHeight};
    text(image, fmt::format("{}, {} x {}", panel.scene.scene, panel.scene.width, panel.scene.height),
         {frame.x + frame.width / 2, frame.y - 12}, kTitleSize, 0.5, kInk);
    if (xs.empty()) return;
    const Axis x = logarithmic_axis(xs, frame.x, frame.x + frame.width);
    const Axis y = logarithmic_axis(ys, frame.y + frame.height, frame.y);
    for (const double v : x.ticks()) vertical_tick(image, x, y, v);
    for (const double v : y.ticks()) horizontal_tick(image, y, x, v, fmt::format("{:g}", v));
    text(image, "ms per frame", {frame.x + frame.width / 2, frame.y + frame.height + 42}, kTextSize, 0.5, kInk);
    text(image, "RMSE, %", {frame.x - 8, frame.y - 12}, kTextSize, 1, kInk);
    cv::rectangle(image, frame, kInk, 1);
    for (const Kind& kind : kKinds) draw_kind(image, panel, kind, x, y);
    int row = frame.y + 20;  // where no curve goes
    for (const Kind& kind : {kKinds[2], kKinds[1]})
        if (const auto s = speed_ups(panel.scene.ladder, kind.adaptive)) {
            text(image, fmt::format("{:.2f} x the loop's speed ({:.2f} to {:.2f})", s->median, s->least, s->most),
                 {frame.x + frame.width - 10, row}, kSmall, 1, kind.colour);
            row += 18;
        }
}

/// In parts of the whole frame; none where it was not timed.
std::array<double, kParts> parts_of(const Rung& r, double detector_s) {
    std::array<double, kParts> parts{};
    const auto phases = static_cast<double>(std::accumulate(r.phase_ns.begin(), r.phase_ns.end(), std::int64_t{0}));
    if (phases <= 0) return parts;
    const double frame_s = r.median_s() + detector_s;
    for (std::size_t k = 0; k < kPhases; ++k)
        parts[k] = static_cast<double>(r.phase_ns[k]) / phases * r.median_s() / frame_s;
    parts[kPhases] = detector_s / frame_s;
    return parts;
}

void draw_bars(cv::Mat& image, const Panel& panel) {
    const int left = panel.at.x + kLeft;
    int top = panel.at.y + kBars;
    for (const Rung& r : panel.scene.ladder.rungs) {
        if (r.loop) continue;
        text(image, r.name, {left - 8, top + kBar - 2}, kSmall, 1, r.adaptive ? kAdaptiveColour : kFixedColour);
        double from = 0;
        const std::array<double, kParts> parts = parts_of(r, panel.scene.ladder.detector_s);
        for (std::size_t k = 0; k < kParts; ++k) {
            const double to = from + parts[k];
            const cv::Point a{left + cvRound(from * kWidth), top}, b{left + cvRound(to * kWidth), top + kBar};
            if (b.x > a.x) cv::rectangle(image, a, b, kPartColours[k], cv::FILLED);
            from = to;
        }
        text(image, fmt::format("{:.3g} ms", 1e3 * (r.median_s() + panel.scene.ladder.detector_s)),
             {left + kWidth + 8, top + kBar - 2}, kSmall, 0, kInk);
        top += kBarStep;
    }
}

/// Room for the panel with the most bars.
int row_height(std::span<const SceneLadder> scenes) {
    std::ptrdiff_t bars = 0;
    for (const SceneLadder& s : scenes)
        bars = std::max(bars, std::ranges::count(s.ladder.rungs, false, &Rung::loop));
    return kBars + static_cast<int>(bars) * kBarStep + 20;
}

std::string part_name(std::size_t k) {
    std::string name = k < kPhases ? kPhaseNames[k] : "detector and conversion";
    std::replace(name.begin(), name.end(), '_', ' ');
    return name;
}

void draw_legend(cv::Mat& image) {
    int x = 40;
    const auto entry = [&](int y, const std::string& name, auto&& sign) {
        sign(cv::Point2d(x, y));
        text(image, name, {x + 34, y}, kTextSize, 0, kInk);
        x += 34 + cvRound(9.2 * static_cast<double>(name.size())) + 16;
    };
    for (const Kind& kind : kKinds)
        entry(58, kind.name, [&](cv::Point2d p) {
            line(image, p + cv::Point2d{0, -5}, p + cv::Point2d{26, -5}, kind.colour, 2);
            dot(image, p + cv::Point2d{13, -5}, 4, kind.colour);
        });
    entry(58, "thin: as told; hollow: light left out", [&](cv::Point2d p) {
        line(image, p + cv::Point2d{0, -5}, p + cv::Point2d{26, -5}, kAdaptiveColour, 1);
    });
    x = 40;
    for (std::size_t k = 0; k < kParts; ++k)
        entry(84, part_name(k), [&](cv::Point2d p) {
            cv::rectangle(image, cv::Point(p) + cv::Point{6, -11}, cv::Point(p) + cv::Point{26, 1}, kPartColours[k],
                          cv::FILLED);
        });
}

}  // namespace

Status write_plot(const std::string& path, const std::string& title, std::span<const SceneLadder> scenes) {
    const int n = static_cast<int>(scenes.size()), columns = std::clamp(n, 2, kColumns);
    const int height = row_height(scenes);
    cv::Mat image(kHeader + (n + columns - 1) / columns * height, 40 + columns * kColumnWidth, CV_8UC3,
                  cv::Scalar::all(255));
    text(image, title, {image.cols / 2, 28}, kTitleSize, 0.5, kInk);
    draw_legend(image);
    for (int k = 0; k < n; ++k) {
        const Panel panel{scenes[static_cast<std::size_t>(k)],
                          {20 + k % columns * kColumnWidth, kHeader + k / columns * height}};
        draw_errors(image, panel);
        draw_bars(image, panel);
    }
    return write_png(path, image);
}

}  // namespace narpa
