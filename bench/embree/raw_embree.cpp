#include "bench/embree/raw_embree.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <limits>
#include <memory>

#include "base/each_isa.h"
#include "base/time.h"
#include "bench/embree/raw_embree_scene.h"

namespace narpa {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

/// The hit of a pixel's ray.
struct RawHit {
    float depth;   ///< infinite: nothing
    Vec3f normal;  ///< not unit
};

using TileHits = std::array<RawHit, static_cast<std::size_t>(kRawTile* kRawTile)>;
std::size_t place(int x, int y) {
    return static_cast<std::size_t>(y * kRawTile + x);
}

/// Rays through 4 x 4 pixels.
NARPA_EACH_ISA void aim(const RawAim& a, int x, int y, RTCRayHit16& q) {
    for (int i = 0; i < 16; ++i) {
        const auto u = static_cast<float>(x + i % 4), v = static_cast<float>(y + i / 4);
        q.ray.dir_x[i] = a.ahead.x + u * a.across.x + v * a.down.x;
        q.ray.dir_y[i] = a.ahead.y + u * a.across.y + v * a.down.y;
        q.ray.dir_z[i] = a.ahead.z + u * a.across.z + v * a.down.z;
        q.ray.org_x[i] = a.origin.x, q.ray.org_y[i] = a.origin.y, q.ray.org_z[i] = a.origin.z;
        q.ray.tnear[i] = 0, q.ray.tfar[i] = kFar;
        q.ray.time[i] = 0, q.ray.mask[i] = ~0u, q.ray.id[i] = 0, q.ray.flags[i] = 0;
        q.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID, q.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
}

/// Rays to the Sun, gathered until there are sixteen.
struct ShadowRays {
    alignas(64) RTCRay16 q{};
    alignas(64) std::array<int, 16> valid{};
    int n = 0;
    std::uint64_t traced = 0, shadowed = 0;

    explicit ShadowRays(const Vec3f& to_sun) {
        for (int i = 0; i < 16; ++i)
            q.dir_x[i] = to_sun.x, q.dir_y[i] = to_sun.y, q.dir_z[i] = to_sun.z, q.mask[i] = ~0u;
    }
    void add(const Vec3f& from) {
        q.org_x[n] = from.x, q.org_y[n] = from.y, q.org_z[n] = from.z;
        q.tnear[n] = 1e-4f, q.tfar[n] = kFar;
        ++n;
    }
    void trace(RTCScene scene) {
        for (int i = 0; i < 16; ++i) valid[static_cast<std::size_t>(i)] = i < n ? -1 : 0;
        embree::occluded(scene, valid.data(), q, embree::Run::together);
        for (int i = 0; i < n; ++i) shadowed += q.tfar[i] < 0;
        traced += static_cast<std::uint64_t>(n);
        n = 0;
    }
};

/// Traces the rays through a tile's pixel centres. `hits`: out, row by row.
std::uint64_t trace_primary(const RawAim& a, RTCScene scene, const RawTile& tile, TileHits& hits) {
    alignas(64) RTCRayHit16 q{};
    alignas(64) std::array<int, 16> valid{};
    std::uint64_t met = 0;
    const int x0 = tile.cols().begin(), y0 = tile.rows().begin();
    for (int y = y0; y < tile.rows().end(); y += 4)
        for (int x = x0; x < tile.cols().end(); x += 4) {
            aim(a, x, y, q);
            for (int i = 0; i < 16; ++i)
                valid[static_cast<std::size_t>(i)] =
                    x + i % 4 < tile.cols().end() && y + i / 4 < tile.rows().end() ? -1 : 0;
            embree::intersect(scene, valid.data(), q, embree::Run::together);
            for (int i = 0; i < 16; ++i) {
                if (valid[static_cast<std::size_t>(i)] == 0) continue;
                const bool hit = q.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
                met += hit ? 1 : 0;
                hits[place(x + i % 4 - x0, y + i / 4 - y0)] = {hit ? q.ray.tfar[i] : kFar,
                                                               {q.hit.Ng_x[i], q.hit.Ng_y[i], q.hit.Ng_z[i]}};
            }
        }
    return met;
}

/// Traces shadow rays from all hits of a tile that face the Sun, 4 x 4 pixels after 4 x 4 pixels.
void trace_shadows(const RawAim& a, RTCScene scene, const RawTile& tile, const TileHits& hits, const Vec3f& sun,
                   ShadowRays& shadows) {
    const int width = static_cast<int>(tile.cols().size()), height = static_cast<int>(tile.rows().size());
    for (int y0 = 0; y0 < height; y0 += 4)
        for (int x0 = 0; x0 < width; x0 += 4)
            for (int y = y0; y < std::min(y0 + 4, height); ++y)
                for (int x = x0; x < std::min(x0 + 4, width); ++x) {
                    const RawHit& h = hits[place(x, y)];
                    if (h.depth == kFar) continue;
                    const Vec3f d = a.ahead + static_cast<float>(x + tile.cols().begin()) * a.across +
                                    static_cast<float>(y + tile.rows().begin()) * a.down;
                    if ((dot(h.normal, sun) > 0) == (dot(h.normal, d) > 0)) continue;  // the Sun is behind it
                    shadows.add(a.origin + h.depth * d);
                    if (shadows.n == 16) shadows.trace(scene);
                }
    if (shadows.n > 0) shadows.trace(scene);
}

RawCost trace(const RawScene& raw, const RawAim& a, const Camera& camera, const Vec3f& sun) {
    const RTCScene scene = raw.scene.get();
    std::atomic<std::uint64_t> met{0}, traced{0}, shadowed{0};
    std::atomic<std::int64_t> primary_ns{0}, shadow_ns{0};
    const std::int64_t start_ns = monotonic_ns();
    over_raw_tiles(camera, [&](const RawTile& tile) {
        const std::int64_t tile_start_ns = monotonic_ns();
        TileHits hits;
        met += trace_primary(a, scene, tile, hits);
        const std::int64_t primary_end_ns = monotonic_ns();
        ShadowRays shadows(sun);
        trace_shadows(a, scene, tile, hits, sun, shadows);
        traced += shadows.traced, shadowed += shadows.shadowed;
        primary_ns += primary_end_ns - tile_start_ns, shadow_ns += monotonic_ns() - primary_end_ns;
    });
    RawCost cost;
    const double wall_s = seconds_since(start_ns);
    cost.primary_s = wall_s * static_cast<double>(primary_ns) / static_cast<double>(primary_ns + shadow_ns);
    cost.shadow_s = wall_s - cost.primary_s;
    cost.primaries = static_cast<std::uint64_t>(camera.width) * static_cast<std::uint64_t>(camera.height);
    cost.hits = met, cost.shadow_rays = traced, cost.shadowed = shadowed;
    return cost;
}

}  // namespace

Result<RawFrame> raw_embree(const Scene& scene, const BodyPoses& at) {
    auto raw = RawScene::build(scene, at);
    if (!raw) return raw.error();
    return RawFrame([raw = std::make_shared<RawScene>(*std::move(raw))](const Camera& camera, const Rigid3& T,
                                                                        const Vec3& to_sun) {
        return trace(*raw, RawAim(camera, T), camera, vec_cast<float>(to_sun));
    });
}

}  // namespace narpa
