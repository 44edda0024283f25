/// renderer/geometry/mesh_shape.h - triangles: found by Embree in single precision, solved again in double.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "base/result.h"
#include "renderer/geometry/embree.h"
#include "renderer/geometry/shape.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// A tree of boxes, root first, every node before its children; empty for a mesh without faces. Each triangle, to
/// rounding in single precision, lies in the union of the leaves, in pieces where it is large: a box about a whole
/// panel that stands askew would hold mostly nothing. Boxes are cut one at a time, the one with the largest surface
/// first, where the surfaces of the halves weigh least (J. Goldsmith, J. Salmon, "Automatic creation of object
/// hierarchies for ray tracing", IEEE CG&A 7(5), 1987), so that the leaves are of like size.
[[nodiscard]] std::vector<BoxNode> box_tree(const Mesh& mesh);

/// Every edge is passed as often in one direction as in the other, with vertices identified by position alone: a
/// ray that meets the mesh from outside meets its outer side first. Several shells may be closed together.
[[nodiscard]] bool is_closed(const Mesh& mesh);

/// The faces that shine; null where none does. Scene and mesh must outlive it.
[[nodiscard]] std::unique_ptr<const EmissiveSurface> mesh_emission(const Scene& scene, const Mesh& mesh);

class MeshShape final : public Shape {
public:
    /// Builds the hierarchy in robust mode, on the calling thread's TBB arena. The scene must outlive the shape; an
    /// error names the mesh.
    static Result<std::shared_ptr<const MeshShape>> build(RTCDevice device, const Scene& scene, const Mesh& mesh);

    std::uint32_t intersect(const ShapeRays& rays, std::uint32_t wanted, ShapeHits& hits) const noexcept override {
        return trace(rays, wanted, hits);
    }
    [[nodiscard]] std::uint32_t occluded(const ShapeRays& rays, std::uint32_t wanted) const noexcept override {
        return trace_shadows(rays, wanted);
    }
    void surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept override;
    /// Lifted by as much as rounding in single precision can lower a start, and kept so far from the face's edges
    /// that the lift does not take it through a neighbour at an angle of 7 degrees or more.
    void depart(const SurfacePoints& points, std::uint32_t wanted, Vec3Lanes& starts) const noexcept override {
        lift(points, wanted, starts);
    }
    [[nodiscard]] TextureFrame texture_frame(const Hit& hit) const noexcept override;
    [[nodiscard]] std::span<const BoxNode> boxes() const override;
    [[nodiscard]] std::unique_ptr<const EmissiveSurface> emission(const Scene& scene) const override {
        return mesh_emission(scene, mesh_);
    }

private:
    MeshShape(const Scene& scene, const Mesh& mesh);
    [[nodiscard]] std::vector<BoxNode> make_boxes() const;
    Status build_hierarchy(RTCDevice device);
    /// Three corners, as the hierarchy holds them.
    [[nodiscard]] Triangle triangle(std::uint32_t face) const noexcept {
        const auto& f = mesh_.faces[face];
        return {vec_cast<double>(vertices_[f[0]]) + vertex_origin_,
                vec_cast<double>(vertices_[f[1]]) + vertex_origin_,
                vec_cast<double>(vertices_[f[2]]) + vertex_origin_};
    }

    std::uint32_t trace(const ShapeRays& rays, std::uint32_t wanted, ShapeHits& hits) const noexcept;
    [[nodiscard]] std::uint32_t trace_shadows(const ShapeRays& rays, std::uint32_t wanted) const noexcept;
    void lift(const SurfacePoints& points, std::uint32_t wanted, Vec3Lanes& starts) const noexcept;

    /// Embree's hit of one ray: which triangle, roughly where, from which side.
    struct EmbreeHit {
        std::uint32_t face = 0;
        float t = 0, u = 0, v = 0;
        bool hit = false, back = false;
    };
    /// Sixteen rays from where Embree takes over, and its hits.
    struct EmbreeBatch {
        RTCRayHit16 rays;
        alignas(64) Lanes<int> valid;  ///< -1: to be traced
        Vec3Lanes start;
        Lanes<double> skipped_m;          ///< from the ray's origin to `start`
        std::uint32_t traced = 0;         ///< as `valid`
        std::uint32_t hit = 0, back = 0;  ///< out

        void clear_hits() noexcept;
        void read_hits() noexcept;
        [[nodiscard]] EmbreeHit operator[](std::size_t i) const noexcept;
        void put(std::size_t i, const EmbreeHit& h) noexcept;
    };
    void advance(const ShapeRays& rays, std::uint32_t wanted, EmbreeBatch& batch) const noexcept;
    /// Traces again, slightly turned, rays whose hit is not plausible. `inside`: start on the inner side of this
    /// closed mesh.
    void retry(const ShapeRays& rays, std::uint32_t suspicious, std::uint32_t inside,
               EmbreeBatch& batch) const noexcept;
    /// Is the turned ray's hit the better one for the ray itself?
    [[nodiscard]] bool is_better(const EmbreeHit& turned, const EmbreeHit& than, const Vec3& start,
                                 const Vec3& direction, bool inside) const noexcept;

    struct VertexLanes;
    void fill_surface(const ShapeHits& found, const VertexLanes& vertex, HitBatch& hits) const noexcept;

    const Mesh& mesh_;
    std::vector<std::uint8_t> textured_;  ///< per material of the scene, where the mesh has texture coordinates
    embree::Owned<RTCScene> scene_;
    const Vec3f* vertices_ = nullptr;  ///< Embree's own copy, relative to vertex_origin_
    Vec3 vertex_origin_{};
    Vec3 centre_{};            ///< of the mesh's bounding box
    double radius_m_ = 0;      ///< about the centre
    bool closed_ = false;      ///< a ray that misses the mesh cannot have passed through it undetected
    bool off_centre_ = false;  ///< the sphere about the centre is clearly smaller than the one about the origin
    mutable std::once_flag boxes_made_;
    mutable std::vector<BoxNode> boxes_;
};

}  // namespace narpa
