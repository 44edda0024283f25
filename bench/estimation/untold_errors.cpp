#include "bench/estimation/untold_errors.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "renderer/projection/camera_model.h"

namespace narpa {
namespace {

double angle(std::mt19937_64& random) {
    return std::uniform_real_distribution<double>(0, 2 * std::numbers::pi)(random);
}

/// Velocity across the image that moves the target by `px` in `time_s`.
Vec3 velocity(const TrueWorld& w, double px, double time_s, std::mt19937_64& random) {
    const double a = angle(random);
    return (px * w.T_camera_target.t.z / (w.camera.model->pixels_per_radian() * time_s)) *
           Vec3{std::cos(a), std::sin(a), 0};
}

void nothing(TrueWorld&, double, std::mt19937_64&) {}

/// Rolling shutter: pixels by which the target moves while its rows are exposed.
void skew(TrueWorld& w, double px, std::mt19937_64& random) {
    constexpr std::int64_t kRow_ns = 100'000;
    const double rows =
        2 * w.target_radius_m * w.camera.model->pixels_per_radian() / std::max(norm(w.T_camera_target.t), 1e-9);
    w.camera.shutter = Shutter{kRow_ns};
    w.motion = {velocity(w, px, 1e-9 * kRow_ns * rows, random), {}};
}

/// Global shutter: pixels by which the target moves during the exposure.
void blur(TrueWorld& w, double px, std::mt19937_64& random) {
    w.camera.shutter = Shutter{};
    w.motion = {velocity(w, px, w.camera.detector->exposure_s, random), {}};
}

/// Light from everywhere: part of a white surface that faces the Sun.
void ambient(TrueWorld& w, double part, std::mt19937_64&) {
    const double irradiance = w.scene.sun ? w.scene.sun->irradiance_w_m2 : 0;
    const auto more = static_cast<float>(part * irradiance / std::numbers::pi);
    w.scene.ambient = w.scene.ambient + Rgb{more, more, more};
}

/// The Sun's direction, in a random direction.
void light(TrueWorld& w, double degrees, std::mt19937_64& random) {
    if (!w.scene.sun) return;
    const Vec3 s = normalized(w.scene.sun->direction);
    const Vec3 across = normalized(cross(s, std::abs(s.z) < 0.5 ? Vec3{0, 0, 1} : Vec3{1, 0, 0}));
    const double a = angle(random);
    const Vec3 axis = std::cos(a) * across + std::sin(a) * cross(s, across);
    w.scene.sun->direction = exp_rotation(degrees * std::numbers::pi / 180 * axis) * s;
}

void gain(TrueWorld& w, double part, std::mt19937_64& random) {
    const double a = angle(random);
    w.gain_right = part * std::cos(a), w.gain_down = part * std::sin(a);
}

/// Light from the target's own surfaces, whose albedo is so many times the model's; exposed as much less.
void indirect(TrueWorld& w, double times, std::mt19937_64&) {
    w.settings.method = RenderSettings::Method::path;
    for (Material& m : w.scene.materials) m.diffuse = static_cast<float>(times) * m.diffuse;
    w.camera.detector->exposure_s /= times;
}

constexpr std::array<UntoldError, 7> kErrors{{
    {"none", {0, 0, 0}, "", nothing},
    {"skew", {1, 3, 6}, "px", skew},
    {"blur", {1, 2.5, 5}, "px", blur},
    {"ambient", {0.02, 0.05, 0.1}, "of white", ambient},
    {"light", {1, 3, 10}, "deg", light},
    {"gain", {0.05, 0.1, 0.2}, "across the image", gain},
    {"indirect", {1, 2, 3}, "times the albedo", indirect},
}};

}  // namespace

void TrueWorld::apply_gain(RadianceImage& image) const {
    if (gain_right == 0 && gain_down == 0) return;
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x) {
            const double right = (x + 0.5) / image.width - 0.5, down = (y + 0.5) / image.height - 0.5;
            Rgb& pixel = image.pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                                      static_cast<std::size_t>(x)];
            pixel = static_cast<float>(1 + gain_right * right + gain_down * down) * pixel;
        }
}

std::span<const UntoldError> untold_errors() noexcept {
    return kErrors;
}

}  // namespace narpa
