#include "bench/pnp.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <optional>

#include "bench/pnp_trial.h"
#include "estimator/pose/pnp.h"
#include "estimator/pose/pnp_ceres.h"

namespace narpa {
namespace {

constexpr double kFailedAtBounds = 10;
constexpr std::size_t kPointsMax = 1024;

struct Answer {
    std::optional<Rigid3> T_camera_body;
    bool flagged = false;
};

/// A way to solve a trial; `start` is the tracked pose.
struct Method {
    std::string name;
    std::function<Answer(const PnpTrial&, const Rigid3& start)> solve;
};

// OpenCV's methods, on its own terms.

struct CvTrial {
    cv::Mat K, points, pixels;

    explicit CvTrial(const PnpTrial& t)
        : K((cv::Mat_<double>(3, 3) << t.camera.fx, 0, t.camera.cx, 0, t.camera.fy, t.camera.cy, 0, 0, 1)),
          points(static_cast<int>(t.body_m.size()), 1, CV_64FC3, const_cast<Vec3*>(t.body_m.data())),
          pixels(static_cast<int>(t.pixels.size()), 1, CV_64FC2, const_cast<Pixel*>(t.pixels.data())) {}
};

Answer as_answer(const cv::Mat& rotation, const cv::Mat& translation) {
    const Rigid3 T{exp_rotation({rotation.at<double>(0), rotation.at<double>(1), rotation.at<double>(2)}),
                   {translation.at<double>(0), translation.at<double>(1), translation.at<double>(2)}};
    if (!std::isfinite(norm(T.q)) || !is_finite(T.t)) return {};
    return {T};
}

/// OpenCV throws where a method does not take so few points or this shape: no answer.
Answer opencv(const PnpTrial& trial, cv::SolvePnPMethod method) {
    const CvTrial t(trial);
    cv::Mat r, tr;
    try {
        if (!cv::solvePnP(t.points, t.pixels, t.K, cv::noArray(), r, tr, false, method)) return {};
        return as_answer(r, tr);
    } catch (const cv::Exception&) {
        return {};
    }
}

Answer opencv_ransac(const PnpTrial& trial) {
    const CvTrial t(trial);
    cv::Mat r, tr;
    std::vector<int> inliers;
    constexpr int kIterations = 100;
    constexpr double kConfidence = 0.99;
    try {
        if (!cv::solvePnPRansac(t.points, t.pixels, t.K, cv::noArray(), r, tr, false, kIterations,
                                static_cast<float>(std::sqrt(kInlierSquaredResidual) * trial.sigma_px), kConfidence,
                                inliers, cv::SOLVEPNP_EPNP))
            return {};
        std::vector<cv::Point3d> points;
        std::vector<cv::Point2d> pixels;
        for (const int i : inliers)
            points.push_back(t.points.at<cv::Point3d>(i)), pixels.push_back(t.pixels.at<cv::Point2d>(i));
        cv::solvePnPRefineLM(points, pixels, t.K, cv::noArray(), r, tr);
        return as_answer(r, tr);
    } catch (const cv::Exception&) {
        return {};
    }
}

Answer of_fit(const PnpFit& fit) {
    return fit.ok() || fit.status == PnpStatus::no_convergence ? Answer{fit.T_camera_body} : Answer{};
}

/// The better of the minima that these starts lead Ceres to.
Answer best_by_ceres(const PnpTrial& trial, std::span<const Rigid3> starts) {
    std::optional<PnpFit> best;
    for (const Rigid3& start : starts) {
        PnpFit fit = refine_with_tiny_solver(trial.input(), start);
        if (fit.ok() && (!best || fit.chi2 < best->chi2)) best = fit;
    }
    return best ? of_fit(*best) : Answer{};
}

std::vector<Method> methods(const PnpSetting& setting) {
    const bool flat = setting.scene == PnpScene::plane || setting.scene == PnpScene::plane_facing;
    auto solver = std::make_shared<PnpSolver>(kPointsMax);
    auto refiner = std::make_shared<PnpRefiner>(kPointsMax);
    PnpOptions options;
    options.outliers = setting.outliers > 0;
    RefineOptions warm;
    if (options.outliers) warm.loss = {Loss::cauchy, 2};

    std::vector<Method> all;
    all.push_back({kPnpCold, [solver, options](const PnpTrial& t, const Rigid3&) {
                       const PnpSolution& s = solver->solve(t.input(), options);
                       if (!s.ok() && s.status != PnpStatus::no_convergence) return Answer{};
                       return Answer{s.fit.T_camera_body, s.ambiguous() || s.imprecise};
                   }});
    all.push_back({kPnpWarm, [refiner, warm](const PnpTrial& t, const Rigid3& start) {
                       return of_fit(refiner->refine(t.input(), start, warm));
                   }});
    if (options.outliers) {
        all.push_back({"Ceres Cauchy warm", [](const PnpTrial& t, const Rigid3& start) {
                           return of_fit(refine_with_ceres(t.input(), start, {Loss::cauchy, 2}));
                       }});
        all.push_back({kPnpPeerOutliers, [](const PnpTrial& t, const Rigid3&) { return opencv_ransac(t); }});
        return all;
    }
    all.push_back({kPnpPeerWarm, [](const PnpTrial& t, const Rigid3& start) {
                       return of_fit(refine_with_tiny_solver(t.input(), start));
                   }});
    all.push_back({kPnpPeerCold, [flat](const PnpTrial& t, const Rigid3&) {
                       PnpPoints points(kPointsMax);
                       points.assign(t.input());
                       std::vector<BodyPoint> normalised;
                       for (std::size_t i = 0; i < points.size(); ++i)
                           normalised.push_back({points.centred_body_m(i), points.normalised(i)});
                       std::vector<CentredPose> poses;
                       opencv_poses(normalised, flat, poses);
                       std::vector<Rigid3> starts;
                       for (const CentredPose& pose : poses) starts.push_back(points.uncentred(pose));
                       return best_by_ceres(t, starts);
                   }});
    for (const auto& [name, method] : {std::pair{"ITERATIVE", cv::SOLVEPNP_ITERATIVE},
                                       {"EPNP", cv::SOLVEPNP_EPNP},
                                       {"SQPNP", cv::SOLVEPNP_SQPNP},
                                       {"IPPE", cv::SOLVEPNP_IPPE}}) {
        if (method == cv::SOLVEPNP_IPPE && !flat) continue;
        all.push_back({name, [m = method](const PnpTrial& t, const Rigid3&) { return opencv(t, m); }});
    }
    return all;
}

double median(std::vector<double>& values) {
    if (values.empty()) return 0;
    const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
}

double rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

/// What one method did in a cell so far.
struct Tally {
    std::vector<double> rotation, position, us;
    int trials = 0, failed = 0, flagged = 0;

