#include "estimator/dense/level_view.h"

#include <algorithm>
#include <cmath>

namespace narpa {
namespace {

/// Pixels around the target's bounds, and part of their extent, for it to move in and for its edges to be seen.
constexpr double kRoom_px = 6, kRoomPart = 0.1;
/// Windows begin and end at multiples of this, so that small moves do not change them.
constexpr int kRounding_px = 8;

/// Of an ellipsoid's outline along one axis of the normalised image: tangents of its dual conic.
struct Extremes {
    double low = 0, high = 0;
};
Extremes extremes(const Eigen::Matrix3d& dual, int axis) {
    const double middle = dual(axis, 2) / dual(2, 2);
    const double half = std::sqrt(std::max(middle * middle - dual(axis, axis) / dual(2, 2), 0.0));
    return {middle - half, middle + half};
}

/// Pixels from the first to the last, clipped; count 0: none.
struct Interval {
    int first = 0, count = 0;
};
Interval rounded(double low_px, double high_px, int size) {
    const double room = kRoom_px + kRoomPart * (high_px - low_px);
    const auto limit = [&](double px) { return std::clamp(px, 0.0, static_cast<double>(size)); };
    const double first = kRounding_px * std::floor((low_px - room) / kRounding_px);
    const double last = kRounding_px * std::ceil((high_px + room) / kRounding_px);
    const int begin = static_cast<int>(limit(first));
    return {begin, static_cast<int>(limit(last)) - begin};
}

}  // namespace

std::optional<Window> window_about(const Tracer& tracer, const Camera& camera, std::size_t target,
                                   const Rigid3& T_camera_target) {
    const BodyBounds& bounds = tracer.bounds(target);
    const Eigen::Vector3d centre = to_eigen(T_camera_target * bounds.centre_m);
    Eigen::Matrix3d axes;
    const auto turned = columns(T_camera_target.q);
    for (int k = 0; k < 3; ++k) axes.col(k) = bounds.semi_axes_m[k] * to_eigen(turned[static_cast<std::size_t>(k)]);
    const Eigen::Matrix3d shape = axes * axes.transpose();
    const double depth_m = std::sqrt(shape(2, 2));
    if (!(centre.z() + depth_m > 0)) return {};
    if (centre.z() - depth_m <= 0) return Window{0, 0, camera.width, camera.height};  // the camera may be inside
    const Eigen::Matrix3d dual = shape - centre * centre.transpose();
    const Extremes u = extremes(dual, 0), v = extremes(dual, 1);
    const double left = camera.cx + camera.fx * u.low, right = camera.cx + camera.fx * u.high;
    const double top = camera.cy + camera.fy * v.low, bottom = camera.cy + camera.fy * v.high;
    if (right < -0.5 || bottom < -0.5 || left > camera.width - 0.5 || top > camera.height - 0.5) return {};
    const Interval x = rounded(left, right, camera.width), y = rounded(top, bottom, camera.height);
    return Window{x.first, y.first, x.count, y.count};
}

double extent_px(const Window& window) {
    return std::max(window.width, window.height);
}

Camera window_camera(const Camera& camera, const Window& window) {
    Camera c = camera;
    c.width = window.width, c.height = window.height;
    c.cx -= window.x, c.cy -= window.y;
    return c;
}

LevelView::LevelView(const RenderScene& render_scene, const Camera& camera, const Window& window,
                     std::size_t target, const BodyPoses& at)
    : window_(window),
      view_(render_scene, window_camera(camera, window), target, at),
      derivative_(render_scene, window_camera(camera, window), target, at) {
    const std::size_t n = static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height);
    measured_.resize(n);
    signal_.resize(n);
    signal_variance_.resize(n);
}

void LevelView::place_bodies(const BodyPoses& at) {
    view_.place_bodies(at);
    derivative_.place_bodies(at);
}

void LevelView::measure(const MeasuredImage& image, std::span<const float> variance) {
    measured_variance_.resize(variance.empty() ? 0 : measured_.size());
    std::size_t to = 0;
    for (int y = 0; y < window_.height; ++y)
        for (int x = 0; x < window_.width; ++x, ++to) {
            const auto from = static_cast<std::size_t>(y + window_.y) * static_cast<std::size_t>(image.width) +
                              static_cast<std::size_t>(x + window_.x);
            measured_[to] = image.dn[from];
            if (!variance.empty()) measured_variance_[to] = variance[from];
        }
}

void LevelView::render(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings) {
    view_.render(T_camera_target, settings, true);
    const auto& k = sensor.dn_per_radiance;
    const double per_mean_band = k[0] + k[1] + k[2];
    for (std::size_t i = 0; i < signal_.size(); ++i) {
        const Vec3 L = vec_cast<double>(view_.radiance().pixels[i]);
        signal_[i] = static_cast<float>(k[0] * L.x + k[1] * L.y + k[2] * L.z);
        signal_variance_[i] = static_cast<float>(per_mean_band * per_mean_band) * view_.aovs().variance[i];
    }
}

void LevelView::differentiate(const Rigid3& T_camera_target, const SensorModel& sensor,
                              const FrameSettings& settings, int fineness) {
    columns_ = derivative_.at(T_camera_target, sensor, settings, fineness);
}

PhotometricImages LevelView::images(double pixels_averaged) const {
    return {window_.width, window_.height,   measured_, measured_variance_,
            signal_,       signal_variance_, columns_,  pixels_averaged};
}

}  // namespace narpa
