#include "estimator/dense/image_derivative.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "base/constants.h"
#include "estimator/dense/pixel_patch.h"
#include "estimator/view/model_view.h"
#include "renderer/camera/camera_model.h"
#include "renderer/geometry/flush_denormals.h"
#include "renderer/integrator/shading.h"

namespace narpa {
namespace {

using Row = Eigen::Matrix<double, 6, 1>;

/// Neighbouring points of one surface are at most this many times as far apart as its slope predicts.
constexpr double kSurfaceSteps = 2.5;
/// Lower limit of the cosine between ray and normal in that prediction.
constexpr double kLeastCosine = 0.02;
/// Bisections between two rays in the search for a contour.
constexpr int kHalvings = 10;
/// Step of the finite difference of the BSDF, as a part of the range.
constexpr double kViewStep = 1e-3;
/// Points of a pixel, each way, at which that difference is taken.
constexpr int kShadingPoints = 2;
/// Rays each way in any pixel; more where the radiance varies by more than this part of the sensor's noise.
constexpr int kAnywhere = 3;
constexpr double kVarying = 1;

bool depends_on_view(const Material& m) {
    if (is_specular(m) || m.kind == Material::Kind::lambert) return false;
    return m.kind != Material::Kind::phong || m.specular != Rgb{};
}

/// The first two terms of one pixel, on one grid.
class PixelSides {
public:
    PixelSides(const FineGrid& grid, const PixelPatch& patch, int x, int y, const Vec3& t_camera_target)
        : grid_(grid), patch_(patch), x_(x), y_(y), t_camera_target_(t_camera_target) {}

    /// Sum over the sides within the pixel and its share of those on its border.
    Row sum() {
        const int s = grid_.fineness();
        for (int j = 0; j < s; ++j)
            for (int i = -1; i < s; ++i) {
                add(i, j, i + 1, j);
                add(j, i, j, i + 1);
            }
        return sum_ / (static_cast<double>(s) * s);
    }
    /// Total variation of the signal across the pixel, DN; after `sum`.
    [[nodiscard]] double change() const { return jumps_ / grid_.fineness(); }

private:
    [[nodiscard]] bool within(int i, int j) const {
        return i >= 0 && j >= 0 && i < grid_.fineness() && j < grid_.fineness();
    }

    /// The side between a and b, its neighbour to the right or below.
    void add(int ia, int ja, int ib, int jb) {
        const RaySample &a = patch_.at(ia, ja), &b = patch_.at(ib, jb);
        const double jump = a.signal - b.signal;
        if (jump == 0) return;
        jumps_ += std::abs(jump);
        const RaySample& near = a.range_m <= b.range_m ? a : b;
        const bool rides_along = near.body >= 0 && near.body == grid_.camera().mount;
        if (near.body < 0 || rides_along) return;
        double along = 0.5, range_m = near.range_m;
        // A side on the border counts half for this pixel, except a contour, whose position is known.
        double share = 0.5 * (within(ia, ja) ? 1 : 0) + 0.5 * (within(ib, jb) ? 1 : 0);
        const double xa = x_ * grid_.fineness() + ia, ya = y_ * grid_.fineness() + ja;
        const double dx = ib - ia, dy = jb - ja;
        if (is_contour(a, b)) {
            find_contour(a, b, xa, ya, dx, dy, along, range_m);
            share = (along < 0.5 ? within(ia, ja) : within(ib, jb)) ? 1 : 0;
        }
        if (share > 0) sum_ += share * jump * velocity(xa + along * dx, ya + along * dy, range_m, dy == 0);
    }

    /// True where the two are not neighbouring points of one surface, by the slopes from their normals.
    static bool is_contour(const RaySample& a, const RaySample& b) {
        if (a.body != b.body) return true;
        const double cosine =
            std::max(std::min(std::abs(dot(a.normal, a.ray_direction)), std::abs(dot(b.normal, b.ray_direction))),
                     kLeastCosine);
        const double step_m = std::max(a.range_m, b.range_m) * norm(a.ray_direction - b.ray_direction) / cosine;
        return norm(a.position - b.position) > kSurfaceSteps * step_m;
    }

    /// Where between a at (xa, ya), 0, and b at (xa + dx, ya + dy), 1, the nearer surface ends, and its range
    /// there.
    void find_contour(const RaySample& a, const RaySample& b, double xa, double ya, double dx, double dy,
                      double& along, double& range_m) const {
        const bool near_is_a = a.range_m <= b.range_m;
        const RaySample& far = near_is_a ? b : a;
        double on_near = near_is_a ? 0 : 1, on_far = 1 - on_near;
        const Frame& f = grid_.frame();
        for (int k = 0; k < kHalvings; ++k) {
            const double middle = 0.5 * (on_near + on_far);
            const Ray ray = camera_ray(f.model, f.T_world_camera, xa + middle * dx, ya + middle * dy);
            const Hit hit = f.tracer.intersect(f.at, ray, kInfinity);
            const double here_m = hit.body < 0 ? kInfinity : hit.range_m;
            const bool nearer = std::abs(here_m - range_m) < std::abs(here_m - far.range_m);
            if (hit.body >= 0 && (hit.body != far.body || nearer)) {
                on_near = middle;
                range_m = here_m;
            } else {
                on_far = middle;
            }
        }
        along = 0.5 * (on_near + on_far);
    }

