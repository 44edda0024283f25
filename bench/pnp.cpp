#include "bench/pnp.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <optional>

#include "bench/statistics.h"
#include "estimator/pose/pnp.h"
#include "estimator/pose/pnp_ceres.h"
#include "estimator/pose/pnp_refine.h"

namespace narpa {
namespace {

constexpr double kPixels = 500;

Vec3 random_direction(std::mt19937_64& random) {
    std::normal_distribution<double> n;
    return normalized(Vec3{n(random), n(random), n(random)});
}

Quat random_attitude(std::mt19937_64& random) {
    std::normal_distribution<double> n;
    return normalized(Quat{n(random), n(random), n(random), n(random)});
}

/// The body's z axis this far from the line of sight, in any direction, and turned about itself by any angle.
Quat tilted(std::mt19937_64& random, double tilt_min_deg, double tilt_max_deg) {
    std::uniform_real_distribution<double> turn(-M_PI, M_PI), tilt(tilt_min_deg * kDegree, tilt_max_deg * kDegree);
    const double direction = turn(random);
    return exp_rotation(Vec3{std::cos(direction), std::sin(direction), 0} * tilt(random)) *
           exp_rotation({0, 0, turn(random)});
}

Quat attitude(PnpScene scene, std::mt19937_64& random) {
    switch (scene) {
        case PnpScene::half_turn: return exp_rotation(random_direction(random) * (179.9 * kDegree));
        case PnpScene::plane: return tilted(random, 20, 70);
        case PnpScene::plane_facing: return tilted(random, 0, 5);
        case PnpScene::camera_plane: return tilted(random, 0, 10);
        default: return random_attitude(random);
    }
}

/// Half the edges of the box that points are drawn in.
Vec3 half_box_m(const PnpSetting& s) {
    const double half = std::min(2.0, 0.22 * s.range_m);
    switch (s.scene) {
        case PnpScene::plane:
        case PnpScene::plane_facing: return {half, half, 0};
        case PnpScene::line: return {half, 0.03 * half, 0.03 * half};
        case PnpScene::tiny: return {0.7, 0.7, 0.7};
        // Along the line of sight almost to the camera.
        case PnpScene::camera_plane: return {0.02 * s.range_m, 0.02 * s.range_m, 0.95 * s.range_m};
        default: return {half, half, half};
    }
}

}  // namespace

const char* in_words(PnpScene scene) {
    switch (scene) {
        case PnpScene::nominal: return "nominal";
        case PnpScene::half_turn: return "half a turn";
        case PnpScene::plane: return "plane";
        case PnpScene::plane_facing: return "plane, facing";
        case PnpScene::line: return "nearly a line";
        case PnpScene::tiny: return "tiny";
        case PnpScene::camera_plane: return "camera plane";
    }
    return "";
}

std::optional<PnpTrial> draw_trial(const PnpSetting& s, std::mt19937_64& random) {
    std::uniform_real_distribution<double> u(-1, 1);
    std::normal_distribution<double> normal;
    const double focal_px = std::hypot(kPixels / 2, kPixels / 2) / std::tan(15 * kDegree);
    PnpTrial trial;
    trial.camera = {focal_px, focal_px, (kPixels - 1) / 2, (kPixels - 1) / 2};
    trial.sigma_px = s.noise_px;
    const double off_axis = s.scene == PnpScene::camera_plane ? 0 : 0.03;
    trial.T_camera_body = {attitude(s.scene, random),
                           Vec3{off_axis * u(random), off_axis * u(random), 1} * s.range_m};
    const Vec3 half = half_box_m(s);
    const auto n = static_cast<std::size_t>(s.points);
    trial.inliers = n - static_cast<std::size_t>(std::lround(s.outliers * static_cast<double>(n)));
    for (std::size_t i = 0; i < n; ++i) {
        trial.body_m.push_back(Vec3{u(random), u(random), u(random)} * half);
        const Vec3 p = trial.T_camera_body * trial.body_m.back();
        const auto [x, y] = trial.camera.of_plane(p.x / p.z, p.y / p.z);
        Pixel pixel{x + s.noise_px * normal(random), y + s.noise_px * normal(random)};
        if (i >= trial.inliers) pixel = {kPixels * (0.5 + 0.5 * u(random)), kPixels * (0.5 + 0.5 * u(random))};
        trial.pixels.push_back(pixel);
    }
    const auto bound = pnp_bound(
        {trial.camera, {trial.body_m.data(), trial.inliers}, {trial.pixels.data(), trial.inliers}, trial.sigma_px},
        trial.T_camera_body);
    if (!bound) return std::nullopt;
    trial.bound_rotation_rad = rotation_sigma(*bound);
    trial.bound_position_m = position_sigma(*bound);
    return trial;
}

Rigid3 tracked_pose(const PnpTrial& trial, std::mt19937_64& random) {
    return {normalized(exp_rotation(random_direction(random) * kDegree) * trial.T_camera_body.q),
            trial.T_camera_body.t + random_direction(random) * (0.01 * trial.T_camera_body.t.z)};
}

namespace {

constexpr double kFailedAtBounds = 10;
constexpr std::size_t kPointsMax = 1024;

struct PoseResult {
    std::optional<Rigid3> T_camera_body;
    bool flagged = false;
};

/// A method that solves a trial; `start` is the tracked pose.
struct Method {
    std::string name;
    std::function<PoseResult(const PnpTrial&, const Rigid3& start)> solve;
};

// OpenCV's methods.

struct CvTrial {
    cv::Mat K, points, pixels;

