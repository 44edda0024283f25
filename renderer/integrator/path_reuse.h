/// renderer/integrator/path_reuse.h - path reuse: light found by one path also illuminates the first vertices of
/// its neighbours.
///
/// Most rays that leave a spacecraft's surfaces escape, and the few that hit a sunlit part carry all of its
/// indirect light. So shadow rays connect the second vertices of paths to thirty-two first vertices, their own
/// included, and each second vertex is weighted for all of these: multiple importance sampling by the balance
/// heuristic over the first vertices that could have found it (P. Bekaert, M. Sbert, J. Halton, "Accelerating path
/// tracing by re-using paths", EGWR 2002). Unbiased, because visibility is known for every pair. A second vertex
/// never weighs more in its own path than the albedo, so corners cause no fireflies.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "base/uninitialized_array.h"
#include "renderer/integrator/path.h"
#include "renderer/integrator/path_vertex.h"

namespace narpa {

/// The second vertex of a path, and the light incident on it.
struct SecondVertex {
    struct Incident {
        Vec3 from{};  ///< unit
        Rgb light{};  ///< irradiance on a surface that faces it, W m^-2, or radiance / density
    };
    enum : std::size_t { sun, emitter, background, path, kIncidents };

    SecondVertex(const Tracer& tracer, const PathVertex& vertex, const Hit& hit, std::size_t found_from) noexcept;

    PathVertex vertex;
    Vec3 position;           ///< world
    double touching_m;       ///< distance below which surfaces coincide within rounding
    std::size_t found_from;  ///< index of its path's first vertex
    std::array<Incident, kIncidents> incident{};

    /// True for BSDFs that scatter over the whole hemisphere.
    [[nodiscard]] static bool is_reusable(const PathVertex& vertex) noexcept;
    /// Continues a path in the direction of `s`; the light that it finds is then incident here. `inverse_survival`:
    /// 1 / survival probability. False: the direction has no density.
    [[nodiscard]] bool leave(Path& path, const BsdfSample& s, float inverse_survival) noexcept;
    /// Radiance towards a unit direction on its side.
    [[nodiscard]] Rgb radiance(const Vec3& direction) const noexcept;
};

/// The first vertices of up to kReuseGroup paths.
class FirstVertices {
public:
    void clear() noexcept { n_ = 0; }
    /// Adds a vertex whose direct light is known. `path`: gives the ray to whose radiance it adds, and the small
    /// bodies; `survival`: probability that the path leaves the vertex. Returns its index.
    int add(const BodyPoses& at, const PathStart& start, const Path& path, float survival) noexcept;
    /// Adds any other vertex.
    int add(const BodyPoses& at, const Hit& hit, const PathVertex& vertex, const Path& path,
            float survival) noexcept;

    /// Adds to each first vertex's radiance the light that it receives from the second vertices of its group of
    /// thirty-two. `choice`: in [0, 1), selects some of the second vertices if there are many. `variance`: out,
    /// estimated for the mean band of the added light. Returns the number of rays.
    std::uint64_t gather(const Tracer& tracer, const BodyPoses& at, std::span<SecondVertex> second, double choice,
                         double pixel_angle_rad, std::span<Rgb> radiance, std::span<float> variance) noexcept;

private:
    struct Block {
        std::uint32_t special;       ///< lanes that do not scatter by Lambert's law about `plane` alone
        std::uint32_t small_bodies;  ///< lanes of these that sample small bodies
        SurfacePoints points;
        Vec3Lanes origin, plane;
        RgbLanes diffuse;  ///< over pi
        Lanes<float> survival;
    };
    /// Connections of a second vertex to the lanes of a block.
    struct Join {
        Vec3Lanes direction;
        Lanes<double> range_m, density, geometry;
        RgbLanes reflected;  ///< BSDF times cosine
        std::uint32_t lit;
    };

    [[nodiscard]] Block& next_block() noexcept;
    int add_to(Block& b, const Path& path, float survival, const PathStart* lit) noexcept;
    void make_vertices(const Tracer& tracer, const BodyPoses& at, double pixel_angle_rad) noexcept;
    [[nodiscard]] std::size_t blocks() const noexcept { return (n_ + kLanes - 1) / kLanes; }
    static void join(const Block& b, const SecondVertex& second, Join& j) noexcept;
    std::uint64_t join_visible(const Tracer& tracer, const BodyPoses& at, std::size_t block,
                               const SecondVertex& second, Join& j) const noexcept;
    std::uint64_t gather(const Tracer& tracer, const BodyPoses& at, const SecondVertex& second, float scale,
                         std::span<Rgb> radiance) noexcept;

    std::size_t n_ = 0;
    std::array<Block, kReuseGroup / kLanes> block_;
    std::array<std::uint32_t, kReuseGroup> ray_;
    std::array<float, kReuseGroup> sum_, squares_;          ///< of the mean bands received
    std::array<const PathStart*, kReuseGroup> lit_;         ///< null: vertices whose direct light is not known
    UninitializedArray<PathVertex, kReuseGroup> vertices_;  ///< of special lanes
    UninitializedArray<Path, kReuseGroup> paths_;           ///< of lanes that sample small bodies
};

}  // namespace narpa
