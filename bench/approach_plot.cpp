// What the bench of the approach found, as a table and as pictures.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "bench/approach.h"
#include "bench/approach_frames.h"
#include "emulator/log/plot.h"
#include "estimator/features/feature_alignment.h"

namespace narpa {
namespace {

const std::array<cv::Scalar, 2> kColours{cv::Scalar{180, 90, 20}, cv::Scalar{40, 120, 40}};

std::string name_of(EstimateMethod m) {
    return std::string(kEstimateMethods[static_cast<std::size_t>(m)]);
}
const cv::Scalar& colour_of(EstimateMethod m) {
    return kColours[static_cast<std::size_t>(m)];
}

struct Panel {
    std::string words;
    double (*error)(const ApproachFrame&);
    double (*bound)(const ApproachFrame&);
};

void draw_errors(cv::Mat& image, const Panel& panel, const std::vector<ApproachRun>& runs, cv::Rect place) {
    std::vector<double> ranges, values;
    for (const ApproachRun& run : runs)
        for (const ApproachFrame& f : run.frames) {
            ranges.push_back(f.range_m);
            if (!f.found) continue;
            for (const double v : {panel.error(f), panel.bound(f)})
                if (v > 0 && std::isfinite(v)) values.push_back(v);
        }
    if (values.empty()) return;
    const plot::Axis x = plot::logarithmic_axis(ranges, place.x, place.x + place.width);
    const plot::Axis y = plot::logarithmic_axis(values, place.y + place.height, place.y);
    for (const double v : x.ticks()) plot::vertical_tick(image, x, y, v);
    for (const double v : y.ticks()) plot::horizontal_tick(image, y, x, v, fmt::format("{:g}", v));
    for (const ApproachRun& run : runs) {
        const cv::Scalar colour = colour_of(run.method), pale = 0.5 * colour + cv::Scalar(120, 120, 120);
        const ApproachFrame* last = nullptr;
        for (const ApproachFrame& f : run.frames) {
            if (!f.found || !(panel.bound(f) > 0)) continue;
            if (last != nullptr)
                plot::line(image, {x.at(last->range_m), y.at(panel.bound(*last))},
                           {x.at(f.range_m), y.at(panel.bound(f))}, pale, 1);
            last = &f;
        }
        for (const ApproachFrame& f : run.frames) {
            if (f.found)
                plot::dot(image, {x.at(f.range_m), y.at(panel.error(f))}, 2, colour);
            else
                plot::line(image, {x.at(f.range_m), y.at(y.high) + 2}, {x.at(f.range_m), y.at(y.high) + 10}, colour,
                           1);
        }
    }
    plot::text(image, panel.words, {place.x, place.y - 10}, plot::kTextSize, 0, plot::kInk);
}

void draw_basin(cv::Mat& image, const std::vector<ApproachRun>& runs, cv::Rect place) {
    std::vector<double> offs{0};
    for (const ApproachRun& run : runs)
        for (const BasinCell& c : run.basin) offs.push_back(c.off);
    if (offs.size() < 2) return;
    const plot::Axis x = plot::linear_axis(offs, place.x, place.x + place.width);
    const plot::Axis y = plot::linear_axis({0, 100}, place.y + place.height, place.y);
    for (const double v : x.ticks()) plot::vertical_tick(image, x, y, v);
    for (const double v : y.ticks()) plot::horizontal_tick(image, y, x, v, fmt::format("{:g}", v));
    for (const ApproachRun& run : runs) {
        const BasinCell* last = nullptr;
        const auto at = [&](const BasinCell& c) {
            return cv::Point2d(x.at(c.off), y.at(100.0 * c.found / std::max(1, c.trials)));
        };
        for (const BasinCell& c : run.basin) {
            if (last != nullptr) plot::line(image, at(*last), at(c), colour_of(run.method), 2);
            plot::dot(image, at(c), 4, colour_of(run.method));
            last = &c;
        }
    }
    plot::text(image, "found, %, against how far off the start is, degrees and % of the range",
               {place.x, place.y - 10}, plot::kTextSize, 0, plot::kInk);
}

/// For eyes: the square root of the light, three times brighter than the sensor's scale.
cv::Mat shown(const MeasuredImage& image, const SensorModel& sensor) {
    cv::Mat out(image.height, image.width, CV_8UC3);
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double part = (image.at(x, y) - sensor.black_dn) / (sensor.top_dn - sensor.black_dn);
            const auto v = cv::saturate_cast<std::uint8_t>(255 * std::sqrt(std::clamp(part, 0.0, 1.0)));
            out.at<cv::Vec3b>(y, x) = {v, v, v};
        }
    return out;
}

MeasuredImage expected_of(const RadianceImage& view, const SensorModel& sensor) {
    MeasuredImage out{view.width, view.height, {}};
    for (const Rgb& L : view.pixels) out.dn.push_back(static_cast<float>(sensor.dn(L)));
    return out;
}

void draw_costs(cv::Mat& image, const std::vector<FeatureRound>& rounds, cv::Rect place) {
    std::vector<double> costs;
    std::vector<std::size_t> first_of_round;
    for (const FeatureRound& r : rounds) {
        first_of_round.push_back(costs.size());
        costs.push_back(r.before_px * r.before_px);
        costs.push_back(r.after_px * r.after_px);
    }
    std::erase_if(costs, [](double c) { return !(c > 0); });
    if (costs.size() < 2) return;
    std::vector<double> steps;
    for (std::size_t i = 0; i < costs.size(); ++i) steps.push_back(static_cast<double>(i) / 2);
    const plot::Axis x = plot::linear_axis(steps, place.x, place.x + place.width);
    const plot::Axis y = plot::logarithmic_axis(costs, place.y + place.height, place.y);
    for (const double v : y.ticks()) plot::horizontal_tick(image, y, x, v, fmt::format("{:g}", v));
    for (const double v : x.ticks()) plot::vertical_tick(image, x, y, v);
    for (std::size_t i = 0; i < costs.size(); ++i) {
        const cv::Point2d at(x.at(steps[i]), y.at(costs[i]));
        if (i > 0) plot::line(image, {x.at(steps[i - 1]), y.at(costs[i - 1])}, at, kColours[0], 1);
        plot::dot(image, at, 3, kColours[0]);
    }
}

}  // namespace

