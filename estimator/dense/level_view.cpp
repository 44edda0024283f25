#include "estimator/dense/level_view.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "base/constants.h"
#include "estimator/least_squares/median.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/integrator/shading.h"

namespace narpa {
namespace {

/// Margin about the target's bounds, in pixels and as a part of their extent.
constexpr double kRoom_px = 6, kRoomPart = 0.1;
/// Windows begin and end at multiples of this, so that small motions do not change them.
constexpr int kRounding_px = 8;

/// Polygon around an ellipsoid's outline as the camera sees it, camera axes; empty if the camera is inside.
std::optional<std::array<Vec3, 32>> outline(const BodyBounds& bounds, const Rigid3& T_camera_target) {
    // In the space where the ellipsoid is a unit sphere the outline is a circle.
    const Vec3 eye = (inverse(T_camera_target).t - bounds.centre_m) / bounds.semi_axes_m;
    const double distance = norm(eye);
    if (!(distance > 1)) return {};
    const Vec3 z = eye / distance;
    const Vec3 x = normalized(cross(z, std::abs(z.x) < 0.5 ? Vec3{1, 0, 0} : Vec3{0, 1, 0})), y = cross(z, x);
    std::array<Vec3, 32> corners;
    const double step = 2 * std::numbers::pi / static_cast<double>(corners.size());
    const double radius = std::sqrt(1 - 1 / (distance * distance)) / std::cos(0.5 * step);
    for (std::size_t i = 0; i < corners.size(); ++i) {
        const double angle = step * static_cast<double>(i);
        const Vec3 corner = z / distance + radius * (std::cos(angle) * x + std::sin(angle) * y);
        corners[i] = T_camera_target * (bounds.centre_m + corner * bounds.semi_axes_m);
    }
    return corners;
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

/// True if one of the pixel's neighbours is lit.
bool is_beside_light(const std::vector<float>& signal, std::size_t width, std::size_t p) {
    for (const std::size_t middle : {p - width, p, p + width})
        for (const std::size_t q : {middle - 1, middle, middle + 1})
            if (signal[q] > 0) return true;
    return false;
}
/// True if the pixel and its neighbours are lit: it does not show the sky, which is light of method path alone.
bool is_surrounded_by_light(const std::vector<float>& signal, std::size_t width, std::size_t p) {
    for (const std::size_t middle : {p - width, p, p + width})
        for (const std::size_t q : {middle - 1, middle, middle + 1})
            if (!(signal[q] > 0)) return false;
    return true;
}

}  // namespace

Window joined(const Window& a, const Window& b) {
    const int x = std::min(a.x, b.x), y = std::min(a.y, b.y);
    return {x, y, std::max(a.x + a.width, b.x + b.width) - x, std::max(a.y + a.height, b.y + b.height) - y};
}

std::optional<Window> window_about(const Tracer& tracer, const Camera& camera, std::size_t target,
                                   const Rigid3& T_camera_target) {
    const Window whole{0, 0, camera.width, camera.height};
    const auto corners = outline(tracer.bounds(target), T_camera_target);
    if (!corners) return whole;
    double left = kInfinity, right = -kInfinity, top = kInfinity, bottom = -kInfinity;
    std::size_t without_image = 0;
    for (const Vec3& corner : *corners) {
        const auto p = camera.model->project(corner);
        if (!p)
            ++without_image;
        else
            left = std::min(left, p->x), right = std::max(right, p->x), top = std::min(top, p->y),
            bottom = std::max(bottom, p->y);
    }
    if (without_image == corners->size()) return {};
    if (without_image > 0) return whole;
    if (right < -0.5 || bottom < -0.5 || left > camera.width - 0.5 || top > camera.height - 0.5) return {};
    const Interval x = rounded(left, right, camera.width), y = rounded(top, bottom, camera.height);
    return Window{x.first, y.first, x.count, y.count};
}

double extent_px(const Window& window) {
    return std::max(window.width, window.height);
}

LevelView::LevelView(const RenderScene& render_scene, const Camera& camera, const SensorModel& sensor,
                     double pixels_averaged, const Window& window, std::size_t target, const BodyPoses& at)
    : sensor_(sensor),
      pixels_averaged_(pixels_averaged),
      window_(window),
      target_(target),
      at_(at),
      render_scene_(render_scene),
      view_(render_scene, windowed(camera, window.x, window.y, window.width, window.height), target, at),
      derivative_(render_scene, windowed(camera, window.x, window.y, window.width, window.height), target, at) {
    const std::size_t n = static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height);
    measured_.resize(n);
    signal_.resize(n);
    signal_variance_.resize(n);
}

void LevelView::begin_frame(const BodyPoses& at, const ApparentMotion& motion, const RowTimes& times,
                            const ModelUncertainty& model, const std::optional<Rigid3>& T_world_camera) {
    differentiated_at_.reset();
    chosen_.clear();
    added_.clear();
    detail_dn2_ = 0;
    ignored_.clear();
    at_ = at, motion_ = motion, times_ = times.from(window_.y), model_ = model, T_world_camera_ = T_world_camera;
    view_.begin_frame(at_, motion_, times_);
    derivative_.begin_frame(at_, motion_, times_);
}

void LevelView::measure(const MeasuredImage& image, std::span<const float> variance) {
    assert(window_.x + window_.width <= image.width && window_.y + window_.height <= image.height);
    assert(variance.empty() || variance.size() == image.dn.size());
    measured_variance_.resize(variance.empty() ? 0 : measured_.size());
    measured_clipped_.resize(image.clipped.empty() ? 0 : measured_.size());
    std::size_t to = 0;
    for (int y = 0; y < window_.height; ++y)
        for (int x = 0; x < window_.width; ++x, ++to) {
            const auto from = static_cast<std::size_t>(y + window_.y) * static_cast<std::size_t>(image.width) +
                              static_cast<std::size_t>(x + window_.x);
            measured_[to] = image.dn[from];
            if (!variance.empty()) measured_variance_[to] = variance[from];
            if (!image.clipped.empty()) measured_clipped_[to] = image.clipped[from];
        }
}

/// If the camera's pose in the world is known, the target's pose determines its illumination.
void LevelView::place(const Rigid3& T_camera_target) {
    if (!T_world_camera_) return;
    at_.set(target_, *T_world_camera_ * T_camera_target);
    view_.begin_frame(at_, motion_, times_);
    derivative_.begin_frame(at_, motion_, times_);
}

void LevelView::render(const Rigid3& T_camera_target, const FrameSettings& settings) {
    place(T_camera_target);
    view_.render_with_variance(T_camera_target, settings, chosen_);
    const auto& k = sensor_.dn_per_radiance;
    const double per_mean_band = k[0] + k[1] + k[2];
    for (std::size_t i = 0; i < signal_.size(); ++i) {
        if (!is_chosen(i)) continue;
        signal_[i] =
            static_cast<float>(sensor_.signal(view_.radiance().pixels[i])) + (added_.empty() ? 0 : added_[i]);
        signal_variance_[i] = static_cast<float>(per_mean_band * per_mean_band) * view_.aovs().variance[i];
    }
    if (model_.detail > 0 && detail_dn2_ == 0) detail_dn2_ = model_.detail * model_.detail * signal_power(images());
}

void LevelView::add_light(std::span<const float> signal) {
    assert(signal.size() == signal_.size());
    added_.resize(signal_.size());
    for (std::size_t i = 0; i < signal.size(); ++i) added_[i] += signal[i], signal_[i] += signal[i];
}

void LevelView::allow_for_missed_light(int samples) {
    const auto width = static_cast<std::size_t>(window_.width);
    for (int y = 1; y < window_.height - 1; ++y)
        for (int x = 1; x < window_.width - 1; ++x) {
            const std::size_t p = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
            float least = signal_[p], most = least;
            for (const std::size_t middle : {p - width, p, p + width})
                for (const std::size_t q : {middle - 1, middle, middle + 1})
                    least = std::min(least, signal_[q]), most = std::max(most, signal_[q]);
            const float half_a_sample = 0.5f * (most - least) / static_cast<float>(samples);
            signal_variance_[p] = std::max(signal_variance_[p], half_a_sample * half_a_sample);
        }
}

void LevelView::predict(const Vector6& step) {
    for (std::size_t i = 0; i < signal_.size(); ++i) signal_[i] += columns_[i].dot(step.cast<float>());
}

void LevelView::choose(std::vector<std::uint8_t> pixels) {
    assert(pixels.size() == signal_.size());
    chosen_ = std::move(pixels);
    for (std::size_t i = 0; i < columns_.size(); ++i)
        if (chosen_[i] == 0) columns_[i].setZero();
}

void LevelView::choose_all() {
    if (chosen_.empty()) return;
    chosen_.clear();
    differentiated_at_.reset();
}

std::vector<float> LevelView::change_with_light(const Rigid3& T_camera_target, const FrameSettings& settings,
                                                const Vec3& turn_rad) {
    BodyPoses turned = at_;
    turned.T_world_body[target_].q = normalized(at_.T_world_body[target_].q * exp_rotation(turn_rad));
    view_.begin_frame(turned, motion_, times_);
    view_.render_with_variance(T_camera_target, settings, chosen_);
    std::vector<float> change;
    for (std::size_t i = 0; i < signal_.size(); ++i)
        change.push_back(is_chosen(i) ? static_cast<float>(sensor_.signal(view_.radiance().pixels[i])) - signal_[i]
                                      : 0);
    view_.begin_frame(at_, motion_, times_);
    return change;
}

std::vector<float> LevelView::rendered() const {
    std::vector<float> out;
    out.reserve(signal_.size());
    for (const Rgb& radiance : view_.radiance().pixels) out.push_back(static_cast<float>(sensor_.signal(radiance)));
    return out;
}

std::vector<std::vector<float>> LevelView::changes_with_light(const Rigid3& T_camera_target,
                                                              const FrameSettings& settings) {
    const auto& sun = render_scene_.scene().sun;
    if (!sun) return {};
    constexpr double kTurn_rad = 3 * std::numbers::pi / 180;
    view_.render_with_variance(T_camera_target, settings);
    const std::vector<float> unturned = rendered();
    const Vec3 to_sun = conjugate(at_.T_world_body[target_].q) * normalized(sun->direction);
    const Vec3 across = normalized(cross(to_sun, std::abs(to_sun.z) < 0.5 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}));
    std::vector<std::vector<float>> changes;
    for (const Vec3& axis : {across, cross(to_sun, across)}) {
        BodyPoses turned = at_;
        turned.T_world_body[target_].q = normalized(at_.T_world_body[target_].q * exp_rotation(kTurn_rad * axis));
        view_.begin_frame(turned, motion_, times_);
        view_.render_with_variance(T_camera_target, settings);
        changes.push_back(rendered());
        for (std::size_t p = 0; p < unturned.size(); ++p)
            changes.back()[p] = (changes.back()[p] - unturned[p]) / static_cast<float>(kTurn_rad);
    }
    view_.begin_frame(at_, motion_, times_);
    return changes;
}

