/// renderer/mesh_reader/gltf_nodes.h - the nodes of a glTF document: where their meshes are.
#pragma once

#include <cstdint>
#include <vector>

#include "base/vec3.h"
#include "renderer/mesh_reader/gltf_file.h"

namespace narpa {

/// An affine map: columns of its matrix, and the translation.
struct Affine {
    Vec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1}, t{};

    [[nodiscard]] Vec3 turn(const Vec3& v) const { return v.x * x + v.y * y + v.z * z; }
    [[nodiscard]] Vec3 operator*(const Vec3& p) const { return turn(p) + t; }
    [[nodiscard]] Affine operator*(const Affine& b) const { return {turn(b.x), turn(b.y), turn(b.z), *this * b.t}; }
    [[nodiscard]] double determinant() const { return dot(x, cross(y, z)); }
    /// Turns normals: the inverse transpose, but for a positive factor.
    [[nodiscard]] Affine normal_map() const {
        const double side = determinant() < 0 ? -1 : 1;
        return {side * cross(y, z), side * cross(z, x), side * cross(x, y), {}};
    }
    Affine& operator+=(const Affine& b) { return x += b.x, y += b.y, z += b.z, t += b.t, *this; }
    friend Affine operator*(double s, const Affine& a) { return {s * a.x, s * a.y, s * a.z, s * a.t}; }
};

/// From translation, rotation (x, y, z, w) and scale.
[[nodiscard]] Affine affine_of(const Vec3& translation, const double* xyzw, const Vec3& scale);
/// From the sixteen elements of a matrix, column by column.
[[nodiscard]] Affine affine_of_matrix(const double* m);

class GltfNodes {
public:
    /// Throws where a node has two parents, or is among its own ancestors.
    explicit GltfNodes(GltfFile& file);

    /// Of every node: from its frame to the file's.
    [[nodiscard]] const Affine& world(std::int64_t node) const { return world_.at(static_cast<std::size_t>(node)); }
    /// Those of the scene that the file shows first.
    [[nodiscard]] const std::vector<std::int64_t>& shown() const { return shown_; }
    [[nodiscard]] static std::vector<std::int64_t> indices(const nlohmann::json& object, const char* name);

private:
    void place(GltfFile& file, std::int64_t node, const std::vector<std::vector<std::int64_t>>& children);
    void show_scene(GltfFile& file, const std::vector<std::vector<std::int64_t>>& children,
                    const std::vector<std::int64_t>& roots);

    std::vector<Affine> world_;
    std::vector<std::int64_t> shown_;
};

}  // namespace narpa