nlohmann::json to_json(const ApproachRun& run) {
    nlohmann::json bands = nlohmann::json::array(), basin = nlohmann::json::array();
    for (const ApproachBand& b : run.bands)
        bands.push_back({{"from_m", std::isfinite(b.from_m) ? nlohmann::json(b.from_m) : nlohmann::json(nullptr)},
                         {"to_m", b.to_m},
                         {"frames", b.frames},
                         {"found", b.found},
                         {"wrong", b.wrong},
                         {"rotation_rms_rad", b.rotation_rms_rad},
                         {"position_rms_m", b.position_rms_m},
                         {"rotation_of_bound", b.rotation_of_bound},
                         {"position_of_bound", b.position_of_bound},
                         {"nees_median", b.nees_median},
                         {"ms_median", b.ms_median},
                         {"renders_mean", b.renders_mean}});
    for (const BasinCell& c : run.basin)
        basin.push_back({{"off_deg_and_percent", c.off}, {"trials", c.trials}, {"found", c.found}});
    return {{"method", name_of(run.method)}, {"bands", bands}, {"basin", basin}};
}

std::string in_words(const std::vector<ApproachRun>& runs) {
    std::string out =
        fmt::format("{:<10} {:>14} {:>9} {:>6} {:>11} {:>11} {:>15} {:>6} {:>8} {:>8}\n", "approach", "range, m",
                    "found", "wrong", "RMS deg", "RMS m", "/ bound", "NEES", "renders", "ms");
    for (const ApproachRun& run : runs) {
        for (const ApproachBand& b : run.bands) {
            const bool all = !std::isfinite(b.from_m) && b.to_m == 0;
            const std::string range = all                       ? "all"
                                      : std::isfinite(b.from_m) ? fmt::format("{:g} .. {:g}", b.from_m, b.to_m)
                                                                : fmt::format("beyond {:g}", b.to_m);
            out += fmt::format(
                "{:<10} {:>14} {:>4}/{:<4} {:>6} {:>11.4f} {:>11.3g} {:>7.2f} {:>7.2f} {:>6.1f} {:>8.1f} "
                "{:>8.0f}\n",
                name_of(run.method), range, b.found, b.frames, b.wrong, b.rotation_rms_rad / kDegree,
                b.position_rms_m, b.rotation_of_bound, b.position_of_bound, b.nees_median, b.renders_mean,
                b.ms_median);
        }
        if (run.basin.empty()) continue;
        out += fmt::format("{:<10} found from starts off by", name_of(run.method));
        for (const BasinCell& c : run.basin) out += fmt::format("  {:g}: {}/{}", c.off, c.found, c.trials);
        out += " (degrees and % of the range)\n";
    }
    return out;
}