std::vector<float> LevelView::ambient_light() const {
    constexpr int kAcross = 2;  // rays across a pixel
    std::vector<float> out(signal_.size());
    HitBatch hits;
    std::array<ImagePoint, kLanes> points;
    for (int y = 0; y < window_.height; ++y)
        for (int first = 0; first < window_.width * kAcross * kAcross; first += static_cast<int>(kLanes)) {
            const int n = std::min(static_cast<int>(kLanes), window_.width * kAcross * kAcross - first);
            for (int i = 0; i < n; ++i) {
                const int ray = (first + i) % (kAcross * kAcross);
                points[static_cast<std::size_t>(i)] = {
                    (first + i) / (kAcross * kAcross) + (ray % kAcross + 0.5) / kAcross - 0.5,
                    y + (ray / kAcross + 0.5) / kAcross - 0.5};
            }
            view_.trace_pixels(std::span(points).first(static_cast<std::size_t>(n)), hits);
            for (int i = 0; i < n; ++i) {
                const Hit hit = hits[static_cast<std::size_t>(i)];
                if (hit.body != static_cast<int>(target_)) continue;
                const Vec3 along = normalized(hit.position - view_.T_world_camera().t);
                const double width_m = hit.range_m / view_.camera().model->pixels_per_radian();
                const Surface surface = surface_at(view_.tracer(), view_.placement(), hit, along, width_m);
                out[static_cast<std::size_t>(y * window_.width + (first + i) / (kAcross * kAcross))] +=
                    static_cast<float>(sensor_.signal(ambient_reflectance(surface)));
            }
        }
    const float most = out.empty() ? 0 : *std::ranges::max_element(out);
    if (most > 0)
        for (float& v : out) v /= most;
    return out;
}

