/// renderer/trace/shared_bounces.h - light that one path has found lights the points of its neighbours as well.
///
/// Most rays that leave a spacecraft's surfaces meet nothing, and the few that meet a sunlit part of it bring all
/// that its other parts send. So the points that those few find are joined to all the points from which paths set
/// out together, by rays that ask for visibility alone, and each such point stands for all of them: multiple
/// importance sampling by the balance heuristic over the points that could have found it (P. Bekaert, M. Sbert,
/// J. Halton, "Accelerating path tracing by re-using paths", EGWR 2002). Nothing is biased, as visibility is known
/// for every pair; a point's own find never weighs more than its albedo, so corners send no fireflies.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "renderer/trace/path_point.h"
#include "renderer/trace/path_state.h"

namespace narpa {

/// A point that a path from one of the receivers has found, and the light that falls in on it.
struct Bounce {
    struct Incident {
        Vec3 from{};  ///< unit
        Rgb light{};  ///< irradiance on a surface that faces it, W m^-2, or what stands for it by its density
    };
    enum : std::size_t { sun, emitter, path, kIncidents };

    PathPoint point;
    Vec3 position{};             ///< world
    double touching_m = 0;       ///< what stands so close before it cannot be told from it
    std::size_t found_from = 0;  ///< receiver
    std::array<Incident, kIncidents> incident{};

    /// May it stand for others? It must send light to all directions of its side.
    [[nodiscard]] static bool possible(const PathPoint& point) noexcept;
    /// Radiance towards a unit direction on its side.
    [[nodiscard]] Rgb towards(const Vec3& direction) const noexcept;
};

/// The points from which paths set out.
class Starts {
public:
    void clear() noexcept { n_ = 0; }
    [[nodiscard]] std::size_t size() const noexcept { return n_; }
    /// `chance`: with which a path sets out.
    void add(const Placement& at, const Hit& hit, const PathPoint& point, const Path& path, float chance) noexcept;

    /// Adds to each receiver's radiance what the bounces send it. `choice`: in [0, 1), chooses some of the bounces
    /// where they are many. Returns the number of rays.
    std::uint64_t gather(const Tracer& tracer, const Placement& at, std::span<Bounce> bounces, double choice,
                         std::span<Rgb> radiance) const noexcept;

private:
    /// Sixteen of them.
    struct Block {
        HitPacket hits;
        VecPerRay origin, plane;
        RgbPerRay diffuse;  ///< over pi
        Lanes<double> chance;
        std::uint32_t special =
            0;  ///< those that reflect by another law than Lambert's about `plane`, or are guided
    };
    /// What a bounce is to sixteen receivers.
    struct Join {
        VecPerRay direction;
        Lanes<double> range_m, density, geometry;
        std::uint32_t lit = 0;
    };

    static void join(const Block& b, const Bounce& bounce, Join& j) noexcept;
    std::uint64_t gather(const Tracer& tracer, const Placement& at, const Bounce& bounce, float scale,
                         std::span<Rgb> radiance) const noexcept;
    [[nodiscard]] std::size_t blocks() const noexcept { return (n_ + kPacket - 1) / kPacket; }

    std::size_t n_ = 0;
    std::array<Block, kStream / kPacket> block_;
    Room<PathPoint> points_;
    Room<Path> paths_;
};

}  // namespace narpa
