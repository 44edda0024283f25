// Makes the shapes of a scene's bodies.
#include <tbb/task_arena.h>

#include <map>
#include <utility>

#include "renderer/geometry/mesh_shape.h"
#include "renderer/geometry/shape_kind.h"
#include "renderer/geometry/tracer_impl.h"

namespace narpa {
namespace {

using ShapePointer = std::shared_ptr<const Shape>;

using MeshPointer = std::shared_ptr<const MeshShape>;

struct MeshShapes {
    std::vector<MeshPointer> meshes;  ///< of the scene's meshes
    std::map<std::pair<int, int>, ShapePointer> in_material;
};

Result<ShapePointer> shape_of(const Scene& scene, MeshShapes& shapes, const Body& body) {
    const auto bad = [&](const std::string& what) { return Error{"body \"" + body.name + "\"" + what}; };
    const auto has_material = [&](int m) { return m >= 0 && static_cast<std::size_t>(m) < scene.materials.size(); };
    const auto no_material = [&](int m) {
        return bad(" names material " + std::to_string(m) + " of " + std::to_string(scene.materials.size()));
    };
    if (const int* const mesh = std::get_if<int>(&body.shape)) {
        if (*mesh < 0 || static_cast<std::size_t>(*mesh) >= shapes.meshes.size())
            return bad(" names mesh " + std::to_string(*mesh) + " of " + std::to_string(shapes.meshes.size()));
        const MeshPointer& shape = shapes.meshes[static_cast<std::size_t>(*mesh)];
        if (!body.mesh_material) return ShapePointer(shape);
        if (!has_material(*body.mesh_material)) return no_material(*body.mesh_material);
        ShapePointer& made = shapes.in_material[{*mesh, *body.mesh_material}];
        if (!made) made = std::make_shared<const MeshInMaterial>(shape, *body.mesh_material);
        return made;
    }
    const auto& [kind, values, material] = std::get<ExactShape>(body.shape);
    std::optional<MapLatitude> maps;
    if (has_material(material)) {
        const Material& m = scene.materials[static_cast<std::size_t>(material)];
        if (is_textured(m)) maps = m.map_latitude;
    }
    ShapePointer shape = kind->make(values, material, maps);
    if (!shape) return bad(": " + std::string(kind->expected));
    if (!has_material(material)) return no_material(material);
    return shape;
}

}  // namespace

Result<Shapes> make_shapes(const Scene& scene, RTCDevice device, int threads) {
    // Embree's own "threads" setting would limit TBB for the whole process; an arena limits the builds alone.
    tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
    MeshShapes of_meshes;
    for (const Mesh& m : scene.meshes) {
        auto mesh = arena.execute([&] { return MeshShape::build(device, scene, m); });
        if (!mesh) return mesh.error();
        of_meshes.meshes.push_back(*std::move(mesh));
    }
    Shapes shapes;
    for (const Body& body : scene.bodies) {
        auto shape = shape_of(scene, of_meshes, body);
        if (!shape) return shape.error();
        shapes.push_back(*std::move(shape));
    }
    return shapes;
}

}  // namespace narpa
