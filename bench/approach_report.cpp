// What the bench of the approach found: as JSON, as a table and as plots.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "bench/approach.h"
#include "bench/approach_frames.h"
#include "estimator/features/feature_alignment.h"
#include "plot/plot.h"

namespace narpa {
namespace {

std::string name_of(EstimateMethod m) {
    return std::string(kEstimateMethods[static_cast<std::size_t>(m)]);
}

/// A frame for a plot, 320 pixels wide: the square root of the DN, so that dark parts can be seen.
template <class DnAt>
nlohmann::json thumbnail(int width, int height, const SensorModel& sensor, DnAt&& dn_at) {
    constexpr int kWidth = 320;
    cv::Mat grey(height, width, CV_8U), small;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const double part = (dn_at(x, y) - sensor.black_dn) / (sensor.top_dn - sensor.black_dn);
            grey.at<std::uint8_t>(y, x) =
                cv::saturate_cast<std::uint8_t>(255 * std::sqrt(std::clamp(part, 0.0, 1.0)));
        }
    cv::resize(grey, small, {kWidth, kWidth * height / width}, 0, 0, cv::INTER_AREA);
    return plot_image(small.cols, small.rows, 1, {small.data, small.total()});
}

}  // namespace

nlohmann::json to_json(const ApproachRun& run) {
    nlohmann::json bands = nlohmann::json::array(), basin = bands, frames = bands;
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
    for (const ApproachFrame& f : run.frames)
        frames.push_back({{"range_m", f.range_m},
                          {"found", f.found},
                          {"rotation_rad", f.rotation_rad},
                          {"position_m", f.position_m},
                          {"bound_rotation_rad", f.bound_rotation_rad},
                          {"bound_position_m", f.bound_position_m},
                          {"nees", f.nees},
                          {"ms", f.ms}});
    return {{"method", name_of(run.method)}, {"bands", bands}, {"basin", basin}, {"frames", frames}};
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
    nlohmann::json document{{"plot", "approach"}, {"title", title}, {"runs", nlohmann::json::array()}};
    for (const ApproachRun& run : runs) document["runs"].push_back(to_json(run));
    return write_plot(path, document);
}

Status plot_approach_frames(const std::string& path, const World& world, std::size_t camera_index,
                            std::size_t target, const ApproachOptions& o, TracingThreads& threads) {
    constexpr int kFrames = 5;
    const Camera& camera = world.scene().cameras[camera_index];
    const SensorModel sensor = sensor_model(camera);
    ApproachFrames frames(world, camera, target, o);
    FeatureAlignment alignment(world.render_scene(), camera, target, BodyPoses(world.scene().bodies.size()));
    ModelView view(world.render_scene(), camera, target, BodyPoses(world.scene().bodies.size()));
    std::mt19937_64 random(o.seed);
    nlohmann::json document{{"plot", "approach_frames"}, {"frames", nlohmann::json::array()}};
    for (int k = 0; k < kFrames; ++k) {
        threads.arena.execute([&] {
            const ApproachView& made = frames.make(k, kFrames);
            const Vector6 off =
                random_error(o.start_deg * kDegree, 0.01 * o.start_percent * norm(made.truth.t), random);
            const FeatureEstimate e = alignment.align(made.image, made.at, displaced(made.truth, off));
            view.place_bodies(made.at);
            FrameSettings settings;
            settings.spp = 4;
            view.render(e.T_camera_target, settings, false);
            const RadianceImage& rendered = view.radiance();
            const auto rendered_dn = [&](int x, int y) {
                return sensor.dn(rendered.pixels[static_cast<std::size_t>(y * rendered.width + x)]);
            };
            const auto frame_dn = [&](int x, int y) { return static_cast<double>(made.image.at(x, y)); };
            const Vector6 error = error_between(e.T_camera_target, made.truth);
            nlohmann::json matches = nlohmann::json::array();
            for (const FeatureRound& r : e.rounds) matches.push_back({r.before_px, r.after_px});
            document["frames"].push_back(
                {{"range_m", norm(made.truth.t)},
                 {"rotation_deg", error.head<3>().norm() / kDegree},
                 {"position_m", error.tail<3>().norm()},
                 {"image", thumbnail(made.image.width, made.image.height, sensor, frame_dn)},
                 {"render", thumbnail(rendered.width, rendered.height, sensor, rendered_dn)},
                 {"matches_px", matches}});
        });
    }
    return write_plot(path, document);
}

}  // namespace narpa
