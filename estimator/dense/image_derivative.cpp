#include "estimator/dense/image_derivative.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/constants.h"
#include "estimator/dense/border_points.h"
#include "estimator/dense/pixel_sides.h"
#include "estimator/view/model_view.h"
#include "renderer/camera/scene_camera.h"
#include "renderer/geometry/flush_denormals.h"
#include "renderer/integrator/shading.h"

namespace narpa {
namespace {

/// Step of the finite difference of the BSDF, as a part of the range.
constexpr double kViewStep = 1e-3;
/// Pixels, each way, whose borders are traced together.
constexpr int kSquare = 8;
/// Parts of an exposure per pixel of motion during it, and their largest number.
constexpr double kPartsPerPixel = 1, kMaxParts = 8;

bool depends_on_view(const Material& m) {
    return !is_specular(m) && (!is_lambert_or_phong(m) || lobe_colour(m) != Rgb{});
}

/// The third term where a ray meets a surface: change of reflected sunlight with the direction to the camera, by
/// central differences of the BSDF. DN per metre of the surface against the camera, world axes. Textures are
/// averaged over the pixel.
Vec3 shading_change(const Frame& f, const SensorModel& sensor, const Ray& ray, const Hit& hit) {
    const Surface surface =
        surface_at(f.tracer, f.at, hit, ray.direction, hit.range_m / f.model->pixels_per_radian());
    const Vec3& to_sun = f.sun->centre();
    const double cosine = dot(surface.normal, to_sun);
    if (cosine <= 0 || f.tracer.occluded(f.at, hit, to_sun, kInfinity)) return {};
    const Vec3 seen = hit.range_m * ray.direction;
    const auto shine = [&](const Vec3& displaced) {
        return sensor.signal(bsdf(surface, surface.normal, to_sun, -normalized(displaced)));
    };
    const double d = kViewStep * hit.range_m;
    const Vec3 change{shine(seen + Vec3{d, 0, 0}) - shine(seen - Vec3{d, 0, 0}),
                      shine(seen + Vec3{0, d, 0}) - shine(seen - Vec3{0, d, 0}),
                      shine(seen + Vec3{0, 0, d}) - shine(seen - Vec3{0, 0, d})};
    return (cosine * static_cast<double>(f.sun->irradiance()) / (2 * d)) * change;
}

/// The same at the centre of each chosen pixel of a square.
class ShadingChanges {
public:
    ShadingChanges(const Frame& f, const SensorModel& sensor, const Square& square,
                   std::span<const std::uint8_t> chosen)
        : f_(f), sensor_(sensor) {
        rays_.n = 0;
        for (int r = 0; r < square.rows; ++r)
            for (int c = 0; c < square.columns; ++c) {
                const int x = square.x + c, y = square.y + r;
                if (chosen[index_in(f.camera.width, x, y)] == 0) continue;
                put(index_in(kSquare, c, r), ray_through(f, x, y));
            }
        trace();
    }
    /// Of the square's pixel (c, r).
    [[nodiscard]] Vector6 at(int c, int r, const Vec3& t_camera_target) const {
        // Relative to the target's axes the camera moves by the translation of the target's origin minus its
        // rotation about that origin.
        const Vec3 g = conjugate(f_.T_world_camera.q) * changes_[index_in(kSquare, c, r)];
        Vector6 row;
        row << to_eigen(-cross(t_camera_target, g)), to_eigen(g);
        return row;
    }

private:
    void put(std::size_t pixel, const Ray& ray) {
        pixels_[rays_.n] = pixel;
        rays_.put(rays_.n++, ray);
        if (rays_.n == kLanes) trace();
    }
    void trace() {
        if (rays_.n == 0) return;
        f_.tracer.intersect(f_.at, rays_, f_.tracer.all_bodies(), hits_);
        const auto& materials = f_.tracer.scene().materials;
        for (std::size_t i = 0; i < rays_.n; ++i) {
            if (hits_.body[i] < 0 || hits_.body[i] == f_.camera.mount) continue;
            if (!depends_on_view(materials[static_cast<std::size_t>(hits_.material[i])])) continue;
            changes_[pixels_[i]] = shading_change(f_, sensor_, rays_[i], hits_[i]);
        }
        rays_.n = 0;
    }

