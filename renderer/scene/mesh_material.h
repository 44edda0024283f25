/// renderer/scene/mesh_material.h - what the materials of mesh files become (docs/scene.md has the rules).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/mesh_file.h"

struct aiMaterial;
struct aiScene;

namespace narpa {

/// An MTL material; what the file leaves out is absent.
struct MtlMaterial {
    std::string name{};
    std::optional<Rgb> kd{}, ke{};
    Rgb ks{};
    float ns = 0;
    std::optional<float> d{}, tr{}, ni{}, pr{}, pm{};
    int illum = 2;
    MeshTexture map_kd{}, map_ke{}, norm{}, bump{};
    std::optional<float> bump_multiplier{};

    [[nodiscard]] bool transparent() const { return d ? *d < 1 : tr && *tr > 0; }
};
MeshMaterial from_mtl(const MtlMaterial& given);

/// A material that Assimp read from the file `path`. `warnings` gets what is passed over.
MeshMaterial from_assimp(const aiScene& scene, const aiMaterial& m, const std::string& path,
                         std::vector<std::string>& warnings);

/// Lambert, or Phong where ks > 0; every band clamped to [0, 1] and both scaled so that kd + ks <= 1.
Material diffuse_and_lobe(std::string name, Rgb kd, Rgb ks, float exponent, const Rgb& emission);
/// Every number made what scene.h allows.
Material metallic_roughness(std::string name, const Rgb& base_colour, float metallic, float roughness, float ior,
                            const Rgb& emission);
Material smooth_glass(std::string name, float ior, const Rgb& emission);

}  // namespace narpa