std::vector<float> LevelView::indirect_light(const Rigid3& T_camera_target, FrameSettings settings) {
    settings.mechanisms.separate_sun = false;
    view_.render_with_variance(T_camera_target, settings);
    const std::vector<float> direct = rendered();
    settings.method = RenderSettings::Method::path;
    view_.render_with_variance(T_camera_target, settings);
    const std::vector<float> both = rendered();
    const bool dark_sky = render_scene_.scene().ambient == Rgb{};
    std::vector<float> indirect(direct.size());
    const auto width = static_cast<std::size_t>(window_.width);
    for (int y = 1; y < window_.height - 1; ++y)
        for (int x = 1; x < window_.width - 1; ++x) {
            const std::size_t p = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
            if (dark_sky || is_surrounded_by_light(direct, width, p)) indirect[p] = both[p] - direct[p];
        }
    return indirect;
}

void LevelView::differentiate(const Rigid3& T_camera_target, const FrameSettings& settings, int fineness) {
    place(T_camera_target);
    const auto all = derivative_.at(T_camera_target, sensor_, settings, fineness, lit());
    columns_.assign(all.begin(), all.end());
    differentiated_at_ = T_camera_target, fineness_ = fineness;
    if (T_world_camera_) add_shading(T_camera_target, settings);
    if (model_.detail > 0) find_clutter();
}

