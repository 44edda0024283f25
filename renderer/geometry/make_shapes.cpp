// Makes the shapes of a scene's bodies.
#include <tbb/task_arena.h>

#include "renderer/geometry/ellipsoid.h"
#include "renderer/geometry/mesh_shape.h"
#include "renderer/geometry/tracer_impl.h"

namespace narpa {
namespace {

using ShapePointer = std::shared_ptr<const Shape>;

/// Visitor of Body::shape that makes the shape of each kind.
class ShapeOf {
public:
    ShapeOf(const Scene& scene, const std::vector<ShapePointer>& meshes, const Body& body)
        : scene_(scene), meshes_(meshes), body_(body) {}

    Result<ShapePointer> operator()(int mesh) const {
        if (mesh < 0 || static_cast<std::size_t>(mesh) >= meshes_.size())
            return bad(" names mesh " + std::to_string(mesh) + " of " + std::to_string(meshes_.size()));
        return meshes_[static_cast<std::size_t>(mesh)];
    }
    Result<ShapePointer> operator()(const Sphere& s) const {
        if (!(s.radius_m > 0) || !std::isfinite(s.radius_m))
            return bad(": the radius of a sphere is a positive length in metres");
        return ellipsoid({s.radius_m, s.radius_m, s.radius_m}, s.material);
    }
    Result<ShapePointer> operator()(const Ellipsoid& e) const {
        for (int k = 0; k < 3; ++k)
            if (!(e.semi_axes_m[k] > 0) || !std::isfinite(e.semi_axes_m[k]))
                return bad(": the semi-axes of an ellipsoid are three positive lengths in metres");
        return ellipsoid(e.semi_axes_m, e.material);
    }

private:
    [[nodiscard]] Error bad(const std::string& what) const { return {"body \"" + body_.name + "\"" + what}; }
    [[nodiscard]] Result<ShapePointer> ellipsoid(const Vec3& semi_axes_m, int material) const {
        if (material < 0 || static_cast<std::size_t>(material) >= scene_.materials.size())
            return bad(" names material " + std::to_string(material) + " of " +
                       std::to_string(scene_.materials.size()));
        return ShapePointer(std::make_shared<EllipsoidShape>(
            semi_axes_m, material, is_textured(scene_.materials[static_cast<std::size_t>(material)])));
    }

    const Scene& scene_;
    const std::vector<ShapePointer>& meshes_;
    const Body& body_;
};

}  // namespace

Result<Shapes> make_shapes(const Scene& scene, const Shapes& given, RTCDevice device, int threads) {
    // Embree's own "threads" setting would limit TBB for the whole process; an arena limits the builds alone.
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    std::vector<ShapePointer> meshes;
    for (const Mesh& m : scene.meshes) {
        auto mesh = arena.execute([&] { return MeshShape::build(device, scene, m); });
        if (!mesh) return mesh.error();
        meshes.push_back(*std::move(mesh));
    }
    Shapes shapes;
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
        if (i < given.size() && given[i] != nullptr) {
            shapes.push_back(given[i]);
            continue;
        }
        auto shape = std::visit(ShapeOf(scene, meshes, scene.bodies[i]), scene.bodies[i].shape);
        if (!shape) return shape.error();
        shapes.push_back(*std::move(shape));
    }
    return shapes;
}

}  // namespace narpa