    void add(const PnpTrial& trial, const Answer& answer, double took_us) {
        ++trials;
        us.push_back(took_us);
        bool good = answer.T_camera_body.has_value();
        if (good) {
            const Vector6 e = error_between(*answer.T_camera_body, trial.T_camera_body);
            const double r = e.head<3>().norm() / trial.bound_rotation_rad;
            const double p = e.tail<3>().norm() / trial.bound_position_m;
            good = r <= kFailedAtBounds && p <= kFailedAtBounds;
            if (good) rotation.push_back(r), position.push_back(p);
        }
        failed += good ? 0 : 1;
        flagged += !good && answer.flagged ? 1 : 0;
    }
    PnpRow row(const std::string& name) {
        PnpRow r{name, trials, 0, rms(rotation), 0, rms(position), 0, 0, 0};
        r.rotation_median = median(rotation), r.position_median = median(position), r.median_us = median(us);
        r.failed = trials > 0 ? static_cast<double>(failed) / trials : 0;
        r.flagged = failed > 0 ? static_cast<double>(flagged) / failed : 0;
        return r;
    }
};

PnpCell run_cell(const PnpSetting& setting, const PnpBenchOptions& options, const StopFlag& stop) {
    using Clock = std::chrono::steady_clock;
    std::mt19937_64 random(options.seed);
    const std::vector<Method> all = methods(setting);
    std::vector<Tally> tallies(all.size());
    std::vector<double> bound_rotation, bound_position;
    // OpenCV takes milliseconds for each of these.
    const int trials = setting.outliers < 0.5 ? options.trials : (options.trials + 4) / 5;
    int left = 1000 + 10 * trials;  // so far away that no pose is determined, no draw would do
    for (int done = 0; done < trials && left > 0 && !stop; --left) {
        const auto trial = draw_trial(setting, random);
        if (!trial) continue;
        const Rigid3 start = tracked_pose(*trial, random);
        for (std::size_t m = 0; m < all.size(); ++m) {
            const auto begin = Clock::now();
            const Answer answer = all[m].solve(*trial, start);
            const std::chrono::duration<double, std::micro> took = Clock::now() - begin;
            tallies[m].add(*trial, answer, took.count());
        }
        bound_rotation.push_back(trial->bound_rotation_rad);
        bound_position.push_back(trial->bound_position_m / setting.range_m);
        ++done;
    }
    PnpCell cell{in_words(setting.scene), setting.points,
                 setting.noise_px,        setting.range_m,
                 setting.outliers,        median(bound_rotation) * 180 / M_PI,
                 median(bound_position),  {}};
    for (std::size_t m = 0; m < all.size(); ++m) cell.rows.push_back(tallies[m].row(all[m].name));
    return cell;
}

std::vector<PnpSetting> settings(const PnpBenchOptions& o) {
    std::vector<PnpSetting> all;
    for (const int n : o.nominal ? o.points : std::vector<int>{})
        for (const double noise : o.noise_px)
            for (const double range : o.ranges_m) all.push_back({PnpScene::nominal, n, noise, range, 0});
    if (!o.hard_cases) return all;
    for (const int n : {6, 10, 30}) {
        all.push_back({PnpScene::half_turn, n, 0.5, 30, 0});
        all.push_back({PnpScene::plane, n, 0.5, 30, 0});
        all.push_back({PnpScene::plane_facing, n, 0.5, 30, 0});
        all.push_back({PnpScene::plane, n, 0.5, 100, 0});
        all.push_back({PnpScene::line, n, 0.5, 30, 0});
        all.push_back({PnpScene::tiny, n, 0.1, 200, 0});
        all.push_back({PnpScene::tiny, n, 0.5, 200, 0});
        all.push_back({PnpScene::camera_plane, n, 0.5, 2, 0});
    }
    for (const double outliers : {0.2, 0.5})
        for (const int n : {10, 30, 100})
            for (const double range : {10.0, 30.0}) all.push_back({PnpScene::nominal, n, 0.5, range, outliers});
    return all;
}

}  // namespace

const PnpRow* PnpCell::row(const std::string& method) const {
    const auto found = std::find_if(rows.begin(), rows.end(), [&](const PnpRow& r) { return r.method == method; });
    return found == rows.end() ? nullptr : &*found;
}

std::vector<PnpCell> run_pnp_bench(const PnpBenchOptions& options,
                                   const std::function<void(std::size_t, std::size_t)>& progress,
                                   const StopFlag& stop) {
    std::vector<PnpCell> cells;
    const std::vector<PnpSetting> all = settings(options);
    for (const PnpSetting& setting : all) {
        if (stop) break;
        progress(cells.size(), all.size());
        cells.push_back(run_cell(setting, options, stop));
    }
    return cells;
}

}  // namespace narpa
