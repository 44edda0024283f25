/// renderer/geometry/mesh_scene.h - one mesh as an Embree scene, asked with rays in double in the body's frame.
#pragma once

#include <optional>

#include "base/result.h"
#include "renderer/scene/scene.h"
#include "renderer/geometry/embree.h"
#include "renderer/geometry/lanes.h"
#include "renderer/geometry/triangle.h"

namespace narpa {

/// A point of a mesh that a ray meets, in the body's frame.
struct MeshHit {
    std::uint32_t face = 0;
    double range_m = 0;     ///< from the ray's origin
    TrianglePoint point{};  ///< on the triangle to rounding in double
};

/// Rays in the body's frame, as `MeshScene::intersect` takes one. All are finite, also those that are not asked.
struct MeshRays {
    Vec3Lanes origin, direction;
    Lanes<double> entry_m, t_max;
    std::uint32_t inside = 0;  ///< a bit for each that starts on the inner side of this mesh
};

/// The same for each ray, and what else is known by then.
struct MeshHits {
    std::uint32_t inner = 0;  ///< surely the inner side: the ray left this mesh's inner side before
    Lanes<std::uint32_t> face;
    Lanes<double> range_m;
    Vec3Lanes direction, position;
    Lanes<double> b1, b2;
    TriangleLanes triangle;

    [[nodiscard]] TrianglePoint point(std::size_t i) const { return {position[i], b1[i], b2[i]}; }
};

class MeshScene {
public:
    /// Builds the hierarchy in robust mode, on the calling thread's TBB arena. `mesh` must outlive it.
    static Result<MeshScene> build(RTCDevice device, const Mesh& mesh);

    /// Nearest hit with 0 <= range < t_max; origin and unit direction in the body's frame, the origin at any
    /// distance. `entry_m` is where the ray enters the sphere of reach_m() about the body's origin (negative from
    /// inside). Leaves `hit` as it was when there is none.
    bool intersect(const Vec3& origin, const Vec3& direction, double entry_m, double t_max,
                   MeshHit& hit) const noexcept;
    bool occluded(const Vec3& origin, const Vec3& direction, double entry_m, double t_max) const noexcept;

    /// The same for those of sixteen rays whose bit is set in `wanted`; returns the bits of those that hit. Others'
    /// `hits` stay as they were.
    std::uint32_t intersect(const MeshRays& rays, std::uint32_t wanted, embree::Run run,
                            MeshHits& hits) const noexcept;
    [[nodiscard]] std::uint32_t occluded(const MeshRays& rays, std::uint32_t wanted,
                                         embree::Run run) const noexcept;

    /// Where a ray starts that leaves this face at `position` (on it, or above it by a smooth surface's bulge) on
    /// its outer or inner side: lifted by as much as rounding in single precision can lower it, and as far from the
    /// face's edges that the lift does not take it through a neighbour at an angle of 7 degrees or more.
    [[nodiscard]] Vec3 departure(std::uint32_t face, const Vec3& position, bool outside) const noexcept;
    /// The same for those of sixteen rays whose bit is set in `wanted`; other `starts` stay as they were.
    void depart(const Lanes<std::uint32_t>& face, const Vec3Lanes& position, std::uint32_t outside,
                std::uint32_t wanted, Vec3Lanes& starts) const noexcept;

    /// Three corners in the body's frame, as the hierarchy holds them.
    [[nodiscard]] Triangle triangle(std::uint32_t face) const noexcept {
        const auto& f = mesh_->faces[face];
        return {vec_cast<double>(vertices_[f[0]]) + vertex_origin_,
                vec_cast<double>(vertices_[f[1]]) + vertex_origin_,
                vec_cast<double>(vertices_[f[2]]) + vertex_origin_};
    }
    [[nodiscard]] const Mesh& mesh() const noexcept { return *mesh_; }
    /// Radius of a sphere about the body's origin that holds the mesh.
    [[nodiscard]] double reach_m() const noexcept { return reach_m_; }

private:
    /// Where Embree takes over: at the entry, or at the entry of the tighter sphere about the mesh's own centre
    /// where that is worth while. 0 from inside; none if the ray misses, or meets the sphere beyond t_max.
    [[nodiscard]] std::optional<double> advance(const Vec3& origin, const Vec3& direction, double entry_m,
                                                double t_max) const noexcept;
    [[nodiscard]] RTCRay embree_ray(const Vec3& origin, const Vec3& direction, double length) const noexcept;

    /// What Embree says of a ray: which triangle, roughly where, from which side.
    struct Answer {
        std::uint32_t face = 0;
        float t = 0, u = 0, v = 0;
        bool hit = false, back = false;
    };
    [[nodiscard]] Answer ask(const Vec3& start, const Vec3& direction, double length) const noexcept;

    // Even in robust mode Embree loses some rays that meet a vertex (its issues 181, 188 and 387): they pass
    // through, and where the mesh is closed what they meet next shows them its wrong side, or from inside nothing.
    // They are common where a camera's pixels line up with a model's grid. Another try, turned by a few roundings,
    // finds what they lost; one that leaves the inner side close to an edge and runs along it needs to be turned by
    // more.
    static constexpr std::array kTurns{4e-7, -4e-7, 4e-3, -4e-3};  ///< radians
    [[nodiscard]] static Vec3 turned(const Vec3& d, double angle) noexcept {
        return d + angle * Vec3{d.y - d.z, d.z - d.x, d.x - d.y + 0.5};
    }
    /// Can this be all that the ray meets first? `inside`: it starts on the inner side of this closed mesh.
    [[nodiscard]] bool plausible(const Answer& answer, bool inside) const noexcept {
        return answer.hit ? answer.back == inside : closed_ && !inside;
    }
    /// Takes the answer to the turned ray where it is better.
    void consider(Answer& answer, const Answer& again, const Vec3& start, const Vec3& direction,
                  bool inside) const noexcept;

    /// Sixteen rays where Embree takes over, and its answers.
    struct Query {
        RTCRayHit16 rays;
        alignas(64) Lanes<int> valid;  ///< -1: to be traced
        Vec3Lanes start;
        Lanes<double> skipped_m;
        std::uint32_t asked = 0;          ///< as `valid`
        std::uint32_t hit = 0, back = 0;  ///< out

        void clear_hits() noexcept;
        void read_hits() noexcept;
        [[nodiscard]] Answer operator[](std::size_t i) const noexcept;
        void put(std::size_t i, const Answer& answer) noexcept;
    };
    void advance(const MeshRays& rays, std::uint32_t wanted, Query& query) const noexcept;
    /// Asks once more where the answer is not plausible. `inside`: of this closed mesh.
    void ask_again(const MeshRays& rays, std::uint32_t suspicious, std::uint32_t inside,
                   Query& query) const noexcept;

    const Mesh* mesh_ = nullptr;
    embree::Owned<RTCScene> scene_;
    const Vec3f* vertices_ = nullptr;  ///< Embree's own copy, relative to vertex_origin_
    Vec3 vertex_origin_{};
    Vec3 centre_{};
    double radius_m_ = 0, reach_m_ = 0;
    bool closed_ = false;      ///< a ray that misses the mesh cannot have slipped through it unseen
    bool off_centre_ = false;  ///< the sphere about the centre is clearly smaller than the one about the origin
};

}  // namespace narpa
