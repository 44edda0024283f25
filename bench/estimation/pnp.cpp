#include "bench/estimation/pnp.h"

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "bench/estimation/pnp_methods.h"
#include "bench/statistics.h"
#include "estimator/pnp/pnp_refine.h"

namespace narpa {
namespace {

constexpr double kPixels = 500;

/// The body's z axis this far from the line of sight, in any direction, and turned about itself by any angle.
Quat tilted(std::mt19937_64& random, double tilt_min_deg, double tilt_max_deg) {
    std::uniform_real_distribution<double> turn(-M_PI, M_PI), tilt(tilt_min_deg * kDegree, tilt_max_deg * kDegree);
    const double direction = turn(random);
    return exp_rotation(Vec3{std::cos(direction), std::sin(direction), 0} * tilt(random)) *
           exp_rotation({0, 0, turn(random)});
}

Quat attitude(PnpScene scene, std::mt19937_64& random) {
    switch (scene) {
        case PnpScene::half_turn: return displaced({}, random_error(179.9 * kDegree, 0, random)).q;
        case PnpScene::plane: return tilted(random, 20, 70);
        case PnpScene::plane_facing: return tilted(random, 0, 5);
        case PnpScene::camera_plane: return tilted(random, 0, 10);
        default: {
            std::normal_distribution<double> n;
            return normalized(Quat{n(random), n(random), n(random), n(random)});
        }
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

const char* to_text(PnpScene scene) {
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
        {&trial.camera, {trial.body_m.data(), trial.inliers}, {trial.pixels.data(), trial.inliers}, trial.sigma_px},
        trial.T_camera_body);
    if (!bound) return std::nullopt;
    trial.bound_rotation_rad = rotation_sigma(*bound);
    trial.bound_position_m = position_sigma(*bound);
    return trial;
}

namespace {

/// Errors beyond this many bounds are failures.
constexpr double kFailedAtBounds = 10;

/// Results of one method in a cell.
struct Tally {
    std::vector<double> rotation, position, us;
    Mean rotation_rms, position_rms;
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
            if (good) {
                rotation.push_back(r), position.push_back(p);
                rotation_rms.add(r), position_rms.add(p);
            }
        }
        failed += !good;
        flagged += !good && result.flagged;
    }
    [[nodiscard]] PnpRow row(const std::string& name) const {
        return {name,
                trials,
                quantile(rotation, 0.5),
                rotation_rms.rms(),
                quantile(position, 0.5),
                position_rms.rms(),
                static_cast<double>(failed) / std::max(1, trials),
                static_cast<double>(flagged) / std::max(1, failed),
                quantile(us, 0.5)};
    }
};

PnpCell run_cell(const PnpSetting& setting, const PnpBenchOptions& options, const StopFlag& stop) {
    std::mt19937_64 random(options.seed);
    const std::vector<PnpMethod> all = pnp_methods(setting);
    std::vector<Tally> tallies(all.size());
    std::vector<double> bound_rotation, bound_position;
    // OpenCV needs milliseconds for each trial with many outliers.
    const int trials = setting.outliers < 0.5 ? options.trials : (options.trials + 4) / 5;
    int left = 1000 + 10 * trials;  // at ranges where no draw determines a pose, the loop still ends
    for (int done = 0; done < trials && left > 0 && !stop; --left) {
        const auto trial = draw_trial(setting, random);
        if (!trial) continue;
        // A tracker's prediction: off by one degree and one per cent of the range.
        const Rigid3& truth = trial->T_camera_body;
        const Rigid3 start = displaced(truth, random_error(kDegree, 0.01 * truth.t.z, random));
        for (std::size_t m = 0; m < all.size(); ++m) {
            const std::int64_t start_ns = monotonic_ns();
            const PoseResult result = all[m].solve(*trial, start);
            tallies[m].add(*trial, result, 1e6 * seconds_since(start_ns));
        }
        bound_rotation.push_back(trial->bound_rotation_rad);
        bound_position.push_back(trial->bound_position_m / setting.range_m);
        ++done;
    }
    PnpCell cell{to_text(setting.scene),
                 setting.points,
                 setting.noise_px,
                 setting.range_m,
                 setting.outliers,
                 quantile(bound_rotation, 0.5) / kDegree,
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
    constexpr PnpSetting kHard[] = {{PnpScene::half_turn, 0, 0.5, 30},    {PnpScene::plane, 0, 0.5, 30},
                                    {PnpScene::plane_facing, 0, 0.5, 30}, {PnpScene::plane, 0, 0.5, 100},
                                    {PnpScene::line, 0, 0.5, 30},         {PnpScene::tiny, 0, 0.1, 200},
                                    {PnpScene::tiny, 0, 0.5, 200},        {PnpScene::camera_plane, 0, 0.5, 2}};
    for (const int n : {6, 10, 30})
        for (PnpSetting hard : kHard) hard.points = n, all.push_back(hard);
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
