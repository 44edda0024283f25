#include "estimator/dense/image_derivative.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/trace/camera_ray.h"
#include "renderer/trace/shading.h"
#include "renderer/trace/sun_disc.h"

namespace narpa {
namespace {

/// Neighbouring points of a surface lie no further from each other than so many times what its slope asks for.
constexpr double kSurfaceSteps = 2.5;
/// The least cosine between ray and surface by which a slope is judged.
constexpr double kLeastCosine = 0.02;
/// Halvings of the way between two rays in the search for a contour.
constexpr int kHalvings = 10;
/// Part of the distance by which the camera is displaced to see the BSDF change.
constexpr double kViewStep = 1e-3;
/// Points of a pixel, each way, at which the change of its shine is taken.
constexpr int kShadingPoints = 2;

Camera finer_camera(const Camera& camera, int factor) {
    Camera c = camera;
    c.width *= factor, c.height *= factor;
    c.fx *= factor, c.fy *= factor;
    c.cx = (c.cx + 0.5) * factor - 0.5;
    c.cy = (c.cy + 0.5) * factor - 0.5;
    c.lens.reset();
    return c;
}

double signal_of(const SensorModel& sensor, const Rgb& L) {
    const auto& k = sensor.dn_per_radiance;
    return k[0] * static_cast<double>(L.x) + k[1] * static_cast<double>(L.y) + k[2] * static_cast<double>(L.z);
}

bool depends_on_view(const Material& m) {
    if (is_specular(m) || m.kind == Material::Kind::lambert) return false;
    return m.kind != Material::Kind::phong || m.specular != Rgb{};
}

}  // namespace

ImageDerivative::ImageDerivative(const Tracer& tracer, const Camera& camera, std::size_t target,
                                 const Placement& at, int fineness)
    : camera_(camera), fineness_(fineness), fine_(tracer, finer_camera(camera, fineness), target, at) {
    const auto& materials = tracer.scene().materials;
    view_dependent_ = tracer.scene().sun && std::any_of(materials.begin(), materials.end(), depends_on_view);
    signal_.resize(static_cast<std::size_t>(fine_.camera().width) *
                   static_cast<std::size_t>(fine_.camera().height));
    derivative_.resize(static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height));
}

std::span<const PixelDerivative> ImageDerivative::at(const Rigid3& T_camera_target, const SensorModel& sensor,
                                                     const FrameSettings& settings) {
    FrameSettings one_ray = settings;
    one_ray.spp = 1;
    one_ray.budget = {};
    fine_.render(T_camera_target, one_ray, true);
    t_camera_target_ = T_camera_target.t;
    find_signal(sensor);
    tbb::parallel_for(0, camera_.height, [&](int y) {
        const auto first = derivative_.begin() + static_cast<std::ptrdiff_t>(y) * camera_.width;
        std::fill(first, first + camera_.width, PixelDerivative::Zero());
        if (y == 0 || y == camera_.height - 1) return;
        sum_pixels(y);
        if (!view_dependent_) return;
        for (int x = 1; x < camera_.width - 1; ++x) *(first + x) += shading(x, y, sensor).cast<float>();
    });
    return derivative_;
}

void ImageDerivative::find_signal(const SensorModel& sensor) {
    const auto& pixels = fine_.radiance().pixels;
    for (std::size_t i = 0; i < signal_.size(); ++i) signal_[i] = static_cast<float>(signal_of(sensor, pixels[i]));
}

/// Each pixel gathers the sides within it and its part of those on its border.
void ImageDerivative::sum_pixels(int y) {
    const int s = fineness_;
    const double area = static_cast<double>(s) * s;
    for (int x = 1; x < camera_.width - 1; ++x) {
        Row sum = Row::Zero();
        const auto add = [&](int xa, int ya, int xb, int yb) {
            Row flux;
            double share_a = 0;
            add_side(xa, ya, xb, yb, share_a, flux);
            const bool has_a = xa / s == x && ya / s == y && xa >= 0 && ya >= 0;
            const bool has_b = xb / s == x && yb / s == y;
            sum += flux * ((has_a ? share_a : 0) + (has_b ? 1 - share_a : 0));
        };
        for (int j = 0; j < s; ++j)
            for (int i = -1; i < s; ++i) {
                add(x * s + i, y * s + j, x * s + i + 1, y * s + j);
                add(x * s + j, y * s + i, x * s + j, y * s + i + 1);
            }
        derivative_[static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.width) +
                    static_cast<std::size_t>(x)] = (sum / area).cast<float>();
    }
}

/// What moves across the side between two neighbours, a to the left of or above b: DN times fine pixels. Its point
/// lies in a's pixel or in b's, or on the border of both.
void ImageDerivative::add_side(int xa, int ya, int xb, int yb, double& share_a, Row& flux) const {
    const std::size_t a = fine_index(xa, ya), b = fine_index(xb, yb);
    const Aovs& seen = fine_.aovs();
    const double jump = static_cast<double>(signal_[a]) - static_cast<double>(signal_[b]);
    share_a = 0.5;
    const std::size_t near = seen.depth_m[a] <= seen.depth_m[b] ? a : b;
    const bool rides_along = seen.body[near] >= 0 && seen.body[near] == camera_.mount;
    if (jump == 0 || seen.body[near] < 0 || rides_along) {
        flux.setZero();
        return;
    }
    double along = 0.5, depth_m = seen.depth_m[near];
    const Camera& c = fine_.camera();
    const Vec3 ray_a = camera_ray(c, fine_.T_world_camera(), xa, ya).direction;
    const Vec3 ray_b = camera_ray(c, fine_.T_world_camera(), xb, yb).direction;
    if (is_contour(a, b, ray_a, ray_b)) {
        find_contour(xa, ya, xb, yb, near, along, depth_m);
        share_a = along < 0.5 ? 1 : 0;
    }
    flux = jump * velocity(xa + along * (xb - xa), ya + along * (yb - ya), depth_m, ya == yb);
}

