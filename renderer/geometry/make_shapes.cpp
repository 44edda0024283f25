// Makes the shapes of a scene's bodies.
#include <tbb/task_arena.h>

#include "renderer/geometry/mesh_shape.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/geometry/tracer_impl.h"

namespace narpa {
namespace {

using ShapePointer = std::shared_ptr<const Shape>;

Result<ShapePointer> shape_of(const Scene& scene, const std::vector<ShapePointer>& meshes, const Body& body) {
    const auto bad = [&](const std::string& what) { return Error{"body \"" + body.name + "\"" + what}; };
    if (const int* const mesh = std::get_if<int>(&body.shape)) {
        if (*mesh < 0 || static_cast<std::size_t>(*mesh) >= meshes.size())
            return bad(" names mesh " + std::to_string(*mesh) + " of " + std::to_string(meshes.size()));
        return meshes[static_cast<std::size_t>(*mesh)];
    }
    const auto& [kind, values, material] = std::get<ExactShape>(body.shape);
    const auto index = static_cast<std::size_t>(material);
    const bool has_material = material >= 0 && index < scene.materials.size();
    std::optional<MapLatitude> maps;
    if (has_material && is_textured(scene.materials[index])) maps = scene.materials[index].map_latitude;
    ShapePointer shape = kind->make(values, material, maps);
    if (!shape) return bad(": " + std::string(kind->expected));
    if (!has_material)
        return bad(" names material " + std::to_string(material) + " of " + std::to_string(scene.materials.size()));
    return shape;
}

}  // namespace

Result<Shapes> make_shapes(const Scene& scene, RTCDevice device, int threads) {
    // Embree's own "threads" setting would limit TBB for the whole process; an arena limits the builds alone.
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    std::vector<ShapePointer> meshes;
    for (const Mesh& m : scene.meshes) {
        auto mesh = arena.execute([&] { return MeshShape::build(device, scene, m); });
        if (!mesh) return mesh.error();
        meshes.push_back(*std::move(mesh));
    }
    Shapes shapes;
    for (const Body& body : scene.bodies) {
        auto shape = shape_of(scene, meshes, body);
        if (!shape) return shape.error();
        shapes.push_back(*std::move(shape));
    }
    return shapes;
}

}  // namespace narpa
