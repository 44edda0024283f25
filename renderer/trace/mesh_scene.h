/// renderer/trace/mesh_scene.h - one mesh as an Embree scene, asked with rays in double in the body's frame.
#pragma once

#include <optional>

#include "base/result.h"
#include "renderer/scene/scene.h"
#include "renderer/trace/embree.h"
#include "renderer/trace/packet.h"

namespace narpa {

/// A point of a mesh that a ray meets.
struct MeshHit {
    std::uint32_t face = 0;
    double range_m = 0;     ///< from the ray's origin
    Vec3 position{};        ///< body frame, on the triangle to rounding in double
    double b1 = 0, b2 = 0;  ///< barycentric weights of the face's second and third vertex
    bool inner = false;     ///< surely the inner side: the ray left this mesh's inner side before
};

/// Rays in the body's frame, as `MeshScene::intersect` takes one. All are finite, also those that are not asked.
struct MeshRays {
    VecPerRay origin, direction;
    Lanes<double> entry_m, t_max;
    std::uint32_t inside = 0;  ///< a bit for each that starts on the inner side of this mesh
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

    /// The same for those of sixteen rays whose bit is set in `wanted`; returns the bits of those that hit.
    std::uint32_t intersect(const MeshRays& rays, std::uint32_t wanted, embree::Run run,
                            std::span<MeshHit, kPacket> hits) const noexcept;
    [[nodiscard]] std::uint32_t occluded(const MeshRays& rays, std::uint32_t wanted) const noexcept;

    /// Where a ray starts that leaves this face at `position` (on it, or above it by a smooth surface's bulge) on
    /// its outer or inner side: lifted by as much as rounding in single precision can lower it, and as far from the
    /// face's edges that the lift does not take it through a neighbour at an angle of 7 degrees or more.
    [[nodiscard]] Vec3 departure(std::uint32_t face, const Vec3& position, bool outside) const noexcept;

    /// Three corners in the body's frame, as the hierarchy holds them.
    [[nodiscard]] std::array<Vec3, 3> corners(std::uint32_t face) const noexcept;
    [[nodiscard]] const Mesh& mesh() const noexcept { return *mesh_; }
    /// Radius of a sphere about the body's origin that holds the mesh.
    [[nodiscard]] double reach_m() const noexcept { return reach_m_; }

private:
    /// Where Embree takes over: at the entry, or at the entry of the tighter sphere about the mesh's own centre
    /// where that is worth while. 0 from inside; none if the ray misses, or meets the sphere beyond t_max.
    [[nodiscard]] std::optional<double> advance(const Vec3& origin, const Vec3& direction, double entry_m,
                                                double t_max) const noexcept;
    /// Rays where Embree takes over.
    struct Starts {
        std::uint32_t asked = 0;       ///< those that Embree is to trace
        alignas(64) Lanes<int> valid;  ///< the same, for Embree
        Lanes<double> skipped_m;
        VecPerRay at;
    };
    [[nodiscard]] Starts advance(const MeshRays& rays, std::uint32_t wanted, RTCRay16& query) const noexcept;
    /// What Embree says of a ray: which triangle, roughly where, from which side.
    struct Answer {
        std::uint32_t face = 0;
        float t = 0, u = 0, v = 0;
        bool hit = false, back = false;
    };
    [[nodiscard]] Answer ask(const Vec3& start, const Vec3& direction, double length) const noexcept;
    [[nodiscard]] RTCRay embree_ray(const Vec3& origin, const Vec3& direction, double length) const noexcept;
    /// Asks once more where the answer is suspicious, and solves the hit in double.
    bool settle(Answer answer, const Vec3& start, const Vec3& direction, double skipped_m, double t_max,
                bool inside, MeshHit& hit) const noexcept;

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