/// Are the two not neighbouring points of one surface? Judged by the slopes that their normals tell.
bool ImageDerivative::is_contour(std::size_t a, std::size_t b, const Vec3& ray_a, const Vec3& ray_b) const {
    const Aovs& seen = fine_.aovs();
    if (seen.body[a] != seen.body[b]) return true;
    const double cosine = std::max(
        std::min(std::abs(dot(seen.normal[a], ray_a)), std::abs(dot(seen.normal[b], ray_b))), kLeastCosine);
    const double step_m = std::max(seen.range_m[a], seen.range_m[b]) * norm(ray_a - ray_b) / cosine;
    return norm(seen.position[a] - seen.position[b]) > kSurfaceSteps * step_m;
}

/// Where between a (0) and b (1) the nearer surface ends, and its depth there.
void ImageDerivative::find_contour(int xa, int ya, int xb, int yb, std::size_t near, double& along,
                                   double& depth_m) const {
    const Aovs& seen = fine_.aovs();
    const bool near_is_a = near == fine_index(xa, ya);
    const std::size_t far = near_is_a ? fine_index(xb, yb) : fine_index(xa, ya);
    double on_near = near_is_a ? 0 : 1, on_far = 1 - on_near;
    const Vec3 axis = fine_.T_world_camera().q * Vec3{0, 0, 1};
    for (int k = 0; k < kHalvings; ++k) {
        const double middle = 0.5 * (on_near + on_far);
        const Ray ray =
            camera_ray(fine_.camera(), fine_.T_world_camera(), xa + middle * (xb - xa), ya + middle * (yb - ya));
        const Hit hit = fine_.tracer().intersect(fine_.placement(), ray, std::numeric_limits<double>::infinity());
        const double here_m = hit.body < 0 ? seen.depth_m[far] : hit.range_m * dot(ray.direction, axis);
        const bool is_near = hit.body >= 0 && (hit.body != seen.body[far] ||
                                               std::abs(here_m - depth_m) < std::abs(here_m - seen.depth_m[far]));
        if (is_near) {
            on_near = middle;
            depth_m = here_m;
        } else {
            on_far = middle;
        }
    }
    along = 0.5 * (on_near + on_far);
}

/// Of the point at this place of the fine image, across a side: fine pixels per unit of the pose's error.
ImageDerivative::Row ImageDerivative::velocity(double x, double y, double depth_m, bool horizontal) const {
    const Camera& c = fine_.camera();
    const double u = (x - c.cx) / c.fx, v = (y - c.cy) / c.fy;
    const Vec3 a = depth_m * Vec3{u, v, 1} - t_camera_target_;  // about the target's origin, in camera axes
    const Vec3 move = horizontal ? (c.fx / depth_m) * Vec3{1, 0, -u} : (c.fy / depth_m) * Vec3{0, 1, -v};
    Row row;
    row << to_eigen(cross(a, move)), to_eigen(move);
    return row;
}

/// The Sun's light that comes back to a camera displaced against the target, by central differences of the BSDF.
ImageDerivative::Row ImageDerivative::shading(int x, int y, const SensorModel& sensor) const {
    const Tracer& tracer = fine_.tracer();
    const SunDisc sun(*tracer.scene().sun);
    const Rigid3& T_world_camera = fine_.T_world_camera();
    Vec3 per_metre{};  // DN per metre of the surface against the camera, world axes
    for (int j = 0; j < kShadingPoints; ++j)
        for (int i = 0; i < kShadingPoints; ++i) {
            const double offset = 0.5 / kShadingPoints - 0.5, step = 1.0 / kShadingPoints;
            const Ray ray = camera_ray(camera_, T_world_camera, x + offset + step * i, y + offset + step * j);
            const Hit hit = tracer.intersect(fine_.placement(), ray, std::numeric_limits<double>::infinity());
            if (hit.body < 0 || hit.body == camera_.mount) continue;
            if (!depends_on_view(tracer.scene().materials[static_cast<std::size_t>(hit.material)])) continue;
            const Surface surface =
                surface_at(tracer, fine_.placement(), hit, ray.direction, hit.range_m / fine_.camera().fx);
            const double cosine = dot(surface.normal, sun.centre());
            if (cosine <= 0 ||
                tracer.occluded(fine_.placement(), hit, sun.centre(), std::numeric_limits<double>::infinity()))
                continue;
            const Vec3 seen = hit.range_m * ray.direction;
            const auto shine = [&](const Vec3& displaced) {
                return signal_of(sensor, bsdf(surface, surface.normal, sun.centre(), -normalized(displaced)));
            };
            const double d = kViewStep * hit.range_m;
            const Vec3 change{shine(seen + Vec3{d, 0, 0}) - shine(seen - Vec3{d, 0, 0}),
                              shine(seen + Vec3{0, d, 0}) - shine(seen - Vec3{0, d, 0}),
                              shine(seen + Vec3{0, 0, d}) - shine(seen - Vec3{0, 0, d})};
            per_metre += (cosine * static_cast<double>(sun.irradiance()) / (2 * d)) * change;
        }
    // Against the target's axes the camera moves by what the target's origin moves, less what turns it about there.
    const Vec3 g = conjugate(T_world_camera.q) * per_metre / (kShadingPoints * kShadingPoints);
    Row row;
    row << to_eigen(-cross(t_camera_target_, g)), to_eigen(g);
    return row;
}

}  // namespace narpa