    const Frame& f_;
    const SensorModel& sensor_;
    RayBatch rays_;
    HitBatch hits_;
    Lanes<std::size_t> pixels_;
    std::array<Vec3, static_cast<std::size_t>(kSquare) * kSquare> changes_{};
};

}  // namespace

ImageDerivative::ImageDerivative(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                                 const BodyPoses& at)
    : render_scene_(render_scene),
      camera_(camera),
      target_(target),
      at_(at),
      optics_(camera.optics, camera.plane()),
      before_optics_(optics_.any() ? camera.width : 0, optics_.any() ? camera.height : 0),
      after_optics_(before_optics_) {
    const auto& materials = render_scene.scene().materials;
    view_dependent_ = render_scene.scene().sun && std::any_of(materials.begin(), materials.end(), depends_on_view);
    derivative_.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
}

void ImageDerivative::begin_frame(const BodyPoses& at, const ApparentMotion& motion, const RowTimes& times) {
    copy_static_poses(at, at_);
    motion_ = times.at_once() ? ApparentMotion{} : motion, times_ = times;
}

std::span<const PixelDerivative> ImageDerivative::at(const Rigid3& T_camera_target, const SensorModel& sensor,
                                                     const FrameSettings& settings, int fineness,
                                                     std::span<const std::uint8_t> chosen) {
    const double range_m = std::max(norm(T_camera_target.t), 1e-9);
    const double blur_rad = times_.exposure_s *
                            (norm(motion_.velocity_m_s) +
                             norm(motion_.rate_rad_s) * render_scene_.tracer().bounding_radius_m(target_)) /
                            range_m;
    const double blur_px = blur_rad * camera_.model->pixels_per_radian();
    const int parts = static_cast<int>(std::clamp(std::ceil(kPartsPerPixel * blur_px), 1.0, kMaxParts));
    (void)place_camera(T_camera_target, camera_, target_, at_);
    std::ranges::fill(derivative_, PixelDerivative(PixelDerivative::Zero()));
    chosen_.assign(derivative_.size(), 1);
    std::ranges::copy(chosen, chosen_.begin());
    for (int k = 0; k < parts; ++k)
        add(T_camera_target, sensor, settings, fineness, times_.part(k, parts), 1.0F / static_cast<float>(parts));
    if (view_dependent_)
        for (int k = 0; k < parts; ++k)
            add_shading(T_camera_target, sensor, settings, times_.part(k, parts), 1.0F / static_cast<float>(parts));
    if (optics_.any()) apply_optics();
    return derivative_;
}

CameraPose ImageDerivative::path(const Rigid3& T_camera_target, const RowTimes& times, int fineness) const {
    return camera_path(at_.T_world_body[target_], T_camera_target, motion_, times.scaled(1.0 / fineness),
                       fineness * camera_.height);
}

template <class Do>
void ImageDerivative::each_square(const Rigid3& T_camera_target, const RowTimes& times, float weight, Do&& act) {
    const int across = (camera_.width - 3) / kSquare + 1, down = (camera_.height - 3) / kSquare + 1;
    if (camera_.width < 3 || camera_.height < 3) return;
    tbb::parallel_for(0, across * down, [&](int number) {
        const FlushDenormals flush;
        const int x = 1 + kSquare * (number % across), y = 1 + kSquare * (number / across);
        const Square square{x, y, std::min(kSquare, camera_.width - 1 - x),
                            std::min(kSquare, camera_.height - 1 - y)};
        act(square, [&](auto&& derivative) {
            for (int r = 0; r < square.rows; ++r) {
                const double t_s = times.at(y + r);
                const RowView view{moved(T_camera_target, motion_, t_s).t, motion_, times.row_s};
                const Quat back =
                    exp_rotation(-t_s * motion_.rate_rad_s);  // from the row's error to mid-exposure's
                for (int c = 0; c < square.columns; ++c) {
                    const std::size_t p = index_in(camera_.width, x + c, y + r);
                    if (chosen_[p] == 0) continue;
                    Vector6 row = derivative(c, r, view);
                    if (t_s != 0) row.head<3>() = to_eigen(back * to_vec3(row.head<3>()));
                    derivative_[p] += weight * row.cast<float>();
                }
            }
        });
    });
}

void ImageDerivative::add(const Rigid3& T_camera_target, const SensorModel& sensor, const FrameSettings& settings,
                          int fineness, const RowTimes& times, float weight) {
    const FineGrid grid(render_scene_, at_, camera_, path(T_camera_target, times, fineness), settings, fineness);
    each_square(T_camera_target, times, weight, [&](const Square& square, auto&& each) {
        BorderPoints points(grid.fineness, square);
        PointTracer tracer(grid, sensor);
        points.trace(grid, tracer, camera_.width, chosen_);
        const TileBorderFlow sides(grid, tracer, points, camera_.width, chosen_);
        each([&](int c, int r, const RowView& view) { return sides.flow_over_borders(c, r, view); });
    });
}

void ImageDerivative::add_shading(const Rigid3& T_camera_target, const SensorModel& sensor,
                                  const FrameSettings& settings, const RowTimes& times, float weight) {
    const Frame frame = make_frame(render_scene_, at_, camera_, path(T_camera_target, times, 1), settings);
    each_square(T_camera_target, times, weight, [&](const Square& square, auto&& each) {
        const ShadingChanges changes(frame, sensor, square, chosen_);
        each([&](int c, int r, const RowView& view) { return changes.at(c, r, view.t_camera_target); });
    });
}

/// Applies the image's optics, three columns at a time.
void ImageDerivative::apply_optics() {
    for (const int first : {0, 3}) {
        for (std::size_t i = 0; i < derivative_.size(); ++i) {
            const PixelDerivative& d = derivative_[i];
            before_optics_.pixels[i] = {d[first], d[first + 1], d[first + 2]};
        }
        optics_.apply(before_optics_, after_optics_);
        for (std::size_t i = 0; i < derivative_.size(); ++i) {
            const Rgb& d = after_optics_.pixels[i];
            derivative_[i].segment<3>(first) << d.x, d.y, d.z;
        }
    }
}

}  // namespace narpa
