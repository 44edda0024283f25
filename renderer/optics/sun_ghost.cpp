#include "renderer/optics/sun_ghost.h"

#include <algorithm>
#include <cmath>

#include "base/constants.h"

namespace narpa {
namespace {

constexpr double kHoodShade = 0.1;  ///< the lens hood shades the aperture gradually over this fraction of its angle

}  // namespace

std::unique_ptr<const SunGhost> SunGhost::create(const Scene& scene, const Camera& camera) {
    if (!camera.ghost || !scene.sun) return nullptr;
    return std::make_unique<const SunGhost>(*scene.sun, *camera.ghost, camera);
}

SunGhost::SunGhost(const Sun& sun, const Ghost& ghost, const Camera& camera)
    : sun_(sun),
      ghost_(ghost),
      model_(camera.model),
      principal_(model_->project({0, 0, 1}).value_or(ImagePoint{})) {}

std::optional<ImagePoint> SunGhost::centre(const Rigid3& T_world_camera) const noexcept {
    const Vec3 direction = conjugate(T_world_camera.q) * sun_.direction;
    if (direction.z < std::cos(ghost_.within_rad)) return std::nullopt;
    const std::optional<ImagePoint> p = model_->project(direction);
    if (!p) return std::nullopt;
    return ImagePoint{principal_.x - ghost_.scale * (p->x - principal_.x),
                      principal_.y - ghost_.scale * (p->y - principal_.y)};
}

double SunGhost::share_within_hood(double angle_rad) const noexcept {
    return std::clamp((ghost_.within_rad - angle_rad) / (kHoodShade * ghost_.within_rad), 0.0, 1.0);
}

void SunGhost::add(const Tracer& tracer, const Medium* medium, const BodyPoses& at, const CameraPose& pose,
                   RadianceImage& image) const noexcept {
    const Rigid3& T_world_camera = pose.middle();
    const std::optional<ImagePoint> middle = centre(T_world_camera);
    const Ray to_sun{T_world_camera.t, sun_.direction};
    if (!middle || tracer.intersect(at, to_sun, kInfinity).body >= 0) return;
    const double cosine = (conjugate(T_world_camera.q) * sun_.direction).z;
    const double irradiance = sun_.irradiance_w_m2 * cosine * share_within_hood(std::acos(std::min(cosine, 1.0)));
    // Area of the disc with the one-pixel-wide edge that add_row draws.
    const double area_px = kPi * (ghost_.radius_px * ghost_.radius_px + 1.0 / 12);
    const auto grey = static_cast<float>(ghost_.strength * irradiance * model_->pixels_per_sr({0, 0, 1}) / area_px);
    const Rgb radiance = grey * (medium == nullptr ? Rgb{1, 1, 1} : medium->transmittance(at, to_sun, kInfinity));
    for (int y = 0; y < image.height; ++y) {
        const std::optional<ImagePoint> here =
            pose.moves() ? centre(pose.at(pose.time(y, image.height, 0.5))) : middle;
        if (here) add_row(*here, radiance, y, image);
    }
}

void SunGhost::add_row(const ImagePoint& centre, const Rgb& radiance, int y, RadianceImage& image) const noexcept {
    const double reach = ghost_.radius_px + 0.5, dy = y - centre.y, half = std::sqrt(reach * reach - dy * dy);
    if (!(half > 0)) return;
    const auto column = [&](double x) { return static_cast<int>(std::clamp<double>(x, 0, image.width)); };
    for (int x = column(std::ceil(centre.x - half)); x < column(std::floor(centre.x + half) + 1); ++x) {
        const double lit = std::clamp(reach - std::hypot(x - centre.x, dy), 0.0, 1.0);
        Rgb& pixel = image.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                                  static_cast<std::size_t>(x)];
        pixel = pixel + static_cast<float>(lit) * radiance;
    }
}

}  // namespace narpa
