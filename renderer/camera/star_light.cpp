#include "renderer/camera/star_light.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "base/constants.h"
#include "renderer/detector/solar_bands.h"
#include "renderer/geometry/flush_denormals.h"
#include "renderer/optics/lens.h"

namespace narpa {
namespace {

constexpr double kSolarV = -26.76, kSolarIrradiance_w_m2 = 1361;
constexpr std::size_t kBuffer = 1024;                ///< segments that are traced and drawn together
constexpr std::size_t kMaxSegments = 4096;           ///< of a trail; longer ones have longer segments
constexpr std::size_t kSegmentsOfMovingBodies = 16;  ///< minimum where moving bodies may pass in front of stars
constexpr int kRowsOfTask = 8;
constexpr double kWidestDisc_px = 60;

/// Radiance of a blackbody in a band, in some unit.
double blackbody(const SolarBand& band, double temperature_k) noexcept {
    constexpr double kBoltzmann = 1.380649e-23, kSecond = kPlanck_j_s * kLightSpeed_m_s / kBoltzmann;
    constexpr int kIntervals = 32;  // Simpson's rule: exact to 1e-6
    double sum = 0;
    for (int i = 0; i <= kIntervals; ++i) {
        const double lambda_m = band.low_m + (band.high_m - band.low_m) * i / kIntervals;
        const double weight = i == 0 || i == kIntervals ? 1 : i % 2 == 1 ? 4 : 2;
        sum += weight * std::pow(lambda_m * 1e6, -5) / std::expm1(kSecond / (lambda_m * temperature_k));
    }
    return sum;
}

/// Diameter of a star's image where the lens is not focused at infinity.
double disc_px(const Camera& camera) noexcept {
    return camera.optics.lens
               ? std::min(circle_of_confusion_px(*camera.optics.lens, camera.model->pixels_per_radian(), kInfinity),
                          kWidestDisc_px)
               : 0;
}

/// Points per pixel along a trail such that the trail is even: the transfer at the points' spatial frequency is
/// below 1 %. Without any blur, one point per step of the response is even.
double points_per_px(const PointSpreadFunction& spread) noexcept {
    for (const double n : {2.0, 4.0, 8.0})
        if (std::abs(transfer(spread, n, 0)) < 0.01) return n;
    return PointResponse::kSteps;
}

/// The part of a segment that falls into a row's exposure.
struct Exposed {
    double share = 0;           ///< of the row's exposure
    double begin = 0, end = 1;  ///< fractions of the segment
};
Exposed exposed(const CameraPose& pose, int y, int rows, double start, double end) noexcept {
    if (!pose.over_time()) return {.share = 1};
    const double row_start = pose.time(y, rows, 0), row_end = std::max(pose.time(y, rows, 1), row_start + 1e-9);
    const double from = std::max(start, row_start), to = std::min(end, row_end);
    if (from >= to) return {};
    return {(to - from) / (row_end - row_start), (from - start) / (end - start), (to - start) / (end - start)};
}

}  // namespace

Rgb star_irradiance(double v_magnitude, double b_v) noexcept {
    const double temperature_k = 4600 * (1 / (0.92 * b_v + 1.7) + 1 / (0.92 * b_v + 0.62));
    const double irradiance = kSolarIrradiance_w_m2 * std::pow(10, -0.4 * (v_magnitude - kSolarV));
    const auto of_sun = [&](const SolarBand& band) {
        return blackbody(band, temperature_k) / blackbody(band, kSolarTemperature_k);
    };
    const double green = of_sun(kSolarBands[1]);
    return vec_cast<float>(irradiance * Vec3{of_sun(kSolarBands[0]) / green, 1, of_sun(kSolarBands[2]) / green});
}

Vec3 aberrated(const Vec3& direction, const Vec3& velocity_m_s) noexcept {
    constexpr double kMaxBeta = 0.999;  // commanded poses may move faster than light
    Vec3 beta = velocity_m_s / kLightSpeed_m_s;
    if (const double n = norm(beta); n > kMaxBeta) beta *= kMaxBeta / n;
    const double inverse_gamma = std::sqrt(1 - dot(beta, beta));
    return normalized(inverse_gamma * direction + (1 + dot(direction, beta) / (1 + inverse_gamma)) * beta);
}

StarLight::StarLight(const Scene& scene, const Camera& camera)
    : camera_(camera),
      field_(*scene.stars),
      model_(camera.model),
      response_(camera.optics.point_spread.value_or(PointSpreadFunction{}), disc_px(camera)),
      points_per_px_(points_per_px(camera.optics.point_spread.value_or(PointSpreadFunction{}))),
      moments_(kMaxSegments + 1),
      buffer_(kBuffer) {
    const double right = camera.width - 1, bottom = camera.height - 1, reach = response_.radius() + 1;
    view_ = model_->bounds({-reach, -reach, right + reach, bottom + reach});
    constexpr int kIntervals = 8;
    for (int j = 0; j <= kIntervals; ++j)
        for (int i = 0; i <= kIntervals; ++i) {
            const Vec3 d = model_->direction({right * i / kIntervals, bottom * j / kIntervals});
            if (model_->project(d)) px_per_rad_ = std::max(px_per_rad_, largest_stretch(model_->jacobian(d)));
        }
    irradiance_.reserve(field_.stars.size());
    for (const Star& star : field_.stars) irradiance_.push_back(star_irradiance(star.v_magnitude, star.b_v));
}

double StarLight::set_moments(const BodyPoses& at, const CameraPose& pose) noexcept {
    const auto moment = [&](double time) {
        return Moment{conjugate(field_.q_icrs_world_at(pose.seconds(time)) * pose.at(time).q), time};
    };
    segments_ = 1;
    if (!pose.over_time()) {
        moments_[0] = moments_[1] = moment(kMidExposure);
        return 0;
    }
    const double turn_rad = angle_between(pose.at(0).q, pose.at(1).q) +
                            norm(field_.rate_rad_s) * std::abs(pose.seconds(1) - pose.seconds(0));
    const double length_px = std::ceil(turn_rad * px_per_rad_);
    segments_ = static_cast<std::size_t>(std::clamp(length_px, 1.0, static_cast<double>(kMaxSegments)));
    if (at.moving()) segments_ = std::max(segments_, kSegmentsOfMovingBodies);
    for (std::size_t i = 0; i <= segments_; ++i)
        moments_[i] = moment(static_cast<double>(i) / static_cast<double>(segments_));
    return turn_rad;
}

void StarLight::add(const Tracer& tracer, const Medium* medium, const BodyPoses& at, const CameraPose& pose,
                    const ImageOptics& optics, RadianceImage& image) noexcept {
    const Frame f{tracer, medium, at, pose, optics, image};
    const double turn_rad = set_moments(at, pose);
    const Quat q_icrs_world = field_.q_icrs_world_at(pose.seconds(kMidExposure));
    const Vec3 velocity_m_s = q_icrs_world * (field_.velocity_m_s + pose.velocity_m_s());
    // Aberration displaces by asin(v / c) at most.
    const double half_angle =
        view_.half_angle_rad + 0.5 * turn_rad + std::asin(std::min(norm(velocity_m_s) / kLightSpeed_m_s, 1.0));
    const double min_cosine = half_angle < kPi ? std::cos(half_angle) : -2;
    const Vec3 axis = q_icrs_world * (pose.middle().q * view_.axis);
    for (std::size_t i = 0; i < field_.stars.size(); ++i) {
        const Vec3& direction = field_.stars[i].direction;
        if (dot(direction, axis) >= min_cosine) add_trail(aberrated(direction, velocity_m_s), irradiance_[i], f);
    }
    flush(f);
}

void StarLight::add_trail(const Vec3& direction, const Rgb& irradiance, const Frame& f) noexcept {
    Vec3 from = moments_[0].q_camera_icrs * direction;
    std::optional<ImagePoint> p_from = model_->project(from);
    for (std::size_t i = 1; i <= segments_; ++i) {
        const Vec3 to = moments_[i].q_camera_icrs * direction;
        const std::optional<ImagePoint> p_to = model_->project(to);
        if (p_from && p_to) {
            Segment s{normalized(from + to), moments_[i - 1].time, moments_[i].time, *p_from, *p_to};
            const ImagePoint middle{0.5 * (s.from.x + s.to.x), 0.5 * (s.from.y + s.to.y)};
            if (reaches_image(s) && model_->sees(middle)) {
                s.light =
                    static_cast<float>(model_->pixels_per_sr(s.direction)) * f.optics.gain_at(middle) * irradiance;
                buffer_[buffered_++] = s;
                if (buffered_ == buffer_.size()) flush(f);
            }
        }
        from = to, p_from = p_to;
    }
}

bool StarLight::reaches_image(const Segment& s) const noexcept {
    const double reach = response_.radius() + 1;
    const auto [left, right] = std::minmax(s.from.x, s.to.x);
    const auto [top, bottom] = std::minmax(s.from.y, s.to.y);
    const bool far = right - left + bottom - top > 4.0 * (camera_.width + camera_.height);
    return !far && right > -reach && left < camera_.width + reach && bottom > -reach &&
           top < camera_.height + reach;
}

void StarLight::flush(const Frame& f) noexcept {
    tbb::parallel_for(std::size_t{0}, (buffered_ + kLanes - 1) / kLanes, [&](std::size_t batch) {
        const FlushDenormals flush_denormals;
        trace(f, batch * kLanes);
    });
    const auto width = static_cast<std::size_t>(f.image.width);
    tbb::parallel_for(0, (f.image.height + kRowsOfTask - 1) / kRowsOfTask, [&](int task) {
        const int first = task * kRowsOfTask, end = std::min(first + kRowsOfTask, f.image.height);
        for (const Segment& s : std::span(buffer_).first(buffered_)) {
            const auto [top, bottom] = std::minmax(s.from.y, s.to.y);
            const double reach = response_.radius() + 0.5;
            if (s.hidden || top - reach >= end || bottom + reach <= first - 1) continue;
            const int from = std::max(first, static_cast<int>(std::floor(top - reach)));
            const int to = std::min(end, static_cast<int>(std::ceil(bottom + reach)) + 1);
            for (int y = from; y < to; ++y)
                draw_row(s, f.pose, y, &f.image.pixels[static_cast<std::size_t>(y) * width]);
        }
    });
    buffered_ = 0;
}

void StarLight::trace(const Frame& f, std::size_t first) noexcept {
    const std::span segments = std::span(buffer_).first(buffered_).subspan(first);
    RayBatch rays;
    rays.n = std::min(segments.size(), kLanes);
    for (std::size_t i = 0; i < rays.n; ++i) {
        const double time = 0.5 * (segments[i].start + segments[i].end);
        const Rigid3 T_world_camera = f.pose.at(time);
        rays.put(i, {T_world_camera.t, T_world_camera.q * segments[i].direction, time});
    }
    HitBatch hits;
    f.tracer.intersect(f.at, rays, f.tracer.all_bodies(), hits);
    for (std::size_t i = 0; i < rays.n; ++i) {
        segments[i].hidden = is_set(hits.met, i);
        if (f.medium != nullptr && !segments[i].hidden)
            segments[i].light = segments[i].light * f.medium->transmittance(f.at, rays[i], kInfinity);
    }
}

void StarLight::draw_row(const Segment& s, const CameraPose& pose, int y, Rgb* row) const noexcept {
    const Exposed part = exposed(pose, y, camera_.height, s.start, s.end);
    if (part.share == 0) return;
    const double dx = s.to.x - s.from.x, dy = s.to.y - s.from.y;
    const double points = std::ceil(std::hypot(dx, dy) * (part.end - part.begin) * points_per_px_);
    const int n = std::max(static_cast<int>(points), 1);
    const Rgb light = static_cast<float>(part.share / n) * s.light;
    for (int i = 0; i < n; ++i) {
        const double at = part.begin + (i + 0.5) / n * (part.end - part.begin);
        response_.add(s.from.x + at * dx, s.from.y + at * dy, light, y, camera_.width, row);
    }
}

}  // namespace narpa
