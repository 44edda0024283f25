/// renderer/geometry/ray_batch.h - rays and hits, sixteen side by side.
#pragma once

#include <cstdint>
#include <utility>

#include "base/lanes.h"
#include "renderer/geometry/body_poses.h"

namespace narpa {

/// One lane of a RayBatch.
struct Ray {
    Vec3 origin{};
    Vec3 direction{};  ///< unit
    double time = kMidExposure;
};

/// One lane of a HitBatch: the nearest surface along a ray. `body` < 0: nothing was hit and the rest is undefined.
struct Hit {
    int body = -1;
    std::uint32_t face = 0;   ///< triangle of a mesh; 0 on an ellipsoid
    double range_m = 0;       ///< from the ray's origin
    Vec3 position{};          ///< world, metres
    Vec3 geometric_normal{};  ///< world, unit, towards the ray's origin
    Vec3 shading_normal{};    ///< world, unit, same side
    float u = 0, v = 0;       ///< texture coordinates; 0 where the material has no texture
    int material = 0;         ///< index into Scene::materials
    bool outside = true;      ///< the ray came from the outer side, by the winding of the face
    Vec3 departure_body{};  ///< body frame: start of rays that leave, before the offset for rounding: the position,
                            ///< or a point above it on the smooth surface of the vertex normals
    Vec3 beyond_body{};     ///< the same for rays that leave on the other side
    double time = kMidExposure;  ///< of the ray
};

/// The same point with its sides swapped: for transmitted light.
[[nodiscard]] inline Hit other_side(const Hit& hit) noexcept {
    Hit other = hit;
    other.geometric_normal = -hit.geometric_normal;
    other.shading_normal = -hit.shading_normal;
    other.outside = !hit.outside;
    std::swap(other.departure_body, other.beyond_body);
    return other;
}

inline constexpr Lanes<double> kMidExposureLanes = [] {
    Lanes<double> lanes{};
    lanes.fill(kMidExposure);
    return lanes;
}();

/// Up to kLanes rays. Lanes from `n` on are not traced.
struct RayBatch {
    std::size_t n = 0;
    Vec3Lanes origin, direction;             ///< world, metres; unit
    Lanes<double> time = kMidExposureLanes;  ///< of use only where bodies move within the exposure

    [[nodiscard]] Ray operator[](std::size_t i) const { return {origin[i], direction[i], time[i]}; }
    void put(std::size_t i, const Ray& ray) {
        origin.put(i, ray.origin), direction.put(i, ray.direction), time[i] = ray.time;
    }
};

/// Surface points that rays leave: the members of Hit that define the start of such a ray.
struct SurfacePoints {
    std::uint32_t outside = 0;  ///< a bit for each lane
    Lanes<int> body;
    Lanes<std::uint32_t> face;
    Vec3Lanes departure_body;
    Lanes<double> time;

    void put(std::size_t i, const Hit& hit) {
        outside = (outside & ~(1u << i)) | static_cast<std::uint32_t>(hit.outside) << i;
        body[i] = hit.body, face[i] = hit.face, time[i] = hit.time;
        departure_body.put(i, hit.departure_body);
    }
    /// Copies lane j of another batch.
    void put(std::size_t i, const SurfacePoints& from, std::size_t j) {
        outside = (outside & ~(1u << i)) | (from.outside >> j & 1u) << i;
        body[i] = from.body[j], face[i] = from.face[j], time[i] = from.time[j];
        departure_body.put(i, from.departure_body[j]);
    }
};

/// The nearest surface along each ray of a batch. Where the lane's bit in `met` is not set, `body` is -1 and the
/// rest is undefined.
struct HitBatch : SurfacePoints {
    std::uint32_t met = 0;
    Lanes<double> range_m;
    Vec3Lanes position, geometric_normal, shading_normal;
    Lanes<float> u, v;
    Lanes<int> material;
    Vec3Lanes beyond_body;

    [[nodiscard]] Hit operator[](std::size_t i) const {
        if (body[i] < 0) return {};
        return {body[i],           face[i],        range_m[i], position[i], geometric_normal[i],
                shading_normal[i], u[i],           v[i],       material[i], is_set(outside, i),
                departure_body[i], beyond_body[i], time[i]};
    }
    void put(std::size_t i, const Hit& hit) {
        SurfacePoints::put(i, hit);
        met = (met & ~(1u << i)) | static_cast<std::uint32_t>(hit.body >= 0) << i;
        range_m[i] = hit.range_m;
        position.put(i, hit.position);
        geometric_normal.put(i, hit.geometric_normal);
        shading_normal.put(i, hit.shading_normal);
        u[i] = hit.u, v[i] = hit.v;
        material[i] = hit.material;
        beyond_body.put(i, hit.beyond_body);
    }
    void clear() {
        met = outside = 0;
        body.fill(-1);
    }
};

}  // namespace narpa
