/// renderer/scene_file/scene_parts.h - the parts of a scene file, each read by a function of its own
/// (docs/scene.md).
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "renderer/assets/dem_process.h"
#include "renderer/assets/images/texture_file.h"
#include "renderer/ephemeris/observed_courses.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/scene/mounting.h"
#include "renderer/scene/scene.h"

namespace narpa {

/// A mesh that a body names: read when the whole scene file has been found good.
struct NamedMesh {
    std::size_t body = 0;
    std::string path;
    double scale = 1, crease_rad = 0;  ///< of read_mesh
    std::optional<int> material;       ///< replaces the mesh's own; index into Scene::materials
    FilePlace place;
};

/// A texture that a `material` table names.
struct NamedTexture {
    int material = 0;
    int Material::*slot = &Material::texture;  ///< where its index goes
    std::string key;                           ///< "texture", "normal_texture" ...
    std::string path;
    TextureUse use{};
    FilePlace place;
};

/// A DEM that a body names: read when all else has been found good, as its triangles depend on the sensors.
struct NamedDem {
    std::size_t body = 0;
    DemRequest request{};
    int material = 0;  ///< index into Scene::materials
    FilePlace place;
};

/// State while one scene file is read.
struct SceneReading {
    Scene scene;
    Problems problems;
    std::filesystem::path folder;  ///< of the scene file; paths in it start here
    std::vector<NamedMesh> meshes{};
    std::vector<NamedTexture> textures{};
    std::vector<NamedDem> dems{};
    bool has_epoch = false;  ///< in [scene]
    std::optional<Observing> observer{};
};

extern const TableKeys kSceneKeys, kSunKeys, kAmbientKeys, kStarsKeys, kRenderKeys, kTimeKeys, kCanKeys, kBodyKeys,
    kObserverKeys, kLightKeys, kCameraKeys, kLidarKeys, kAtmosphereKeys;
extern const TableKeys kMaterialKeys, kDemKeys;  ///< of `material` and `dem` of a body
extern const TableKeys kOrbitKeys;               ///< of `orbit` of a body
extern const TableKeys kMarkKeys;                ///< of `mark` of a body
extern const TableKeys kCanPoseKeys;             ///< of `can_pose` of a body
/// Parts of the keys of cameras: those at the observer, size and projection.
extern const TableKeys kTrackingKeys, kProjectionKeys;
/// [scene], [sun], [ambient], [render], [time], [can].
void read_surroundings(TableReader& root, SceneReading& reading);
/// [stars], with its catalogue. `epoch_year`: that of [scene], if it has one.
void read_stars(TableReader& root, SceneReading& reading, std::optional<double> epoch_year);
/// [[body]], without opening any mesh.
void read_bodies(TableReader& root, SceneReading& reading);
/// [[light]]; bodies come first.
void read_lights(TableReader& root, SceneReading& reading);
/// [[camera]] and [[lidar]]; bodies and surroundings come first.
void read_sensors(TableReader& root, SceneReading& reading);
/// Resolution and projection of a camera; paths in it start at `folder`.
void read_projection(TableReader& camera_table, Camera& camera, const std::filesystem::path& folder,
                     std::vector<std::string>& warnings);
/// A [[lidar]]; paths start at `folder`.
Lidar read_lidar(TableReader& table, TakenNames& names, Scene& scene, const std::filesystem::path& folder);
/// `dem` of a body, which has one, without opening it.
void read_dem(TableReader& body, int material, SceneReading& reading);
/// Opens every DEM that was named; cameras and LiDARs come first.
void load_dems(SceneReading& reading);
/// `orbit` of a body, which gives its position and velocity; attitude and rate come first.
void read_orbit(TableReader& table, Body& body);
/// `can_pose` of a body, after its can_id.
void read_can_pose(TableReader& body_table, Body& body, SceneReading& reading);
/// `mark` of a body.
void read_marks(TableReader& body_table, Body& body);
/// [observer]: puts the bodies and the Sun where they are seen; bodies and surroundings come first.
void read_observer(TableReader& root, SceneReading& reading);
/// `track` or `azimuth_elevation_deg` of a camera, which put it at the observer.
void read_tracking(TableReader& table, const SceneReading& reading, Camera& camera);
/// [atmosphere]; bodies and surroundings come first.
void read_atmosphere(TableReader& root, SceneReading& reading);
/// Opens every mesh and texture that was named.
void load_named_files(SceneReading& reading);

/// `material = {...}` of a body, added to the scene: its index, or nullopt where there is none.
std::optional<int> read_material(TableReader& body, const std::string& name, SceneReading& reading);
/// The material of a shape for which the scene names none; its index.
int add_grey_material(const std::string& name, Scene& scene);

}  // namespace narpa
