/// renderer/mesh_reader/gltf_material.h - materials of glTF: metallic-roughness, and the extensions for specular
/// and glossiness, transmission, index of refraction and emissive strength.
#pragma once

#include <array>
#include <cstdint>

#include "renderer/assets/meshes/mesh_message.h"
#include "renderer/mesh_reader/gltf_file.h"

namespace narpa {

/// Which texture coordinates a material uses, and how they are transformed (KHR_texture_transform). narpa has one
/// set: textures of a material that use another are left out, with a warning.
struct GltfUvUse {
    std::int64_t set = 0;  ///< of TEXCOORD_n
    std::array<double, 2> offset{0, 0}, scale{1, 1};
    double rotation_rad = 0;  ///< counter-clockwise on the image, whose v points down

    /// Texture coordinates of narpa, whose v points up.
    [[nodiscard]] std::array<float, 2> apply(double u, double v) const;
    friend bool operator==(const GltfUvUse&, const GltfUvUse&) = default;
};

struct GltfMaterial {
    PlainMaterial plain;
    GltfUvUse uv_use{};
};

/// Material `index`; -1: the standard's default, for primitives without one.
[[nodiscard]] GltfMaterial gltf_material(GltfFile& file, std::int64_t index);

}  // namespace narpa
