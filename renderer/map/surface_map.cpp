#include "renderer/map/surface_map.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace narpa {

Vec3 SurfaceMap::position_at(const ImagePoint& p) const {
    const int x = std::clamp(static_cast<int>(p.x), 0, quantity.width - 1);
    const int y = std::clamp(static_cast<int>(p.y), 0, quantity.height - 1);
    const double u = p.x - x, v = p.y - y;
    const auto pixel = [&](int dx, int dy) {
        return position_m[static_cast<std::size_t>(y + dy) * static_cast<std::size_t>(quantity.width) +
                          static_cast<std::size_t>(x + dx)];
    };
    const auto along_row = [&](int dy) { return u > 0 ? (1 - u) * pixel(0, dy) + u * pixel(1, dy) : pixel(0, dy); };
    return v > 0 ? (1 - v) * along_row(0) + v * along_row(1) : along_row(0);
}

SurfaceMapper::SurfaceMapper(const Tracer& tracer, const BodyPoses& at, const Camera& camera,
                             const Rigid3& T_world_camera, const MapQuantity& quantity)
    : tracer_(tracer),
      at_(at),
      camera_(camera),
      T_world_camera_(T_world_camera),
      T_frame_world_(quantity.body < 0 ? Rigid3{}
                                       : inverse(at.T_world_body[static_cast<std::size_t>(quantity.body)])),
      quantity_(quantity) {}

Hit SurfaceMapper::hit_at(const ImagePoint& p) const {
    Hit hit;
    if (camera_.model->sees(p))
        hit = tracer_.intersect(at_, camera_ray(camera_, T_world_camera_, p.x, p.y),
                                std::numeric_limits<double>::infinity());
    if (quantity_.body >= 0 && hit.body != quantity_.body) hit.body = -1;
    return hit;
}

namespace {

double quantity_of(const MapQuantity& q, const Vec3& position_m, const Hit& hit, const Vec3& from_camera_m) {
    switch (q.kind) {
        case MapQuantity::Kind::depth: return from_camera_m.z - q.datum_m;
        case MapQuantity::Kind::range: return hit.range_m - q.datum_m;
        case MapQuantity::Kind::height: return dot(q.up, position_m) - q.datum_m;
        case MapQuantity::Kind::radius: return norm(position_m) - q.datum_m;
    }
    return 0;
}

/// Towards the light of the hill shading, camera axes.
const Vec3 kToLight = normalized(Vec3{-0.5, -0.5, -std::sqrt(0.5)});

}  // namespace

SurfaceMap SurfaceMapper::map() const {
    const int width = camera_.width, height = camera_.height;
    const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    SurfaceMap out{{width, height, std::vector<double>(pixels, std::numeric_limits<double>::quiet_NaN())},
                   std::vector<Vec3>(pixels),
                   std::vector<float>(pixels)};
    const Quat R_camera_world = conjugate(T_world_camera_.q);
    tbb::parallel_for(0, height, [&](int y) {
        for (int x = 0; x < width; ++x) {
            const ImagePoint p{static_cast<double>(x), static_cast<double>(y)};
            const Hit hit = hit_at(p);
            if (hit.body < 0) continue;
            const std::size_t i =
                static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
            out.position_m[i] = T_frame_world_ * hit.position;
            out.quantity.values[i] =
                quantity_of(quantity_, out.position_m[i], hit, hit.range_m * camera_.model->direction(p));
            out.shade[i] = static_cast<float>(std::max(0.0, dot(R_camera_world * hit.shading_normal, kToLight)));
        }
    });
    return out;
}

bool SurfaceMapper::is_continuous(const ImagePoint& a, const ImagePoint& b) const {
    constexpr int kHalvings = 8;
    constexpr double kStepOfDifference = 0.25, kStepOfPixel = 0.1;
    ImagePoint from = a, to = b;
    Hit hit_from = hit_at(from), hit_to = hit_at(to);
    if (hit_from.body < 0 || hit_to.body < 0) return false;
    const double pixel_m = std::min(hit_from.range_m, hit_to.range_m) / camera_.model->pixels_per_radian();
    const double whole = std::abs(hit_to.range_m - hit_from.range_m);
    double difference = whole;
    for (int k = 0; k < kHalvings; ++k) {
        if (difference <= kStepOfPixel * pixel_m) return true;
        const ImagePoint middle{(from.x + to.x) / 2, (from.y + to.y) / 2};
        const Hit hit = hit_at(middle);
        if (hit.body < 0) return false;
        const double before = std::abs(hit.range_m - hit_from.range_m),
                     after = std::abs(hit_to.range_m - hit.range_m);
        if (before > after)
            to = middle, hit_to = hit;
        else
            from = middle, hit_from = hit;
        difference = std::max(before, after);
    }
    return difference <= std::max(kStepOfDifference * whole, kStepOfPixel * pixel_m);
}

}  // namespace narpa
