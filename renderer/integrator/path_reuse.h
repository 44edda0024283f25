/// renderer/integrator/path_reuse.h - light that one path has found lights the points of its neighbours as well.
///
/// Most rays that leave a spacecraft's surfaces meet nothing, and the few that meet a sunlit part of it bring all
/// that its other parts send. So the points that those few find are joined to thirty-two points from which paths
/// set out, their own among them, by rays that ask for visibility alone, and each such point stands for all of
/// them: multiple importance sampling by the balance heuristic over the points that could have found it (P.
/// Bekaert, M. Sbert, J. Halton, "Accelerating path tracing by re-using paths", EGWR 2002). Nothing is biased, as
/// visibility is known for every pair; a point's own find never weighs more than its albedo, so corners send no
/// fireflies.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "renderer/integrator/path.h"
#include "renderer/integrator/path_vertex.h"
#include "renderer/integrator/path_state.h"

namespace narpa {

/// A point that a path from one of the starts has found, and the light that falls in on it.
struct Bounce {
    struct Incident {
        Vec3 from{};  ///< unit
        Rgb light{};  ///< irradiance on a surface that faces it, W m^-2, or what stands for it by its density
    };
    enum : std::size_t { sun, emitter, path, kIncidents };

    PathPoint point;
    Vec3 position{};             ///< world
    double touching_m = 0;       ///< what stands so close before it cannot be told from it
    std::size_t found_from = 0;  ///< the start
    std::array<Incident, kIncidents> incident{};

    /// May it stand for others? It must send light to all directions of its side.
    [[nodiscard]] static bool possible(const PathPoint& point) noexcept;
    /// Radiance towards a unit direction on its side.
    [[nodiscard]] Rgb towards(const Vec3& direction) const noexcept;
};

/// The points from which paths set out: first surfaces of up to kSharing rays.
class Starts {
public:
    void clear() noexcept { n_ = 0; }
    /// One that is lit already. `ray`: whose radiance it adds to; `chance`: with which a path sets out. Returns its
    /// number.
    int add(const BodyPoses& at, const FirstSurface& first, std::size_t ray, float chance) noexcept;
    /// Any other.
    int add(const BodyPoses& at, const Hit& hit, const PathPoint& point, const Path& path, float chance) noexcept;

    /// Adds to each start's radiance what the bounces send it that were found from it or from others of its
    /// sixteen, as they were added one after another. `choice`: in [0, 1), chooses some of the bounces where they
    /// are many. `variance`: out, of the mean band of what was added, as far as one go can tell. Returns the number
    /// of rays.
    std::uint64_t gather(const Tracer& tracer, const BodyPoses& at, std::span<Bounce> bounces, double choice,
                         double pixel_angle_rad, std::span<Rgb> radiance, std::span<float> variance) noexcept;

private:
    struct Block {
        std::uint32_t special;  ///< those that reflect by another law than Lambert's about `plane`
        std::uint32_t guided;   ///< of these those from which rays are guided
        HitBatch hits;         ///< what of them tells where rays leave
        Vec3Lanes origin, plane;
        RgbLanes diffuse;  ///< over pi
        Lanes<float> chance;
    };
    /// What a bounce is to sixteen starts.
    struct Join {
        Vec3Lanes direction;
        Lanes<double> range_m, density, geometry;
        RgbLanes reflected;  ///< BSDF times cosine
        std::uint32_t lit;
    };

    [[nodiscard]] Block& next_block() noexcept;
    void make_points(const Tracer& tracer, const BodyPoses& at, double pixel_angle_rad) noexcept;
    [[nodiscard]] std::size_t blocks() const noexcept { return (n_ + kLanes - 1) / kLanes; }
    static void join(const Block& b, const Bounce& bounce, Join& j) noexcept;
    std::uint64_t join_seen(const Tracer& tracer, const BodyPoses& at, std::size_t block, const Bounce& bounce,
                            Join& j) const noexcept;
    std::uint64_t gather(const Tracer& tracer, const BodyPoses& at, const Bounce& bounce, float scale,
                         std::span<Rgb> radiance) noexcept;

    std::size_t n_ = 0;
    std::array<Block, kSharing / kLanes> block_;
    std::array<std::uint32_t, kSharing> ray_;
    std::array<float, kSharing> sum_, squares_;      ///< of the mean bands that bounces send to each
    std::array<const FirstSurface*, kSharing> lit_;  ///< null: the others
    Room<PathPoint> points_;                         ///< of those that are special
    Room<Path> paths_;                               ///< of those that are guided
};

}  // namespace narpa
