#include <assimp/material.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>

#include "renderer/mesh_reader/mesh_reader.h"

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

/// The names that Assimp gives to the materials of parts without one.
bool is_made_up(const aiMaterial& m) {
    const std::string name = m.GetName().C_Str();
    return name == AI_DEFAULT_MATERIAL_NAME || name == "%%%DEFAULT";
}

PlainMaterial::Numbers numbers_of(const aiMaterial& m) {
    return {.diffuse = colour(m, AI_MATKEY_COLOR_DIFFUSE, {0.5f, 0.5f, 0.5f}),
            .specular = colour(m, AI_MATKEY_COLOR_SPECULAR, {}),
            .emission = colour(m, AI_MATKEY_COLOR_EMISSIVE, {}),
            .exponent = number(m, AI_MATKEY_SHININESS, 0)};
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
            warn("shifts, turns and scales of textures are not used");
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

}  // namespace

PlainMaterial from_assimp(const aiScene& scene, const aiMaterial& m, const std::string& path,
                          std::vector<std::string>& warnings) {
    if (is_made_up(m)) return grey_material();
    TextureFinder textures(scene, m, path, warnings);
    PlainMaterial out{.numbers = numbers_of(m), .name = m.GetName().C_Str()};
    out.colour = textures.find(aiTextureType_DIFFUSE);
    out.emission = textures.find(aiTextureType_EMISSIVE);
    out.normal = textures.find(aiTextureType_NORMALS);
    if (number(m, AI_MATKEY_OPACITY, 1) < 1) textures.warn("transparent materials are drawn opaque");
    return out;
}

}  // namespace narpa
