#include "estimator/search/template_matcher.h"

#include <algorithm>
#include <cmath>

#include "renderer/camera/scene_camera.h"

namespace narpa {
namespace {

/// A pixel stands out by kStandsOut standard deviations of its noise plus this part of the background.
constexpr double kStandsOut = 5, kBackgroundPart = 0.03;
/// Target's extent, px, in the image in which the bright region is searched.
constexpr double kFindExtent_px = 24;
/// Side of the rendered window over the target's extent.
constexpr double kWindowPart = 1.6;
/// Range of the ratio of the frame's brightness to the model's: uncertainty of exposure and albedo.
constexpr double kMinBrightness = 0.8, kMaxBrightness = 1.25;
constexpr double kMaxScale = 2;

/// A pose outside the view that casts no shadow into it.
Rigid3 out_of_sight(double radius_m) {
    return {{}, {0, 0, -1e5 * radius_m}};
}

void place_target(const SearchView& known, const Rigid3& T_camera_target, BodyPoses& at, ModelView& view) {
    at.set(known.target, known.T_world_camera * T_camera_target);
    view.begin_frame(at, {}, {});
}

/// The frame as it would be without the target.
RadianceImage without_target(const SearchView& known, const Camera& camera, const FrameSettings& settings) {
    BodyPoses at = known.at;
    ModelView view(known.render_scene, camera, known.target, at);
    const Rigid3 away = out_of_sight(apparent_radius_m(known.render_scene.tracer(), known.target));
    place_target(known, away, at, view);
    view.render(away, settings, false);
    return view.radiance();
}

}  // namespace

double apparent_radius_m(const Tracer& tracer, std::size_t body) {
    const Vec3& axes = tracer.bounds(body).semi_axes_m;
    return std::min(tracer.bounding_radius_m(body), std::max({axes.x, axes.y, axes.z}));
}

double SearchView::extent_px() const {
    return 2 * apparent_radius_m(render_scene.tracer(), target) * camera.model->pixels_per_radian() / range_m;
}

Rigid3 SearchView::aimed(const Quat& q, const Vec3& direction, double distance_m) const {
    return {q, distance_m * direction - q * render_scene.tracer().bounds(target).centre_m};
}

std::optional<BrightRegion> find_bright_region(const SearchView& known, const MeasuredImage& frame) {
    const int factor = std::clamp(static_cast<int>(known.extent_px() / kFindExtent_px), 1, 16);
    const Camera camera = coarser_camera(known.camera, factor);
    const MeasuredImage image = coarser_image(frame, factor);
    const SensorModel sensor = sensor_model(known.camera);
    FrameSettings settings;
    settings.spp = 4;
    const RadianceImage background = without_target(known, camera, settings);
    std::vector<double> light(image.dn.size());
    for (std::size_t p = 0; p < light.size(); ++p) {
        const double expected = sensor.dn(background.pixels[p]);
        const double over = std::abs(static_cast<double>(image.dn[p]) - expected);
        const double noise = std::sqrt(sensor.variance_dn2(expected)) / factor;
        if (over > kStandsOut * noise + kBackgroundPart * (expected - sensor.black_dn)) light[p] = over;
    }
    // An isolated pixel is a defect or a star.
    const auto beside = [&](int x, int y) {
        int n = 0;
        for (int j = std::max(0, y - 1); j <= std::min(y + 1, image.height - 1); ++j)
            for (int i = std::max(0, x - 1); i <= std::min(x + 1, image.width - 1); ++i)
                n += light[image.index(i, j)] > 0;
        return n - 1;
    };
    BrightRegion region;
    double sum = 0;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double w = light[image.index(x, y)];
            if (!(w > 0) || beside(x, y) < 1) continue;
            region.x += w * x, region.y += w * y, sum += w;
            region.pixels += factor * factor;
        }
    if (!(sum > 0)) return {};
    region.x = (region.x / sum + 0.5) * factor - 0.5;
    region.y = (region.y / sum + 0.5) * factor - 0.5;
    return region;
}

TemplateMatcher::TemplateMatcher(const SearchView& known, const FrameView& frame, const BrightRegion& region,
                                 double size_px, int spp)
    : known_(known),
      frame_(frame),
      sensor_(sensor_model(known.camera)),
      noise_(sensor_),
      scale_(std::min(1.0, size_px / known.extent_px())),
      side_(static_cast<int>(kWindowPart * known.extent_px() * scale_) + 4),
      left_(static_cast<int>(std::lround(scale_ * (region.x + 0.5) - 0.5 * side_))),
      top_(static_cast<int>(std::lround(scale_ * (region.y + 0.5) - 0.5 * side_))),
      camera_(windowed(scaled(known.camera, scale_, scale_), left_, top_, side_, side_)) {
    settings_.spp = spp;
    const RadianceImage background = without_target(known, camera_, settings_);
    std::vector<double> light;
    for (std::size_t p = 0; p < background.pixels.size(); ++p)
        background_.push_back(noise_(sensor_.dn(background.pixels[p])));
    for (int y = 0; y < side_; ++y)
        for (int x = 0; x < side_; ++x) light.push_back(frame_light(x, y, 1));
    of_frame_ = spread(light);
}

