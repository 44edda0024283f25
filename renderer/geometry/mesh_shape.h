/// renderer/geometry/mesh_shape.h - triangle meshes: Embree finds hits in single precision, which are solved again
/// in double.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "base/result.h"
#include "renderer/geometry/embree.h"
#include "renderer/geometry/shape.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// A tree of boxes, root first, every node before its children; empty for a mesh without faces. The union of the
/// leaves covers each triangle, to rounding in single precision. Large triangles are split first, as the box of a
/// whole oblique panel would be mostly empty. Boxes are split one at a time, the one with the largest surface
/// first, at the plane of least cost by the surface area heuristic (J. Goldsmith, J. Salmon, "Automatic creation of
/// object hierarchies for ray tracing", IEEE CG&A 7(5), 1987), so that the leaves have similar sizes.
[[nodiscard]] std::vector<BoxNode> box_tree(const Mesh& mesh);

/// Whether every edge occurs equally often in both directions, with vertices identified by position alone: then a
/// ray from outside hits an outer side first. A closed mesh may have several shells.
[[nodiscard]] bool is_closed(const Mesh& mesh);

/// The emissive faces; null if there are none. `material`: of all faces, in place of their own. Scene and mesh must
/// outlive it.
[[nodiscard]] std::unique_ptr<const EmissiveSurface> mesh_emission(const Scene& scene, const Mesh& mesh,
                                                                   std::optional<int> material);

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
    /// The same where all faces have this material of the scene.
    void surface_of(int material, const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept;
    /// Starts are offset along the normal by the bound of their rounding error in single precision, and kept so far
    /// from the face's edges that the offset does not cross a neighbouring face that meets it at 7 degrees or more.
    void depart(const SurfacePoints& points, std::uint32_t wanted, Vec3Lanes& starts) const noexcept override {
        lift(points, wanted, starts);
    }
    [[nodiscard]] TextureFrame texture_frame(const Hit& hit) const noexcept override;
    [[nodiscard]] Rgb vertex_colour(std::uint32_t face, const Vec3& position_body) const noexcept override;
    [[nodiscard]] std::span<const BoxNode> boxes() const override;
    [[nodiscard]] std::unique_ptr<const EmissiveSurface> emission(const Scene& scene) const override {
        return mesh_emission(scene, mesh_, std::nullopt);
    }
    [[nodiscard]] const Mesh& mesh() const noexcept { return mesh_; }

private:
    MeshShape(const Scene& scene, const Mesh& mesh);
    [[nodiscard]] std::vector<BoxNode> make_boxes() const;
    Status build_hierarchy(RTCDevice device);
    /// Corners of a face, as stored in Embree's hierarchy.
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
    /// Sixteen rays, advanced to where Embree starts, and Embree's hits.
    struct EmbreeBatch {
        RTCRayHit16 rays;
        alignas(64) Lanes<int> valid;  ///< -1: to be traced
        Vec3Lanes start;
        Lanes<double> skipped_m;          ///< from the ray's origin to `start`
        std::uint32_t traced = 0;         ///< bits of `valid`
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
    /// Whether the hit of the turned ray replaces that of the original one.
    [[nodiscard]] bool is_better(const EmbreeHit& turned, const EmbreeHit& than, const Vec3& start,
                                 const Vec3& direction, bool inside) const noexcept;

    struct VertexLanes;
    void finish_surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept;
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

/// A mesh, shared with other bodies, in one material: without the mesh's own materials and colours.
class MeshInMaterial final : public Shape {
public:
    /// `material`: index into Scene::materials.
    MeshInMaterial(std::shared_ptr<const MeshShape> shape, int material)
        : shape_(std::move(shape)), material_(material) {
        properties_ = shape_->properties();
    }

    std::uint32_t intersect(const ShapeRays& rays, std::uint32_t wanted, ShapeHits& hits) const noexcept override {
        return shape_->intersect(rays, wanted, hits);
    }
    [[nodiscard]] std::uint32_t occluded(const ShapeRays& rays, std::uint32_t wanted) const noexcept override {
        return shape_->occluded(rays, wanted);
    }
    void surface(const ShapeHits& found, std::uint32_t wanted, HitBatch& hits) const noexcept override {
        shape_->surface_of(material_, found, wanted, hits);
    }
    void depart(const SurfacePoints& points, std::uint32_t wanted, Vec3Lanes& starts) const noexcept override {
        shape_->depart(points, wanted, starts);
    }
    [[nodiscard]] TextureFrame texture_frame(const Hit& hit) const noexcept override {
        return shape_->texture_frame(hit);
    }
    [[nodiscard]] std::span<const BoxNode> boxes() const override { return shape_->boxes(); }
    [[nodiscard]] std::unique_ptr<const EmissiveSurface> emission(const Scene& scene) const override {
        return mesh_emission(scene, shape_->mesh(), material_);
    }

private:
    std::shared_ptr<const MeshShape> shape_;
    int material_;
};

}  // namespace narpa
