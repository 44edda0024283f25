#include <assimp/GltfMaterial.h>
#include <assimp/material.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>

#include "renderer/mesh_reader/assimp_reader.h"

namespace narpa {

namespace {

Rgb colour(const aiMaterial& m, const char* key, unsigned type, unsigned index, const Rgb& otherwise) {
    aiColor3D c;
    return m.Get(key, type, index, c) == AI_SUCCESS ? Rgb{c.r, c.g, c.b} : otherwise;
}

float number(const aiMaterial& m, const char* key, unsigned type, unsigned index, float otherwise) {
    float x = otherwise;
    m.Get(key, type, index, x);
    return x;
}

/// The material of a 3DS, PLY, DAE or STL file.
PlainMaterial::Numbers classic_material(const aiMaterial& m) {
    return {.diffuse = colour(m, AI_MATKEY_COLOR_DIFFUSE, {0.5f, 0.5f, 0.5f}),
            .specular = colour(m, AI_MATKEY_COLOR_SPECULAR, {}),
            .emission = colour(m, AI_MATKEY_COLOR_EMISSIVE, {}),
            .exponent = number(m, AI_MATKEY_SHININESS, 0)};
}

/// glTF 2.0's metallic-roughness, KHR_materials_transmission and KHR_materials_ior.
PlainMaterial::Numbers gltf_material(const aiMaterial& m) {
    constexpr float kGlass = 0.5f;  // of the light that goes through
    using Kind = PlainMaterial::Kind;
    const bool is_glass = number(m, AI_MATKEY_TRANSMISSION_FACTOR, 0) >= kGlass;
    return {.kind = is_glass ? Kind::glass : Kind::metallic_roughness,
            .diffuse = colour(m, AI_MATKEY_BASE_COLOR, {1, 1, 1}),
            .emission = colour(m, AI_MATKEY_COLOR_EMISSIVE, {}),
            .metallic = number(m, AI_MATKEY_METALLIC_FACTOR, 1),
            .roughness = number(m, AI_MATKEY_ROUGHNESS_FACTOR, 1),
            .ior = number(m, AI_MATKEY_REFRACTI, 1.5f)};
}

/// Reads the images that a material names, and warns about what is not supported.
class TextureFinder {
public:
    TextureFinder(const aiScene& scene, const aiMaterial& m, const std::string& path,
                  std::vector<std::string>& warnings)
        : scene_(scene), m_(m), path_(path), warnings_(warnings) {}

    /// The image of this kind, as a file or as the bytes that the mesh file holds; empty where there is none.
    [[nodiscard]] MeshTexture find(aiTextureType type) {
        MeshTexture out;
        aiString name;
        unsigned channel = 0;
        aiTextureMapMode modes[3] = {aiTextureMapMode_Wrap, aiTextureMapMode_Wrap, aiTextureMapMode_Wrap};
        if (m_.GetTexture(type, 0, &name, nullptr, &channel, nullptr, nullptr, modes) != AI_SUCCESS) return out;
        if (channel != 0) {
            warn("a texture that lies by the second texture coordinates is not used");
            return out;
        }
        aiUVTransform transform;
        if (m_.Get(AI_MATKEY_UVTRANSFORM(type, 0), transform) == AI_SUCCESS)
            warn("shifts, turns and scales of textures (KHR_texture_transform) are not used");
        if (modes[0] == aiTextureMapMode_Clamp && modes[1] == aiTextureMapMode_Clamp)
            out.wrap = Texture::Wrap::clamp;
        else if (modes[0] != aiTextureMapMode_Wrap || modes[1] != aiTextureMapMode_Wrap)
            warn("textures that are mirrored, or clamped along one axis only, repeat");
        if (const aiTexture* inside = scene_.GetEmbeddedTexture(name.C_Str())) {
            const auto* bytes = reinterpret_cast<const std::uint8_t*>(inside->pcData);
            if (inside->mHeight == 0)
                out.file = path_ + name.C_Str(), out.bytes.assign(bytes, bytes + inside->mWidth);
            else
                warn("textures that the file holds as bare pixels are not used");
        } else {
            out.file = texture_path(path_, name.C_Str());
        }
        return out;
    }

    [[nodiscard]] bool has(aiTextureType type) const { return m_.GetTextureCount(type) > 0; }

    /// Once a file, however many materials it applies to.
    void warn(std::string_view what) {
        std::string text = fmt::format("{}: {}", path_, what);
        if (std::find(warnings_.begin(), warnings_.end(), text) == warnings_.end())
            warnings_.push_back(std::move(text));
    }

private:
    const aiScene& scene_;
    const aiMaterial& m_;
    const std::string& path_;
    std::vector<std::string>& warnings_;
};

bool is_gltf(const std::string& path) {
    const std::string extension = extension_of(path);
    return extension == ".gltf" || extension == ".glb";
}

}  // namespace

PlainMaterial from_assimp(const aiScene& scene, const aiMaterial& m, const std::string& path,
                          std::vector<std::string>& warnings) {
    const bool gltf = is_gltf(path);
    TextureFinder textures(scene, m, path, warnings);
    PlainMaterial out{.numbers = gltf ? gltf_material(m) : classic_material(m), .name = m.GetName().C_Str()};
    out.colour = textures.find(aiTextureType_BASE_COLOR);
    if (!out.colour.named()) out.colour = textures.find(aiTextureType_DIFFUSE);
    out.emission = textures.find(aiTextureType_EMISSIVE);
    out.normal = textures.find(aiTextureType_NORMALS);
    out.numbers.normal_scale = number(m, AI_MATKEY_GLTF_TEXTURE_SCALE(aiTextureType_NORMALS, 0), 1);
    const bool opaque = out.numbers.kind != PlainMaterial::Kind::glass;
    if (opaque && (number(m, AI_MATKEY_OPACITY, 1) < 1 || number(m, AI_MATKEY_TRANSMISSION_FACTOR, 0) > 0))
        textures.warn("transparent materials are drawn opaque");
    if (gltf && textures.has(aiTextureType_UNKNOWN))
        textures.warn("metallic-roughness textures are not used, their factors are");
    return out;
}

}  // namespace narpa
