/// renderer/trace/mesh_scene.h - one mesh as an Embree scene, asked with rays in double in the body's frame.
#pragma once

#include <optional>

#include "base/result.h"
#include "renderer/scene/scene.h"
#include "renderer/trace/embree.h"
#include "renderer/trace/tracer.h"

namespace narpa {

/// A point of a mesh that a ray meets.
struct MeshHit {
    std::uint32_t face = 0;
    double range_m = 0;     ///< from the ray's origin
    Vec3 position{};        ///< body frame, on the triangle to rounding in double
    double b1 = 0, b2 = 0;  ///< barycentric weights of the face's second and third vertex
};

/// Rays in the body's frame, as `MeshScene::intersect` takes one.
struct MeshRays {
    std::array<Vec3, kPacket> origin, direction;
    std::array<double, kPacket> entry_m, t_max;
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

    /// The same for those of sixteen rays whose bit is set in `wanted`; returns the bits of those that hit. Rays of
    /// `intersect` run close together, those of `occluded` need not.
    std::uint32_t intersect(const MeshRays& rays, std::uint32_t wanted,
                            std::span<MeshHit, kPacket> hits) const noexcept;
    [[nodiscard]] std::uint32_t occluded(const MeshRays& rays, std::uint32_t wanted) const noexcept;

    /// How far above a point of this face a ray must start so that rounding in single precision cannot put it
    /// below.
    [[nodiscard]] double departure_offset_m(std::uint32_t face, const Vec3& position) const noexcept;

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
                MeshHit& hit) const noexcept;

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