/// A target in front of clutter, which the scene lacks: its outline's brightness steps are not those of the model,
/// so pixels beside the sky are ignored. There is clutter if half of them are brighter or darker than the sky by
/// more than the details that the model lacks.
void LevelView::find_clutter() {
    const auto width = static_cast<std::size_t>(window_.width);
    std::vector<std::uint8_t> beside_sky(signal_.size());
    std::vector<float> off_dn;
    for (int y = 1; y < window_.height - 1; ++y)
        for (int x = 1; x < window_.width - 1; ++x) {
            const std::size_t p = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
            if (is_surrounded_by_light(signal_, width, p)) continue;
            beside_sky[p] = 1;
            if (!(signal_[p] > 0) && is_beside_light(signal_, width, p))
                off_dn.push_back(std::abs(measured_[p] - static_cast<float>(sensor_.black_dn)));
        }
    const bool clutter =
        !off_dn.empty() && upper_median(std::span(off_dn)) > static_cast<float>(std::sqrt(detail_dn2_));
    ignored_ = clutter ? std::move(beside_sky) : std::vector<std::uint8_t>{};
}

/// Mask: not 0 where a chosen pixel or one of its neighbours is lit.
std::vector<std::uint8_t> LevelView::lit() const {
    std::vector<std::uint8_t> out(signal_.size());
    const auto width = static_cast<std::size_t>(window_.width);
    const auto is_lit = [&](std::size_t p) {
        return signal_[p - 1] != 0 || signal_[p] != 0 || signal_[p + 1] != 0;
    };
    for (int y = 1; y < window_.height - 1; ++y)
        for (int x = 1; x < window_.width - 1; ++x) {
            const std::size_t p = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
            if (!is_chosen(p)) continue;
            out[p] = is_lit(p - width) || is_lit(p) || is_lit(p + width) ? 1 : 0;
        }
    return out;
}

/// Adds the change of shading as the target turns relative to its light, by finite differences.
void LevelView::add_shading(const Rigid3& T_camera_target, const FrameSettings& settings) {
    constexpr double kTurn_rad = 0.01;
    for (int axis = 0; axis < 3; ++axis) {
        Vec3 turn{};
        turn[axis] = kTurn_rad;
        const auto change = change_with_light(T_camera_target, settings, conjugate(T_camera_target.q) * turn);
        for (std::size_t i = 0; i < change.size(); ++i)
            columns_[i][axis] += change[i] / static_cast<float>(kTurn_rad);
    }
}

std::optional<Vec3> LevelView::flat_face() const {
    constexpr int kRaysAcross = 32;
    constexpr double kSteps = 100;  // quantisation steps of a normal's components
    const int step = std::max(1, std::max(window_.width, window_.height) / kRaysAcross);
    std::map<std::array<long, 3>, int> faces;
    int all = 0;
    HitBatch hits;
    for (int y = 0; y < window_.height; y += step)
        for (int x = 0; x < window_.width;) {
            std::array<ImagePoint, kLanes> points;
            std::size_t n = 0;
            for (; n < kLanes && x < window_.width; x += step) points[n++] = {1.0 * x, 1.0 * y};
            view_.trace_pixels(std::span(points).first(n), hits);
            for (std::size_t lane = 0; lane < n; ++lane) {
                if (hits.body[lane] != static_cast<int>(target_)) continue;
                const Vec3 face = kSteps * hits.geometric_normal[lane];
                ++faces[{std::lround(face.x), std::lround(face.y), std::lround(face.z)}];
                ++all;
            }
        }
    const auto largest = std::ranges::max_element(faces, {}, [](const auto& face) { return face.second; });
    if (largest == faces.end() || 3 * largest->second < all) return {};
    const auto& [x, y, z] = largest->first;
    return conjugate(view_.T_world_camera().q) *
           normalized(Vec3{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)});
}

PhotometricImages LevelView::images() const {
    return {.width = window_.width,
            .height = window_.height,
            .sensor = sensor_,
            .measured = measured_,
            .measured_variance = measured_variance_,
            .signal = signal_,
            .signal_variance = signal_variance_,
            .derivative = columns_,
            .pixels_averaged = pixels_averaged_,
            .prior = {.gain_sigma = std::hypot(ExposurePrior{}.gain_sigma, model_.albedo),
                      .offset_sigma_dn = std::hypot(ExposurePrior{}.offset_sigma_dn, std::sqrt(detail_dn2_))},
            .measured_clipped = measured_clipped_,
            .chosen = chosen_,
            .ignored = ignored_,
            .model_part = model_.light_rad,
            .detail_dn2 = detail_dn2_};
}

}  // namespace narpa
