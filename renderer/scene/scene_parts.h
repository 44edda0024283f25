/// renderer/scene/scene_parts.h - the parts of a scene file, each read by a function of its own (docs/scene.md).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/scene.h"
#include "renderer/scene/toml_reader.h"

namespace narpa {

/// A mesh that a body names: read when the whole scene file has been found good.
struct NamedMesh {
    std::size_t body = 0;
    std::string path;
    double scale = 1;
    std::optional<int> material;  ///< replaces the mesh's own; index into Scene::materials
    toml::source_region place;
};

/// A texture that a `material` table names.
struct NamedTexture {
    int material = 0;
    std::string path;
    toml::source_region place;
};

/// What one reading of a scene file holds on to.
struct SceneReading {
    Scene scene;
    Problems problems;
    std::filesystem::path folder;  ///< of the scene file; paths in it start here
    std::vector<NamedMesh> meshes{};
    std::vector<NamedTexture> textures{};
};

/// [scene], [sun], [ambient], [render].
void read_surroundings(TableReader& root, SceneReading& reading);
/// [[body]], without opening any mesh.
void read_bodies(TableReader& root, SceneReading& reading);
/// [[camera]] and [[lidar]]; bodies and surroundings come first.
void read_sensors(TableReader& root, SceneReading& reading);
/// Opens every mesh and texture that was named.
void load_named_files(SceneReading& reading);

/// `name`: 1 to 64 of letters, digits, '_', '-', '.'; used by no other table of its kind (`taken`).
std::string read_name(TableReader& table, std::vector<std::string>& taken);

}  // namespace narpa
