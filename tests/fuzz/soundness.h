/// tests/fuzz/soundness.h - what holds of every mesh, material and error that a reader lets through.
#pragma once

#include <algorithm>
#include <cmath>

#include "renderer/assets/meshes/mesh_file.h"
#include "tests/fuzz/fuzz.h"

namespace narpa::fuzz {

inline void check(const Error& e) {
    require(e.kind == ErrorKind::bad_input && !e.file.empty() && !e.what.empty(), "an error names its file");
}

inline void check(const Mesh& m, std::size_t materials) {
    require(!m.faces.empty() && m.face_material.size() == m.faces.size(), "each face has a material");
    require(m.normals.empty() || m.normals.size() == m.positions.size(), "each vertex has a normal, or none");
    require(m.uvs.empty() || m.uvs.size() == m.positions.size(), "each vertex has coordinates, or none");
    for (const auto& face : m.faces)
        for (const std::uint32_t corner : face) require(corner < m.positions.size(), "corners are in range");
    for (const std::uint16_t material : m.face_material) require(material < materials, "materials are in range");
    for (const Vec3f& p : m.positions) require(is_finite(p), "positions are finite");
    for (const Vec3f& n : m.normals) require(std::abs(norm(n) - 1) < 1e-5f, "normals are unit");
}

inline void check(const Material& m, int textures) {
    for (const int t :
         {m.texture, m.emission_texture, m.specular_texture, m.cloud_texture, m.normal_texture, m.height_texture})
        require(t < textures, "textures are in range");
    const bool adds_up = m.kind == &kinds::phong;
    for (int b = 0; b < 3; ++b) {
        require(m.diffuse[b] >= 0 && m.specular[b] >= 0 && m.emission[b] >= 0 && m.ambient[b] >= 0,
                "no colour below 0");
        require((adds_up ? m.diffuse[b] + m.specular[b] : std::max(m.diffuse[b], m.specular[b])) <= 1 + 1e-6f,
                "energy is conserved");
    }
    require(m.roughness >= 0 && m.roughness <= 1 && m.metallic >= 0 && m.metallic <= 1, "roughness and metallic");
    require(m.ior >= 0.1f && m.ior <= 10 && std::abs(m.asymmetry) < 1 && m.exponent >= 0, "ior, g and exponent");
    require(std::isfinite(m.normal_scale) && std::isfinite(m.bump_height_m), "scales are finite");
}

inline void check(const Result<MeshFile>& mesh) {
    if (!count(bool(mesh))) return check(mesh.error());
    check(mesh->mesh, mesh->materials.size());
    for (const MeshMaterial& m : mesh->materials) check(m.material, 0);
}

}  // namespace narpa::fuzz