Status plot_approach(const std::string& path, const std::string& title, const std::vector<ApproachRun>& runs) {
    cv::Mat image(1180, 1000, CV_8UC3, cv::Scalar(255, 255, 255));
    plot::text(image, title, {90, 32}, plot::kTitleSize, 0, plot::kInk);
    int right = image.cols - 30;
    for (const ApproachRun& run : runs) {
        plot::text(image, name_of(run.method), {right, 56}, plot::kTextSize, 1, colour_of(run.method));
        right -= 110;
    }
    const Panel turn{"attitude error, deg, against range, m; lines: the bound; ticks at the top: not found",
                     [](const ApproachFrame& f) { return f.rotation_rad / kDegree; },
                     [](const ApproachFrame& f) { return f.bound_rotation_rad / kDegree; }};
    const Panel shift{"position error, m, against range, m", [](const ApproachFrame& f) { return f.position_m; },
                      [](const ApproachFrame& f) { return f.bound_position_m; }};
    draw_errors(image, turn, runs, {90, 84, 870, 320});
    draw_errors(image, shift, runs, {90, 474, 870, 320});
    draw_basin(image, runs, {90, 870, 870, 260});
    return plot::write_png(path, image);
}

Status picture_of_frames(const std::string& path, const World& world, std::size_t camera_index, std::size_t target,
                         const ApproachOptions& o, TracingThreads& threads) {
    constexpr int kFrames = 5, kWidth = 320, kGap = 12, kCurve = 220, kLeft = 60;
    const Camera& camera = world.scene().cameras[camera_index];
    const SensorModel sensor = sensor_model(camera);
    const int height = kWidth * camera.height / camera.width;
    cv::Mat sheet(2 * height + kCurve + 5 * kGap + 40, kFrames * (kWidth + kGap) + kGap, CV_8UC3,
                  cv::Scalar(255, 255, 255));
    ApproachFrames frames(world, camera, target, o);
    FeatureAlignment alignment(world.render_scene(), camera, target, BodyPoses(world.scene().bodies.size()));
    ModelView view(world.render_scene(), camera, target, BodyPoses(world.scene().bodies.size()));
    std::mt19937_64 random(o.seed);
    for (int k = 0; k < kFrames; ++k) {
        const int left = kGap + k * (kWidth + kGap);
        threads.arena.execute([&] {
            const ApproachView& made = frames.make(k, kFrames);
            const Vector6 off =
                random_error(o.start_deg * kDegree, 0.01 * o.start_percent * norm(made.truth.t), random);
            const FeatureEstimate e = alignment.align(made.image, made.at, displaced(made.truth, off));
            view.place_bodies(made.at);
            FrameSettings settings;
            settings.spp = 4;
            view.render(e.T_camera_target, settings, false);
            const auto put = [&](const cv::Mat& picture, int top) {
                cv::Mat small;
                cv::resize(picture, small, {kWidth, height}, 0, 0, cv::INTER_AREA);
                small.copyTo(sheet(cv::Rect(left, top, kWidth, height)));
            };
            put(shown(made.image, sensor), 30);
            put(shown(expected_of(view.radiance(), sensor), sensor), 30 + height + kGap);
            const Vector6 error = error_between(e.T_camera_target, made.truth);
            plot::text(sheet,
                       fmt::format("{:.1f} m: {:.4f} deg, {:.2g} m off", norm(made.truth.t),
                                   error.head<3>().norm() / kDegree, error.tail<3>().norm()),
                       {left, 22}, plot::kTextSize, 0, plot::kInk);
            draw_costs(sheet, e.rounds,
                       {left + kLeft, 30 + 2 * (height + kGap) + 16, kWidth - kLeft - 10, kCurve - 40});
        });
    }
    plot::text(sheet,
               "frame; render at the estimated pose; mean squared distance of the matches (px^2) before and after "
               "each solution, over renders",
               {kGap, sheet.rows - 12}, plot::kTextSize, 0, plot::kInk);
    return plot::write_png(path, sheet);
}

}  // namespace narpa
