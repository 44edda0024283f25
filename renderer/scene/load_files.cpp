#include <fmt/format.h>

#include <limits>
#include <map>
#include <utility>

#include "renderer/scene/mesh_file.h"
#include "renderer/scene/scene_parts.h"
#include "renderer/scene/texture_file.h"

namespace narpa {

namespace {

std::string canonical(const std::string& path) {
    std::error_code problem;
    const auto full = std::filesystem::weakly_canonical(path, problem);
    return problem ? path : full.string();
}

/// Opens each file once, however many bodies and materials name it.
class Loader {
public:
    explicit Loader(SceneReading& reading) : r_(reading) {}

    void load_mesh(const NamedMesh& named) {
        const auto key = std::pair(canonical(named.path), named.scale);
        auto known = meshes_.find(key);
        if (known == meshes_.end()) {
            Result<MeshFile> file = read_mesh(named.path, named.scale);
            if (!file) return blame(named, file.error());
            r_.scene.warnings.insert(r_.scene.warnings.end(), file->warnings.begin(), file->warnings.end());
            known = meshes_.emplace(key, std::move(*file)).first;
        }
        r_.scene.bodies[named.body].shape = named.material ? add_mesh(known->second.mesh, *named.material)
                                                           : mesh_with_own_materials(key, known->second);
    }

    void load_texture(const NamedTexture& named) {
        const Result<int> texture = texture_index(named.path, {});
        if (!texture) return r_.problems.add(named.place, "texture: " + texture.error().text());
        r_.scene.materials[static_cast<std::size_t>(named.material)].texture = *texture;
    }

private:
    using MeshKey = std::pair<std::string, double>;

    /// A line of the mesh file, where it is known, else the scene's.
    void blame(const NamedMesh& named, Error error) {
        if (error.line == 0) return r_.problems.add(named.place, "mesh: " + error.text());
        error.what += fmt::format(" (mesh of body \"{}\", {}:{})", r_.scene.bodies[named.body].name,
                                  r_.problems.file(), named.place.begin.line);
        r_.problems.add(named.place, std::move(error));
    }

    int add_mesh(Mesh mesh, int material) {
        mesh.face_material.assign(mesh.faces.size(), static_cast<std::uint16_t>(material));
        r_.scene.meshes.push_back(std::move(mesh));
        return static_cast<int>(r_.scene.meshes.size()) - 1;
    }

    int mesh_with_own_materials(const MeshKey& key, const MeshFile& file) {
        const auto known = plain_.find(key);
        if (known != plain_.end()) return known->second;
        Mesh mesh = file.mesh;
        std::map<std::uint16_t, std::uint16_t> scene_material;  // only those that some face has
        for (std::uint16_t& m : mesh.face_material) {
            auto [it, is_new] = scene_material.try_emplace(m);
            if (is_new) it->second = add_material(file.materials[m]);
            m = it->second;
        }
        r_.scene.meshes.push_back(std::move(mesh));
        return plain_[key] = static_cast<int>(r_.scene.meshes.size()) - 1;
    }

    std::uint16_t add_material(const MeshMaterial& given) {
        Material material = given.material;
        if (!given.texture_file.empty()) {
            const Result<int> texture = texture_index(given.texture_file, given.texture_bytes);
            if (texture) {
                material.texture = *texture;
            } else {
                material.diffuse *= 0.5f;
                warn(texture.error().text() + "; grey 0.5 is used in place of this texture");
            }
        }
        r_.scene.materials.push_back(std::move(material));
        return static_cast<std::uint16_t>(r_.scene.materials.size() - 1);
    }

    /// `bytes`: the image itself, where a mesh file holds it; else the file is read.
    Result<int> texture_index(const std::string& path, const std::vector<std::uint8_t>& bytes) {
        const std::string key = canonical(path);
        if (const auto known = textures_.find(key); known != textures_.end()) return known->second;
        Result<Texture> texture = bytes.empty() ? read_texture(path) : decode_texture(path, bytes);
        if (!texture) return texture.error();
        r_.scene.textures.push_back(std::move(*texture));
        return textures_[key] = static_cast<int>(r_.scene.textures.size()) - 1;
    }

    void warn(std::string text) {
        auto& all = r_.scene.warnings;
        if (std::find(all.begin(), all.end(), text) == all.end()) all.push_back(std::move(text));
    }

    SceneReading& r_;
    std::map<MeshKey, MeshFile> meshes_;
    std::map<MeshKey, int> plain_;  ///< with the materials of the file
    std::map<std::string, int> textures_;
};

/// A texture laid over a mesh that has no texture coordinates would show one texel.
void check_coordinates(const NamedTexture& named, SceneReading& r) {
    for (const NamedMesh& mesh : r.meshes) {
        if (mesh.material != named.material) continue;
        const auto index = static_cast<std::size_t>(std::get<int>(r.scene.bodies[mesh.body].shape));
        if (r.scene.meshes[index].uvs.empty())
            r.problems.add(named.place, fmt::format("texture: {} has no texture coordinates", mesh.path));
    }
}

}  // namespace

void load_named_files(SceneReading& reading) {
    Loader loader(reading);
    for (const NamedMesh& mesh : reading.meshes) loader.load_mesh(mesh);
    for (const NamedTexture& texture : reading.textures) loader.load_texture(texture);
    if (!reading.problems.none()) return;
    for (const NamedTexture& texture : reading.textures) check_coordinates(texture, reading);
    if (reading.scene.materials.size() > std::numeric_limits<std::uint16_t>::max())
        reading.problems.add(toml::source_region{}, "more than 65535 materials");
}

}  // namespace narpa
