#include "renderer/optics/sun_ghost.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/constants.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/projection/camera_model.h"

namespace narpa {
namespace {

constexpr TableKey kGhostRows[]{
    {"strength", rows::number({.low = 0, .high = 1, .low_open = true}),
     "a share of the Sun's light, the product of two reflectances"},
    {"radius_px", rows::number({.low = 1, .high = 1e4}), "the radius of the disc"},
    {"scale", rows::number({.low = -10, .high = 10})},
    {"within_deg", rows::number({.low = 0, .high = 89, .low_open = true}),
     "the Sun's largest angle from the optical axis"},
};
constexpr TableKeys kGhostKeys{.rows = kGhostRows};
constexpr TableKey kGhostOfCamera[]{{"ghost", rows::table(kGhostKeys)}};

constexpr double kHoodShade = 0.1;  ///< the lens hood shades the aperture gradually over this fraction of its angle

class SunGhost final : public ImageEffect {
public:
    SunGhost(const Ghost& ghost, std::shared_ptr<const CameraModel> model)
        : ghost_(ghost), model_(std::move(model)), principal_(model_->project({0, 0, 1}).value_or(ImagePoint{})) {}

    void apply(const ImageExposure& exposure, RadianceImage& image) noexcept override;

private:
    [[nodiscard]] std::optional<ImagePoint> centre(const Rigid3& T_world_camera, const Vec3& to_sun) const noexcept;
    [[nodiscard]] double share_within_hood(double angle_rad) const noexcept;
    void add_row(const ImagePoint& centre, const Rgb& radiance, int y, RadianceImage& image) const noexcept;

    Ghost ghost_;
    std::shared_ptr<const CameraModel> model_;
    ImagePoint principal_;
};

std::optional<ImagePoint> SunGhost::centre(const Rigid3& T_world_camera, const Vec3& to_sun) const noexcept {
    const Vec3 direction = conjugate(T_world_camera.q) * to_sun;
    if (direction.z < std::cos(ghost_.within_rad)) return std::nullopt;
    const std::optional<ImagePoint> p = model_->project(direction);
    if (!p) return std::nullopt;
    return ImagePoint{principal_.x - ghost_.scale * (p->x - principal_.x),
                      principal_.y - ghost_.scale * (p->y - principal_.y)};
}

double SunGhost::share_within_hood(double angle_rad) const noexcept {
    return std::clamp((ghost_.within_rad - angle_rad) / (kHoodShade * ghost_.within_rad), 0.0, 1.0);
}

void SunGhost::apply(const ImageExposure& exposure, RadianceImage& image) noexcept {
    if (exposure.sun == nullptr) return;
    const CameraPose& pose = exposure.pose;
    const Rigid3& T_world_camera = pose.middle();
    const Vec3& direction = exposure.sun->direction();
    const std::optional<ImagePoint> middle = centre(T_world_camera, direction);
    if (!middle) return;
    const Rgb transmittance = exposure.sun->transmittance(T_world_camera.t);
    if (transmittance == Rgb{}) return;
    const double cosine = (conjugate(T_world_camera.q) * direction).z;
    const double irradiance =
        exposure.sun->irradiance_w_m2() * cosine * share_within_hood(std::acos(std::min(cosine, 1.0)));
    // Area of the disc with the one-pixel-wide edge that add_row draws.
    const double area_px = kPi * (ghost_.radius_px * ghost_.radius_px + 1.0 / 12);
    const auto grey = static_cast<float>(ghost_.strength * irradiance * model_->pixels_per_sr({0, 0, 1}) / area_px);
    const Rgb radiance = grey * transmittance;
    for (int y = 0; y < image.height; ++y) {
        const std::optional<ImagePoint> here =
            pose.moves() ? centre(pose.at(pose.time(y, image.height, 0.5)), direction) : middle;
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

class SunGhostEffect final : public OpticalEffect {
public:
    explicit SunGhostEffect(const Ghost& ghost) : ghost_(ghost) {}
    [[nodiscard]] std::unique_ptr<ImageEffect> make(const ImagePlane& plane) const override {
        return std::make_unique<SunGhost>(ghost_, plane.model);
    }
    [[nodiscard]] std::shared_ptr<const OpticalEffect> scaled(double factor) const override {
        Ghost ghost = ghost_;
        ghost.radius_px *= factor;
        return sun_ghost(ghost);
    }

private:
    Ghost ghost_;
};

void read_ghost(TableReader& camera, const OpticsContext& context, Optics& optics) {
    auto table = camera.table("ghost");
    if (!table) return;
    Ghost ghost;
    table->read("strength", ghost.strength);
    table->read("radius_px", ghost.radius_px);
    table->read("scale", ghost.scale);
    ghost.within_rad = table->number("within_deg").value_or(0) * kPi / 180;
    if (!context.has_sun) table->fail("strength", "there is no Sun, expected a [sun]");
    table->finish();
    optics.effects.push_back(sun_ghost(ghost));
}

}  // namespace

std::shared_ptr<const OpticalEffect> sun_ghost(const Ghost& ghost) {
    return std::make_shared<SunGhostEffect>(ghost);
}

constinit const OpticsKind kSunGhost{kGhostOfCamera, read_ghost};

}  // namespace narpa
