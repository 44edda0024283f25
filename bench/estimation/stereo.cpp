#include "bench/estimation/stereo.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/constants.h"
#include "base/time.h"
#include "bench/statistics.h"
#include "emulator/camera/camera_unit.h"
#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Depths that are searched, in parts of the depth in the middle of the left frame: what an altimeter would give.
constexpr double kNearestPart = 0.75, kFarthestPart = 1.5;

Vector3d direction(const Camera& c, const Vector2d& px) {
    return to_eigen(c.model->on_plane({px.x(), px.y()}));
}

/// One of the two cameras, and its frame at time 0.
struct Station {
    Station(const World& w, std::size_t index, std::uint32_t frame) : world(w), unit(w, index) {
        unit.expose(frame, 0);
        T_world_camera = world.camera_pose(unit.camera(), 0, unit.placement());
    }
    const World& world;
    CameraUnit unit;
    Rigid3 T_world_camera{};

    [[nodiscard]] Result<MeasuredImage> frame() const { return measured_image(unit.camera(), unit.bytes()); }
    /// In the camera's frame.
    [[nodiscard]] std::optional<Vector3d> surface(const Vector2d& px) const {
        const Vec3 ray = normalized(to_vec3(direction(unit.camera(), px)));
        const Hit hit =
            world.tracer().intersect(unit.placement(), {T_world_camera.t, T_world_camera.q * ray}, kInfinity);
        if (hit.body < 0) return {};
        return to_eigen(hit.range_m * ray);
    }
};

Result<StereoBenchPoint> beside_truth(const StereoPair& pair, const Station& left, const StereoPoint& p) {
    const auto truth = left.surface(p.left_px);
    const auto depth = printed_depth_m(pair, p.left_px, p.whole.px);
    if (!depth) return depth.error();
    if (!truth)
        return Error{
            fmt::format("pixel ({:g}, {:g}) was matched and sees no surface, expected one behind each match",
                        p.left_px.x(), p.left_px.y())};
    StereoBenchPoint out;
    out.left_px = p.left_px, out.right_px = p.match.px, out.truth_m = *truth;
    out.whole_error_m = *depth * direction(pair.left, p.left_px) - *truth;
    out.fine_error_m = p.point.point_m - *truth;
    out.sigma_depth_m = std::sqrt(p.point.covariance_m2(2, 2));
    out.epipolar_sigmas = p.point.epipolar_sigmas;
    return out;
}

}  // namespace

Spread spread(std::vector<double> values) {
    Spread s;
    if (values.empty()) return s;
    Mean all;
    for (double& v : values) all.add(v = std::abs(v));
    s.rms = all.rms();
    std::ranges::sort(values);
    const auto quantile = [&](double p) {
        const double at = p * static_cast<double>(values.size() - 1), part = at - std::floor(at);
        const auto i = static_cast<std::size_t>(at);
        return values[i] + part * (values[std::min(i + 1, values.size() - 1)] - values[i]);
    };
    s.lower_quartile = quantile(0.25), s.median = quantile(0.5), s.upper_quartile = quantile(0.75);
    s.largest = values.back();
    const double reach = 1.5 * (s.upper_quartile - s.lower_quartile);
    const auto low = std::ranges::lower_bound(values, s.lower_quartile - reach);
    const auto beyond = std::ranges::upper_bound(values, s.upper_quartile + reach);
    s.whiskers = {*low, *(beyond - 1)};
    s.outliers = static_cast<int>((low - values.begin()) + (values.end() - beyond));
    return s;
}

Spread StereoBench::errors(bool fine, int axis, bool relative) const {
    std::vector<double> values;
    for (const StereoBenchPoint& p : points)
        values.push_back((fine ? p.fine_error_m : p.whole_error_m)[axis] / (relative ? p.truth_m.norm() : 1));
    return spread(std::move(values));
}

double StereoBench::gain() const {
    return errors(false, 2, true).rms / errors(true, 2, true).rms;
}
double StereoBench::mean_normalised_squared() const {
    Mean sigmas;
    for (const StereoBenchPoint& p : points) sigmas.add(p.fine_error_m.z() / p.sigma_depth_m);
    return sigmas.rms() * sigmas.rms();
}
double StereoBench::mean_epipolar_squared() const {
    Mean sigmas;
    for (const StereoBenchPoint& p : points) sigmas.add(p.epipolar_sigmas);
    return sigmas.rms() * sigmas.rms();
}

Result<StereoBench> measure_stereo(const Scene& scene, int points,
                                   const std::function<void(const std::string&)>& progress) {
    const auto left = sensor_named(scene.cameras, "left", "camera", scene.file);
    if (!left) return left.error();
    const auto right = sensor_named(scene.cameras, "right", "camera", scene.file);
    if (!right) return right.error();
    progress("building");
    const auto world = World::create(scene);
    if (!world) return world.error();
    StereoBench out;
    out.scene = scene.name;
    progress("frames");
    const std::int64_t render_start_ns = monotonic_ns();
    const Station l(**world, *left, 0), r(**world, *right, 1);
    out.render_s = seconds_since(render_start_ns);
    const Camera& camera = l.unit.camera();
    out.pair = {camera, r.unit.camera(), inverse(r.T_world_camera) * l.T_world_camera};

    const Pinhole pinhole = paraxial_pinhole(*camera.model);
    const auto middle = l.surface({pinhole.cx, pinhole.cy});
    if (!middle)
        return Error{"the middle of the left frame sees no surface, expected ground to measure from", scene.file};
    auto left_frame = l.frame();
    if (!left_frame) return left_frame.error();
    const auto right_frame = r.frame();
    if (!right_frame) return right_frame.error();

    progress("matching");
    StereoSettings s;
    s.points_max = points;
    s.nearest_m = kNearestPart * middle->z(), s.farthest_m = kFarthestPart * middle->z();
    const std::int64_t match_start_ns = monotonic_ns();
    const auto found = match_stereo(out.pair, *left_frame, *right_frame, s);
    if (!found) return found.error();
    out.match_s = seconds_since(match_start_ns);
    out.counts = found->counts;
    for (const StereoPoint& p : found->points) {
        const auto point = beside_truth(out.pair, l, p);
        if (!point) return point.error();
        out.points.push_back(*point);
    }
    out.left = *std::move(left_frame);
    out.left_top_dn = sensor_model(camera).top_dn;
    return out;
}

std::vector<std::string> stereo_faults(const StereoBench& bench, int points) {
    std::vector<std::string> faults;
    if (static_cast<int>(bench.points.size()) < points)
        faults.push_back(fmt::format("{} points, expected {}", bench.points.size(), points));
    if (bench.points.empty()) return faults;
    if (!(bench.gain() >= kMinStereoGain))
        faults.push_back(fmt::format("depth errors {:.1f} times below those of whole pixels, expected {:g}",
                                     bench.gain(), kMinStereoGain));
    const double statistics = 3 * std::sqrt(2 / static_cast<double>(bench.points.size()));
    for (const auto& [name, mean] : {std::pair{"depth errors", bench.mean_normalised_squared()},
                                     {"distances from the epipolar line", bench.mean_epipolar_squared()}})
        if (!(mean < kVarianceFactor * (1 + statistics) && mean > (1 - statistics) / kVarianceFactor))
            faults.push_back(fmt::format("{} of {:.2f} predicted variances, expected about 1", name, mean));
    return faults;
}

}  // namespace narpa