    explicit CvTrial(const PnpTrial& t)
        : K((cv::Mat_<double>(3, 3) << t.camera.fx, 0, t.camera.cx, 0, t.camera.fy, t.camera.cy, 0, 0, 1)),
          points(static_cast<int>(t.body_m.size()), 1, CV_64FC3, const_cast<Vec3*>(t.body_m.data())),
          pixels(static_cast<int>(t.pixels.size()), 1, CV_64FC2, const_cast<Pixel*>(t.pixels.data())) {}
};

PoseResult as_result(const cv::Mat& rotation, const cv::Mat& translation) {
    const Rigid3 T{exp_rotation({rotation.at<double>(0), rotation.at<double>(1), rotation.at<double>(2)}),
                   {translation.at<double>(0), translation.at<double>(1), translation.at<double>(2)}};
    if (!std::isfinite(norm(T.q)) || !is_finite(T.t)) return {};
    return {T};
}

/// No pose where OpenCV throws: a method that does not take so few points, or this shape.
PoseResult opencv(const PnpTrial& trial, cv::SolvePnPMethod method) {
    const CvTrial t(trial);
    cv::Mat r, tr;
    try {
        if (!cv::solvePnP(t.points, t.pixels, t.K, cv::noArray(), r, tr, false, method)) return {};
        return as_result(r, tr);
    } catch (const cv::Exception&) {
        return {};
    }
}

PoseResult opencv_ransac(const PnpTrial& trial) {
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
        return as_result(r, tr);
    } catch (const cv::Exception&) {
        return {};
    }
}

PoseResult of_fit(const PnpFit& fit) {
    return fit.ok() || fit.status == PnpStatus::no_convergence ? PoseResult{fit.T_camera_body} : PoseResult{};
}

/// The best minimum that Ceres reaches from these starts.
PoseResult best_by_ceres(const PnpTrial& trial, std::span<const Rigid3> starts) {
    std::optional<PnpFit> best;
    for (const Rigid3& start : starts) {
        PnpFit fit = refine_with_tiny_solver(trial.input(), start);
        if (fit.ok() && (!best || fit.chi2 < best->chi2)) best = fit;
    }
    return best ? of_fit(*best) : PoseResult{};
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
                       if (!s.ok() && s.status != PnpStatus::no_convergence) return PoseResult{};
                       return PoseResult{s.fit.T_camera_body, s.ambiguous() || s.imprecise};
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

/// Results of one method in a cell.
struct Tally {
    std::vector<double> rotation, position, us;
    int trials = 0, failed = 0, flagged = 0;

    void add(const PnpTrial& trial, const PoseResult& result, double took_us) {
        ++trials;
        us.push_back(took_us);
        bool good = result.T_camera_body.has_value();
        if (good) {
            const Vector6 e = error_between(*result.T_camera_body, trial.T_camera_body);
            const double r = e.head<3>().norm() / trial.bound_rotation_rad;
            const double p = e.tail<3>().norm() / trial.bound_position_m;
            good = r <= kFailedAtBounds && p <= kFailedAtBounds;
            if (good) rotation.push_back(r), position.push_back(p);
        }
        failed += good ? 0 : 1;
        flagged += !good && result.flagged ? 1 : 0;
    }
    PnpRow row(const std::string& name) {
        PnpRow r{name, trials, 0, rms(rotation), 0, rms(position), 0, 0, 0};
        r.rotation_median_bounds = quantile(rotation, 0.5), r.position_median_bounds = quantile(position, 0.5),
        r.median_us = quantile(us, 0.5);
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
    // OpenCV needs milliseconds for each trial with many outliers.
    const int trials = setting.outliers < 0.5 ? options.trials : (options.trials + 4) / 5;
    int left = 1000 + 10 * trials;  // at ranges where no draw determines a pose, the loop still ends
    for (int done = 0; done < trials && left > 0 && !stop; --left) {
        const auto trial = draw_trial(setting, random);
        if (!trial) continue;
        const Rigid3 start = tracked_pose(*trial, random);
        for (std::size_t m = 0; m < all.size(); ++m) {
            const auto begin = Clock::now();
            const PoseResult result = all[m].solve(*trial, start);
            const std::chrono::duration<double, std::micro> took = Clock::now() - begin;
            tallies[m].add(*trial, result, took.count());
        }
        bound_rotation.push_back(trial->bound_rotation_rad);
        bound_position.push_back(trial->bound_position_m / setting.range_m);
        ++done;
    }
    PnpCell cell{in_words(setting.scene),
                 setting.points,
                 setting.noise_px,
                 setting.range_m,
                 setting.outliers,
                 quantile(bound_rotation, 0.5) * 180 / M_PI,
                 quantile(bound_position, 0.5),
                 {}};
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

bool is_nominal(const PnpCell& cell) {
    return cell.name == "nominal" && cell.outliers == 0;
}

/// Whether `ours` fails more often, by three standard deviations of the difference between equal solvers.
bool fails_more(const PnpRow& ours, const PnpRow& theirs) {
    const double pooled = 0.5 * (ours.failed + theirs.failed), n = ours.trials;
    return ours.failed - theirs.failed > 3 * std::sqrt(2 * pooled * (1 - pooled) / n);
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

PnpVerdict judge(const std::vector<PnpCell>& cells) {
    PnpVerdict v;
    for (const PnpCell& cell : cells) {
        const PnpRow *cold = cell.row(kPnpCold), *warm = cell.row(kPnpWarm);
        if (const PnpRow* peer = cell.row(kPnpPeerCold)) {
            v.cells_with_more_failures += fails_more(*cold, *peer) ? 1 : 0;
            if (is_nominal(cell))
                v.cold_time_ratio = std::max(v.cold_time_ratio, cold->median_us / peer->median_us);
        }
        if (const PnpRow* peer = cell.row(kPnpPeerWarm); peer != nullptr && is_nominal(cell))
            v.warm_time_ratio = std::max(v.warm_time_ratio, warm->median_us / peer->median_us);
        if (const PnpRow* peer = cell.row(kPnpPeerOutliers); peer != nullptr && cell.outliers <= 0.2)
            v.outlier_time_ratio = std::max(v.outlier_time_ratio, cold->median_us / peer->median_us);
        if (is_nominal(cell) && cell.points >= 10)
            v.worst_rms_bounds =
                std::max({v.worst_rms_bounds, cold->rotation_rms_bounds, cold->position_rms_bounds});
    }
    return v;
}

}  // namespace narpa
