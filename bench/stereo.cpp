#include "bench/stereo.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include "emulator/world.h"
#include "estimator/pose/pose_estimate.h"
#include "renderer/camera/camera_model.h"
#include "renderer/camera/detector.h"
#include "renderer/film/camera_image.h"

namespace narpa {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

const Camera* find_camera(const Scene& scene, const std::string& name) {
    const auto it = std::ranges::find(scene.cameras, name, &Camera::name);
    return it == scene.cameras.end() ? nullptr : &*it;
}

Vector3d direction(const Camera& c, const Vector2d& px) {
    return to_eigen(CameraModelHandle(c)->on_plane({px.x(), px.y()}));
}

/// One of the two cameras, where it is, and what is around it.
struct Station {
    const World& world;
    const BodyPoses& at;
    const Camera& camera;
    Rigid3 T_world_camera;

    [[nodiscard]] Result<MeasuredImage> frame(const StereoBenchSettings& s, std::uint32_t number) const {
        const RenderSettings& r = world.scene().render;
        FrameSettings f;
        f.spp = s.spp > 0 ? s.spp : r.spp;
        f.method = r.method, f.max_depth = r.max_depth;
        f.seed = r.seed, f.frame = number;
        RadianceImage radiance(camera.width, camera.height);
        render_radiance(world.render_scene(), at, camera, T_world_camera, f, radiance);
        std::vector<std::uint8_t> bytes(
            frame_bytes({camera.width, camera.height, camera.format, camera.period_ns}));
        expose(camera, radiance, r.seed, number, bytes);
        return measured_image(camera, bytes);
    }
    /// In the camera's frame.
    [[nodiscard]] std::optional<Vector3d> surface(const Vector2d& px) const {
        const Vec3 ray = normalized(to_vec3(direction(camera, px)));
        const Hit hit = world.tracer().intersect(at, {T_world_camera.t, T_world_camera.q * ray},
                                                 std::numeric_limits<double>::infinity());
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
    out.normalised_squared = std::pow(out.fine_error_m.z() / out.sigma_depth_m, 2);
    out.epipolar_sigmas = p.point.epipolar_sigmas;
    return out;
}

}  // namespace

Spread spread(std::vector<double> values) {
    Spread s;
    if (values.empty()) return s;
    for (double& v : values) {
        v = std::abs(v);
        s.rms += v * v / static_cast<double>(values.size());
    }
    s.rms = std::sqrt(s.rms);
    std::ranges::sort(values);
    const auto quantile = [&](double p) {
        const double at = p * static_cast<double>(values.size() - 1), part = at - std::floor(at);
        const auto i = static_cast<std::size_t>(at);
        return values[i] + part * (values[std::min(i + 1, values.size() - 1)] - values[i]);
    };
    s.lower_quartile = quantile(0.25), s.median = quantile(0.5), s.upper_quartile = quantile(0.75);
    s.largest = values.back();
    const double reach = 1.5 * (s.upper_quartile - s.lower_quartile);
    s.low = *std::ranges::find_if(values, [&](double v) { return v >= s.lower_quartile - reach; });
    for (const double v : values)
        if (v <= s.upper_quartile + reach) s.high = v;
    s.outliers = static_cast<int>(std::ranges::count_if(values, [&](double v) { return v < s.low || v > s.high; }));
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
    double sum = 0;
    for (const StereoBenchPoint& p : points) sum += p.normalised_squared;
    return sum / static_cast<double>(points.size());
}
double StereoBench::mean_epipolar_squared() const {
    double sum = 0;
    for (const StereoBenchPoint& p : points) sum += p.epipolar_sigmas * p.epipolar_sigmas;
    return sum / static_cast<double>(points.size());
}

Result<StereoBench> measure_stereo(const Scene& scene, const StereoBenchSettings& settings,
                                   const std::function<void(const std::string&)>& progress) {
    const Camera *left = find_camera(scene, "left"), *right = find_camera(scene, "right");
    if (!left || !right)
        return Error{"no stereo pair, expected two cameras with the names left and right", scene.file};
    progress("building");
    const auto world = World::create(scene);
    if (!world) return world.error();
    BodyPoses at(scene.bodies.size());
    (*world)->place(std::llround(settings.seconds * 1e9), -1, at);
    const auto station = [&](const Camera& c) {
        return Station{**world, at, c, (*world)->sensor_pose(c.mount, c.T_mount_camera, at)};
    };
    const Station l = station(*left), r = station(*right);
    StereoBench out;
    out.scene = scene.name;
    out.pair = {*left, *right, inverse(r.T_world_camera) * l.T_world_camera};

    const auto middle = l.surface({left->cx, left->cy});
    if (!middle)
        return Error{"the middle of the left frame sees no surface, expected ground to measure from", scene.file};

    const auto start = std::chrono::steady_clock::now();
    progress("left frame");
    auto left_frame = l.frame(settings, 2 * settings.frame);
    if (!left_frame) return left_frame.error();
    progress("right frame");
    const auto right_frame = r.frame(settings, 2 * settings.frame + 1);
    if (!right_frame) return right_frame.error();
    out.render_s = seconds_since(start);

    progress("matching");
    StereoSettings s;
    s.points_max = settings.points;
    s.nearest_m = settings.nearest_part * middle->z(), s.farthest_m = settings.farthest_part * middle->z();
    const auto match_start = std::chrono::steady_clock::now();
    const auto found = match_stereo(out.pair, *left_frame, *right_frame, s);
    if (!found) return found.error();
    out.match_s = seconds_since(match_start);
    out.counts = found->counts;
    for (const StereoPoint& p : found->points) {
        const auto point = beside_truth(out.pair, l, p);
        if (!point) return point.error();
        out.points.push_back(*point);
    }
    out.left = std::move(*left_frame);
    out.left_top_dn = sensor_model(*left).top_dn;
    return out;
}

std::vector<std::string> stereo_faults(const StereoBench& bench, int points) {
    std::vector<std::string> faults;
    if (static_cast<int>(bench.points.size()) < points)
        faults.push_back(fmt::format("{} points, expected {}", bench.points.size(), points));
    if (bench.points.empty()) return faults;
    if (!(bench.gain() >= kLeastStereoGain))
        faults.push_back(fmt::format("depth errors {:.1f} times below those of whole pixels, expected {:g}",
                                     bench.gain(), kLeastStereoGain));
    const double statistics = 3 * std::sqrt(2 / static_cast<double>(bench.points.size()));
    for (const auto& [name, mean] : {std::pair{"depth errors", bench.mean_normalised_squared()},
                                     {"distances from the epipolar line", bench.mean_epipolar_squared()}})
        if (!(mean < kVarianceFactor * (1 + statistics) && mean > (1 - statistics) / kVarianceFactor))
            faults.push_back(fmt::format("{} of {:.2f} predicted variances, expected about 1", name, mean));
    return faults;
}

}  // namespace narpa
