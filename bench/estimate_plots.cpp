#include "bench/estimate_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>
#include <set>

#include "emulator/log/plot.h"

namespace narpa {
namespace {

using namespace plot;

constexpr int kHeader = 60;
const cv::Scalar kNees{176, 96, 16}, kBand{225, 240, 225};

/// White where none was found, deep green where all were.
cv::Scalar shade(double found) {
    const double rest = 1 - found;
    return {90 + 165 * rest, 160 + 95 * rest, 60 + 195 * rest};
}

constexpr int kField = 120, kFieldHeight = 84, kFieldsLeft = 110;

void draw_field(cv::Mat& image, const cv::Rect& at, const IcpRun& run) {
    cv::rectangle(image, at, shade(run.found_fraction()), cv::FILLED);
    cv::rectangle(image, at, cv::Scalar::all(255), 2);
    const int middle = at.x + at.width / 2;
    text(image, fmt::format("{:.1f} %", 100 * run.found_fraction()), {middle, at.y + 28}, kTitleSize, 0.5, kInk);
    text(image, fmt::format("{:.1f} ms", 1e-3 * run.microseconds_p50), {middle, at.y + 50}, kTextSize, 0.5, kInk);
    const int silent = run.starts.count - run.found - run.told;
    text(image, silent > 0 ? fmt::format("{} silent", silent) : fmt::format("of {}", run.starts.count),
         {middle, at.y + 70}, kTextSize, 0.5, kInk);
}

constexpr int kPanelWidth = 560, kPanelHeight = 330, kLeft = 60, kTop = 34;

void draw_nees(cv::Mat& image, cv::Point corner, const FilterRun& run) {
    const cv::Rect frame{corner.x + kLeft, corner.y + kTop, kPanelWidth - kLeft - 30, kPanelHeight - kTop - 60};
    std::vector<double> ts, values{12 - 1.5 * run.band(), 12 + 1.5 * run.band()};
    for (const FilterTime& t : run.times) {
        ts.push_back(t.t_s);
        values.push_back(t.nees);
    }
    const Axis x = linear_axis(ts, frame.x, frame.x + frame.width);
    const Axis y = linear_axis(values, frame.y + frame.height, frame.y);
    const auto at = [](double v) { return static_cast<int>(std::lround(v)); };
    cv::rectangle(image, {frame.x, at(y.at(12 + run.band()))}, {frame.x + frame.width, at(y.at(12 - run.band()))},
                  kBand, cv::FILLED);
    for (const double v : x.ticks()) vertical_tick(image, x, y, v);
    for (const double v : y.ticks()) horizontal_tick(image, y, x, v, fmt::format("{:g}", v));
    line(image, cv::Point2d(frame.x, y.at(12)), cv::Point2d(frame.x + frame.width, y.at(12)), kGuide, 1);
    cv::rectangle(image, frame, kInk, 1);
    for (std::size_t i = 1; i < run.times.size(); ++i)
        line(image, {x.at(ts[i - 1]), y.at(run.times[i - 1].nees)}, {x.at(ts[i]), y.at(run.times[i].nees)}, kNees,
             2);
    text(
        image,
        fmt::format("{}: mean {:.2f}, {:.0f} % of the times inside", run.name, run.nees(), 100 * run.inside_band()),
        {frame.x + frame.width / 2, frame.y - 10}, kTextSize, 0.5, kInk);
    text(image, "seconds", {frame.x + frame.width / 2, frame.y + frame.height + 42}, kTextSize, 0.5, kInk);
}

constexpr int kLabelHeight = 17, kLetterWidth = 9, kDot = 5;

/// Beside a dot, or above or below where a dot or another label stands already.
cv::Rect free_place(const std::string& label, const cv::Point2d& dot, const std::vector<cv::Rect>& taken) {
    const int width = kLetterWidth * static_cast<int>(label.size());
    const bool to_the_left = dot.x > 700;
    cv::Rect place(static_cast<int>(dot.x) + (to_the_left ? -12 - width : 12), static_cast<int>(dot.y) - 8, width,
                   kLabelHeight);
    const int wanted = place.y;
    const auto covered = [&] {
        return std::any_of(taken.begin(), taken.end(), [&](const cv::Rect& r) { return (r & place).area() > 0; });
    };
    for (int k = 1; covered(); ++k) place.y = wanted + (k % 2 ? 1 : -1) * (k + 1) / 2 * kLabelHeight;
    return place;
}

}  // namespace

Status write_icp_plot(const std::string& path, const std::string& title, const std::vector<IcpRun>& runs) {
    if (runs.empty()) return Error{"nothing to draw: no runs"};
    std::set<double> angles, fractions;
    for (const IcpRun& r : runs) {
        angles.insert(r.starts.angle_deg);
        fractions.insert(r.starts.distance_fraction);
    }
    const auto place = [](const std::set<double>& in, double v) {
        return static_cast<int>(std::distance(in.begin(), in.find(v)));
    };
    const int columns = static_cast<int>(angles.size()), rows = static_cast<int>(fractions.size());
    cv::Mat image(kHeader + rows * kFieldHeight + 70, std::max(640, kFieldsLeft + columns * kField + 40), CV_8UC3,
                  cv::Scalar::all(255));
    text(image, title, {image.cols / 2, 30}, kTitleSize, 0.5, kInk);
    for (const IcpRun& r : runs)
        draw_field(image,
                   {kFieldsLeft + place(angles, r.starts.angle_deg) * kField,
                    kHeader + (rows - 1 - place(fractions, r.starts.distance_fraction)) * kFieldHeight, kField,
                    kFieldHeight},
                   r);
    const int foot = kHeader + rows * kFieldHeight;
    for (const double a : angles)
        text(image, fmt::format("{:g}", a), {kFieldsLeft + place(angles, a) * kField + kField / 2, foot + 22},
             kTextSize, 0.5, kInk);
    for (const double f : fractions)
        text(image, fmt::format("{:g} %", 100 * f),
             {kFieldsLeft - 10, kHeader + (rows - 1 - place(fractions, f)) * kFieldHeight + kFieldHeight / 2 + 5},
             kTextSize, 1, kInk);
    text(image, "angle of the start, degrees; left: its shift, in parts of the distance", {kFieldsLeft, foot + 50},
         kTextSize, 0, kInk);
    return write_png(path, image);
}

Status write_filter_plot(const std::string& path, const std::string& title, const std::vector<FilterRun>& runs) {
    if (runs.empty()) return Error{"nothing to draw: no runs"};
    const int n = static_cast<int>(runs.size());
    cv::Mat image(kHeader + (n + 1) / 2 * kPanelHeight, 2 * kPanelWidth, CV_8UC3, cv::Scalar::all(255));
    text(image, title, {image.cols / 2, 30}, kTitleSize, 0.5, kInk);
    for (int k = 0; k < n; ++k)
        draw_nees(image, {k % 2 * kPanelWidth, kHeader + k / 2 * kPanelHeight}, runs[static_cast<std::size_t>(k)]);
    return write_png(path, image);
}

Status write_time_plot(const std::string& path, const std::vector<TimeAndError>& estimators) {
    static const std::array<cv::Scalar, 6> kFamilies{cv::Scalar{180, 90, 20},  cv::Scalar{40, 120, 40},
                                                     cv::Scalar{40, 40, 190},  cv::Scalar{160, 40, 160},
                                                     cv::Scalar{20, 130, 200}, cv::Scalar{90, 90, 90}};
    cv::Mat image(720, 1000, CV_8UC3, cv::Scalar(255, 255, 255));
    std::vector<double> times, errors;
    std::vector<std::string> families;
    for (const TimeAndError& e : estimators) {
        times.push_back(e.ms), errors.push_back(100 * e.position_of_range);
        if (std::find(families.begin(), families.end(), e.family) == families.end()) families.push_back(e.family);
    }
    if (estimators.empty()) return Error{"no estimator was measured, expected one at least", path};
    const plot::Axis x = plot::logarithmic_axis(times, 90, 960), y = plot::logarithmic_axis(errors, 640, 70);
    for (const double v : x.ticks()) plot::vertical_tick(image, x, y, v);
    for (const double v : y.ticks()) plot::horizontal_tick(image, y, x, v, fmt::format("{:g}", v));
    std::vector<cv::Rect> taken;
    for (std::size_t i = 0; i < times.size(); ++i) {
        const cv::Point at(cv::Point2d(x.at(times[i]), y.at(errors[i])));
        taken.emplace_back(at.x - kDot, at.y - kDot, 2 * kDot, 2 * kDot);
    }
    for (const TimeAndError& e : estimators) {
        const auto family =
            static_cast<std::size_t>(std::find(families.begin(), families.end(), e.family) - families.begin());
        const cv::Scalar& colour = kFamilies[family % kFamilies.size()];
        const cv::Point2d at(x.at(e.ms), y.at(100 * e.position_of_range));
        const cv::Rect place = free_place(e.name, at, taken);
        taken.push_back(place);
        const cv::Point foot(place.x, place.y + kLabelHeight - 4);
        if (std::abs(foot.y - at.y) > kLabelHeight) plot::line(image, at, cv::Point2d(foot), plot::kGuide, 1);
        plot::dot(image, at, kDot, colour);
        plot::text(image, e.name, foot, plot::kTextSize, 0, colour);
    }
    plot::text(image, "position error, RMS, % of the range, against time of an estimate, ms", {90, 40},
               plot::kTitleSize, 0, plot::kInk);
    return plot::write_png(path, image);
}

}  // namespace narpa
