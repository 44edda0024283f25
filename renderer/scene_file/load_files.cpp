#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "renderer/assets/images/texture_file.h"
#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

std::string canonical(const std::string& path) {
    std::error_code problem;
    const auto full = std::filesystem::weakly_canonical(path, problem);
    return problem ? path : full.string();
}

/// A mesh that a scene of a clone names and that narpa's build makes: where it is. Empty: it is none.
std::string made_at_build(const std::string& missing) {
    namespace fs = std::filesystem;
    std::error_code problem;
    const fs::path shipped = shipped_folder(), path = fs::path(canonical(missing));
    if (shipped.empty() || fs::exists(path, problem)) return {};
    fs::path tail;
    for (auto part = path.end(); part != path.begin() && *std::prev(part) != "scenes";)
        tail = tail.empty() ? *--part : *--part / tail;
    const fs::path made = shipped / tail;
    if (!fs::is_regular_file(made, problem)) return {};
    return fmt::format(": it is made when narpa is built; expected the scene in {}, which `narpa list` names",
                       shipped.string());
}

/// Opens each file once, however many bodies and materials name it.
class Loader {
public:
    explicit Loader(SceneReading& reading) : r_(reading) {}

    void load_mesh(const NamedMesh& named) {
        const MeshKey key(canonical(named.path), named.scale, named.crease_rad);
        auto known = meshes_.find(key);
        if (known == meshes_.end()) {
            Result<MeshFile> file = read_mesh(named.path, named.scale, named.crease_rad);
            if (!file) return blame(named, file.error());
            r_.scene.warnings.insert(r_.scene.warnings.end(), file->warnings.begin(), file->warnings.end());
            known = meshes_.emplace(key, add_mesh(*std::move(file))).first;
        }
        LoadedMesh& mesh = known->second;
        Body& body = r_.scene.bodies[named.body];
        body.shape = mesh.index;
        body.mesh_material = named.material;
        if (!named.material) use_own_materials(mesh, named.scale);
    }

    void load_texture(const NamedTexture& named) {
        const Result<int> texture = texture_index({.file = named.path}, named.use);
        if (!texture) return r_.problems.add(named.place, named.key + ": " + texture.error().text());
        r_.scene.materials[static_cast<std::size_t>(named.material)].*named.slot = *texture;
    }

private:
    using Colour = TextureUse::Colour;
    using MeshKey = std::tuple<std::string, double, double>;
    /// A mesh of the scene, and what only bodies without a material of their own need; empty once it is used.
    struct LoadedMesh {
        int index = 0;
        std::vector<std::uint16_t> face_material{};  ///< index into `materials`
        std::vector<Rgb> colours{};
        std::vector<MeshMaterial> materials{};
    };
    using TextureKey = std::tuple<std::string, Colour, Texture::Wrap>;

    static TextureKey texture_key(const MeshTexture& texture, const TextureUse& use) {
        return {canonical(texture.file), use.colour, use.wrap};
    }

    /// Reports an error at its line of the mesh file, if known, else at the scene's line.
    void blame(const NamedMesh& named, Error error) {
        error.what += made_at_build(named.path);
        if (error.line == 0) return r_.problems.add(named.place, "mesh: " + error.text());
        error.what += fmt::format(" (mesh of body \"{}\", {}:{})", r_.scene.bodies[named.body].name,
                                  r_.problems.file(), named.place.line);
        r_.problems.add(named.place, std::move(error));
    }

    LoadedMesh add_mesh(MeshFile file) {
        LoadedMesh loaded{static_cast<int>(r_.scene.meshes.size()), std::move(file.mesh.face_material),
                          std::move(file.mesh.colours), std::move(file.materials)};
        file.mesh.face_material.assign(file.mesh.faces.size(), 0);
        file.mesh.colours = {};
        r_.scene.meshes.push_back(std::move(file.mesh));
        return loaded;
    }

    /// Adds the materials of a mesh file to the scene when the first body wants them.
    void use_own_materials(LoadedMesh& loaded, double scale) {
        if (loaded.face_material.empty()) return;
        std::map<std::uint16_t, std::uint16_t> scene_material;  // of materials that some face has
        for (std::uint16_t& m : loaded.face_material) {
            auto [it, is_new] = scene_material.try_emplace(m);
            if (is_new) it->second = add_material(loaded.materials[m], scale);
            m = it->second;
        }
        Mesh& mesh = r_.scene.meshes[static_cast<std::size_t>(loaded.index)];
        mesh.face_material = std::exchange(loaded.face_material, {});
        mesh.colours = std::exchange(loaded.colours, {});
    }

    /// `scale`: metres per unit of the mesh file.
    std::uint16_t add_material(const MeshMaterial& given, double scale) {
        Material m = given.material;
        if (given.colour.named()) {
            m.texture =
                index_or_warn(given.colour, Colour::by_depth, "; grey 0.5 is used in place of this texture");
            if (m.texture < 0) m.diffuse *= 0.5f;
        }
        if (given.emission.named()) {
            m.emission_texture = index_or_warn(given.emission, Colour::by_depth, "; without it nothing shines");
            if (m.emission_texture < 0) m.emission = {};
        }
        if (given.normal.named())
            m.normal_texture = index_or_warn(given.normal, Colour::normals, "; normals stay as they are");
        if (given.bump.named()) add_bump(given, scale, m);
        r_.scene.materials.push_back(std::move(m));
        return static_cast<std::uint16_t>(r_.scene.materials.size() - 1);
    }

