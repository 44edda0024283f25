// The plots of the estimator benches: approach, frames of the approach, stereo.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "bench/estimation/approach.h"
#include "bench/estimation/stereo.h"
#include "estimator/features/feature_alignment.h"
#include "plot/plot.h"

namespace narpa {
namespace {

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
            const FeatureEstimate e = alignment.align(made.image, made.at, displaced(made.truth, off), made.motion);
            view.begin_frame(made.at, made.motion, row_times(camera));
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

Status plot_stereo(const std::string& path, const StereoBench& bench) {
    nlohmann::json document = to_json(bench), matches = nlohmann::json::array();
    const auto of = [](const auto& v) { return std::vector<double>(v.data(), v.data() + v.size()); };
    for (const StereoBenchPoint& p : bench.points)
        matches.push_back({{"left_px", of(p.left_px)},
                           {"right_px", of(p.right_px)},
                           {"truth_m", of(p.truth_m)},
                           {"whole_pixels_error_m", of(p.whole_error_m)},
                           {"between_pixels_error_m", of(p.fine_error_m)}});
    std::vector<std::uint8_t> grey;  // the square root of the DN, so that dark parts can be seen
    for (const float dn : bench.left.dn)
        grey.push_back(
            static_cast<std::uint8_t>(255 * std::sqrt(std::clamp(dn / bench.left_top_dn, 0.0, 1.0)) + 0.5));
    document["plot"] = "stereo";
    document["matches"] = matches;
    document["left"] = plot_image(bench.left.width, bench.left.height, 1, grey);
    return write_plot(path, document);
}

}  // namespace narpa