double TemplateMatcher::sensor_px(double template_px, int first) const {
    return (template_px + first + 0.5) / scale_ - 0.5;
}

bool TemplateMatcher::is_inside(std::size_t p) const {
    const auto side = static_cast<std::size_t>(side_);
    return frame_.holds(sensor_px(static_cast<double>(p % side), left_),
                        sensor_px(static_cast<double>(p / side), top_));
}

double TemplateMatcher::light_of(const RadianceImage& image, std::size_t p) const {
    return noise_(sensor_.dn(image.pixels[p])) - background_[p];
}

/// Mean light of a square in the frame, in template pixels.
double TemplateMatcher::frame_light(double x, double y, double side) const {
    const auto nearest = [this](double v) { return std::clamp(static_cast<int>(std::lround(v)), 0, side_ - 1); };
    const auto p = static_cast<std::size_t>(nearest(y) * side_ + nearest(x));
    return noise_(frame_.mean(sensor_px(x, left_), sensor_px(y, top_), side / scale_)) - background_[p];
}

/// Centroid and spread of the pixels that stand out within the frame.
TemplateMatcher::Spread TemplateMatcher::spread(const std::vector<double>& light) const {
    const double least = kStandsOut * scale_;
    double sum = 0, squares = 0;
    Spread s;
    for (std::size_t p = 0; p < light.size(); ++p) {
        const double w = light[p];
        if (!(w > least + kBackgroundPart * background_[p]) || !is_inside(p)) continue;
        const auto x = static_cast<double>(p % static_cast<std::size_t>(side_));
        const auto y = static_cast<double>(p / static_cast<std::size_t>(side_));
        sum += w, s.x += w * x, s.y += w * y, squares += w * (x * x + y * y + 1.0 / 6);
        s.energy += w * w;
    }
    if (!(sum > 0)) return s;
    s.x /= sum, s.y /= sum;
    s.radius = std::sqrt(std::max(0.0, squares / sum - s.x * s.x - s.y * s.y));
    return s;
}

TemplateMatcher::Worker::Worker(const TemplateMatcher& matcher)
    : m_(matcher),
      at_(matcher.known_.at),
      view_(matcher.known_.render_scene, matcher.camera_, matcher.known_.target, at_),
      light_(matcher.background_.size()) {}

Hypothesis TemplateMatcher::Worker::compare(const Rigid3& T) {
    const SearchView& known = m_.known_;
    Hypothesis out{T, 1};
    place_target(known, T, at_, view_);
    view_.render(T, m_.settings_, false);
    for (std::size_t p = 0; p < light_.size(); ++p) light_[p] = m_.light_of(view_.radiance(), p);
    const Spread rendered = m_.spread(light_), &seen = m_.of_frame_;
    if (!rendered.any() || !seen.any()) return out;

    const double range_m = norm(T.t);
    double k = std::clamp(seen.radius / rendered.radius, range_m / known.max_m, range_m / known.min_m);
    k = std::clamp(k, 1 / kMaxScale, kMaxScale);
    double both = 0, own = 0;
    for (int y = 0; y < m_.side_; ++y)
        for (int x = 0; x < m_.side_; ++x) {
            const double u = seen.x + k * (x - rendered.x), v = seen.y + k * (y - rendered.y);
            if (!m_.frame_.holds(m_.sensor_px(u, m_.left_), m_.sensor_px(v, m_.top_))) continue;
            const double light = light_[static_cast<std::size_t>(y * m_.side_ + x)];
            if (light == 0) continue;
            both += light * m_.frame_light(u, v, k), own += light * light;
        }
    if (!(own > 0)) return out;
    const double gain = std::clamp(both / own, std::sqrt(kMinBrightness), std::sqrt(kMaxBrightness));
    out.misfit = 1 - (2 * gain * both - gain * gain * own) * k * k / seen.energy;

    const CameraModel& model = *m_.camera_.model;
    const Vec3 centre = T * known.render_scene.tracer().bounds(known.target).centre_m;
    const auto at = model.project(centre);
    if (!at) return {T, 1};
    const Vec3 direction = model.direction({seen.x + k * (at->x - rendered.x), seen.y + k * (at->y - rendered.y)});
    out.T_camera_target = known.aimed(T.q, direction, norm(centre) / k);
    return out;
}

}  // namespace narpa