    /// Image velocity across a side at this point of the grid: grid points per unit of the pose's error.
    [[nodiscard]] Row velocity(double x, double y, double range_m, bool horizontal) const {
        const CameraModel& model = *grid_.frame().model;
        const Vec3 point = range_m * model.direction({x, y});
        const Vec3 a = point - t_camera_target_;  // about the target's origin, in camera axes
        const ProjectionJacobian J = model.jacobian(point);
        const Vec3& move = horizontal ? J.x : J.y;
        Row row;
        row << to_eigen(cross(a, move)), to_eigen(move);
        return row;
    }

    const FineGrid& grid_;
    const PixelPatch& patch_;
    const int x_, y_;
    const Vec3 t_camera_target_;
    Row sum_ = Row::Zero();
    double jumps_ = 0;
};

/// The third term: change of reflected sunlight with the direction to the camera, by central differences of the
/// BSDF.
Row shading_change(const Frame& f, const SensorModel& sensor, int x, int y, const Vec3& t_camera_target) {
    Vec3 per_metre{};  // DN per metre of the surface against the camera, world axes
    for (int j = 0; j < kShadingPoints; ++j)
        for (int i = 0; i < kShadingPoints; ++i) {
            constexpr double kStep = 1.0 / kShadingPoints, kFirst = 0.5 * kStep - 0.5;
            const Ray ray = camera_ray(f.model, f.T_world_camera, x + kFirst + kStep * i, y + kFirst + kStep * j);
            const Hit hit = f.tracer.intersect(f.at, ray, kInfinity);
            if (hit.body < 0 || hit.body == f.camera.mount) continue;
            if (!depends_on_view(f.tracer.scene().materials[static_cast<std::size_t>(hit.material)])) continue;
            const Surface surface =
                surface_at(f.tracer, f.at, hit, ray.direction, hit.range_m * kStep / f.model->pixels_per_radian());
            const Vec3& to_sun = f.sun->centre();
            const double cosine = dot(surface.normal, to_sun);
            if (cosine <= 0 || f.tracer.occluded(f.at, hit, to_sun, kInfinity)) continue;
            const Vec3 seen = hit.range_m * ray.direction;
            const auto shine = [&](const Vec3& displaced) {
                return signal_of(sensor, bsdf(surface, surface.normal, to_sun, -normalized(displaced)));
            };
            const double d = kViewStep * hit.range_m;
            const Vec3 change{shine(seen + Vec3{d, 0, 0}) - shine(seen - Vec3{d, 0, 0}),
                              shine(seen + Vec3{0, d, 0}) - shine(seen - Vec3{0, d, 0}),
                              shine(seen + Vec3{0, 0, d}) - shine(seen - Vec3{0, 0, d})};
            per_metre += (cosine * static_cast<double>(f.sun->irradiance()) / (2 * d)) * change;
        }
    // Against the target's axes the camera moves by what the target's origin moves, less what turns it about there.
    const Vec3 g = conjugate(f.T_world_camera.q) * per_metre / (kShadingPoints * kShadingPoints);
    Row row;
    row << to_eigen(-cross(t_camera_target, g)), to_eigen(g);
    return row;
}

}  // namespace

ImageDerivative::ImageDerivative(const RenderScene& render_scene, const Camera& camera, std::size_t target,
                                 const BodyPoses& at)
    : render_scene_(render_scene), camera_(camera), target_(target), at_(at) {
    const auto& materials = render_scene.scene().materials;
    view_dependent_ = render_scene.scene().sun && std::any_of(materials.begin(), materials.end(), depends_on_view);
    derivative_.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
}

std::span<const PixelDerivative> ImageDerivative::at(const Rigid3& T_camera_target, const SensorModel& sensor,
                                                     const FrameSettings& settings, int fineness) {
    const Rigid3 T_world_camera = place_camera(T_camera_target, camera_, target_, at_);
    const FineGrid coarse(render_scene_, at_, camera_, T_world_camera, settings, std::min(fineness, kAnywhere));
    const FrameSettings plain = settings;
    const Frame frame = make_frame(render_scene_, at_, camera_, T_world_camera, plain);
    const FineGrid fine(render_scene_, at_, camera_, T_world_camera, settings, fineness);
    const Vec3& t = T_camera_target.t;
    const double varying_dn = kVarying * std::sqrt(sensor.variance_dn2(sensor.black_dn));
    const auto pixel = [&](PixelPatch& patch, int x, int y) -> Row {
        patch.trace(coarse, sensor, x, y);
        if (!patch.sees_anything()) return Row::Zero();
        PixelSides sides(coarse, patch, x, y, t);
        Row sum = sides.sum();
        if (fineness > kAnywhere && sides.change() > varying_dn) {
            patch.trace(fine, sensor, x, y);
            sum = PixelSides(fine, patch, x, y, t).sum();
        }
        if (!view_dependent_) return sum;
        return sum + shading_change(frame, sensor, x, y, t);
    };
    tbb::parallel_for(0, camera_.height, [&](int y) {
        const FlushDenormals flush;
        PixelPatch patch;
        const bool border = y == 0 || y == camera_.height - 1;
        for (int x = 0; x < camera_.width; ++x)
            derivative_[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width) +
                        static_cast<std::size_t>(x)] = border || x == 0 || x == camera_.width - 1
                                                           ? PixelDerivative(PixelDerivative::Zero())
                                                           : PixelDerivative(pixel(patch, x, y).cast<float>());
    });
    return derivative_;
}

}  // namespace narpa