    /// MTL has one keyword for normal maps and for heights: the image decides.
    void add_bump(const MeshMaterial& given, double scale, Material& m) {
        const Result<int> normals = normal_map_index(given.bump);
        if (!normals) {
            warn(normals.error().text() + "; normals stay as they are");
        } else if (*normals >= 0) {
            if (m.normal_texture >= 0) return;
            m.normal_texture = *normals;
            m.normal_scale = std::clamp(given.bump_multiplier.value_or(1.0f), 0.0f, 100.0f);
        } else if (!given.bump_multiplier) {
            warn(given.bump.file + ": heights without a -bm that says how high they are, not used");
        } else {
            m.height_texture = index_or_warn(given.bump, Colour::linear, "");
            m.bump_height_m = static_cast<float>(std::clamp(*given.bump_multiplier * scale, -1e6, 1e6));
        }
    }

    /// Index of the normal map; -1 if the image holds heights.
    Result<int> normal_map_index(const MeshTexture& bump) {
        const TextureUse use{.colour = Colour::normals, .wrap = bump.wrap};
        if (heights_.contains(canonical(bump.file))) return -1;
        if (const auto known = textures_.find(texture_key(bump, use)); known != textures_.end())
            return known->second;
        Result<Texture> texture = read(bump, use);
        if (!texture) return texture.error();
        if (is_normal_map(*texture)) return add_texture(bump, use, std::move(*texture));
        heights_.insert(canonical(bump.file));
        return -1;
    }

    /// A normal map is blue, as most of it points outward, and heights are grey: blue is on average 0.2 above red
    /// and green.
    static bool is_normal_map(const Texture& texture) {
        std::array<double, 3> sum{};
        for (std::size_t i = 0; i < texture.rgb.size(); ++i) sum[i % 3] += texture.rgb[i];
        const std::size_t texels = texture.rgb.size() / 3;
        const double white = 65535.0 * static_cast<double>(texels);
        return sum[2] - std::max(sum[0], sum[1]) > 0.2 * white;
    }

    /// Index of the texture; -1 if the image cannot be read, with a warning that states the consequence.
    int index_or_warn(const MeshTexture& texture, Colour colour, const char* otherwise) {
        const Result<int> index = texture_index(texture, {.colour = colour, .wrap = texture.wrap});
        if (index) return *index;
        warn(index.error().text() + otherwise);
        return -1;
    }

    Result<Texture> read(const MeshTexture& t, const TextureUse& use) {
        std::vector<std::string> warnings;
        Result<Texture> texture = t.bytes.empty() ? read_texture(t.file, use, &warnings)
                                                  : decode_texture(t.file, t.bytes, use, &warnings);
        for (std::string& what : warnings) warn(std::move(what));
        return texture;
    }

    /// Each image is read once for each use of it.
    Result<int> texture_index(const MeshTexture& wanted, const TextureUse& use) {
        if (const auto known = textures_.find(texture_key(wanted, use)); known != textures_.end())
            return known->second;
        Result<Texture> texture = read(wanted, use);
        if (!texture) return texture.error();
        return add_texture(wanted, use, std::move(*texture));
    }

    int add_texture(const MeshTexture& wanted, const TextureUse& use, Texture&& texture) {
        r_.scene.textures.push_back(std::move(texture));
        return textures_[texture_key(wanted, use)] = static_cast<int>(r_.scene.textures.size()) - 1;
    }

    void warn(std::string text) {
        auto& all = r_.scene.warnings;
        if (std::find(all.begin(), all.end(), text) == all.end()) all.push_back(std::move(text));
    }

    SceneReading& r_;
    std::map<MeshKey, LoadedMesh> meshes_;
    std::map<TextureKey, int> textures_;
    std::set<std::string> heights_;  ///< images under MTL's `bump` that are no normal maps
};

/// A texture laid over a mesh that has no texture coordinates would show one texel.
void check_coordinates(const NamedTexture& named, SceneReading& r) {
    for (const NamedMesh& mesh : r.meshes) {
        if (mesh.material != named.material) continue;
        const auto index = static_cast<std::size_t>(std::get<int>(r.scene.bodies[mesh.body].shape));
        if (r.scene.meshes[index].uvs.empty())
            r.problems.add(named.place, fmt::format("{}: {} has no texture coordinates", named.key, mesh.path));
    }
}

}  // namespace

void load_named_files(SceneReading& reading) {
    Loader loader(reading);
    for (const NamedMesh& mesh : reading.meshes) loader.load_mesh(mesh);
    for (const NamedTexture& texture : reading.textures) loader.load_texture(texture);
    if (reading.problems.none()) load_dems(reading);
    if (!reading.problems.none()) return;
    for (const NamedTexture& texture : reading.textures) check_coordinates(texture, reading);
    if (reading.scene.materials.size() > std::numeric_limits<std::uint16_t>::max())
        reading.problems.add(FilePlace{}, "more than 65535 materials");
}

}  // namespace narpa
