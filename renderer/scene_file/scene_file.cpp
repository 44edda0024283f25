#include "renderer/scene_file/scene_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "renderer/keys/toml_file.h"
#include "renderer/keys/toml_override.h"
#include "renderer/light/sky_kind.h"
#include "renderer/material/bsdf_kind.h"
#include "renderer/scene_file/doubtful_units.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

constexpr TableKey kSceneFileRows[]{
    {"scene", rows::table(kSceneKeys)},
    {"sun", rows::table(kSunKeys)},
    {"ambient", rows::table(kAmbientKeys)},
    {"stars", rows::table(kStarsKeys)},
    {"render", rows::table(kRenderKeys)},
    {"body", rows::tables(kBodyKeys), "at least one [[body]]"},
    {"observer", rows::table(kObserverKeys)},
    {"light", rows::tables(kLightKeys)},
    {"camera", rows::tables(kCameraKeys)},
    {"lidar", rows::tables(kLidarKeys)},
    {"atmosphere", rows::table(kAtmosphereKeys)},
    {"sky", rows::table(kSkyKeys)},
    {"time", rows::table(kTimeKeys)},
    {"can", rows::table(kCanKeys)},
};

void read_root(TableReader& root, SceneReading& reading) {
    read_surroundings(root, reading);
    read_bodies(root, reading);
    read_observer(root, reading);
    read_lights(root, reading);
    read_sensors(root, reading);
    read_atmosphere(root, reading);
    read_sky(root, reading.scene);
    root.finish();
    if (reading.problems.none()) load_named_files(reading);
}

/// Warns of mirrors and glass with direct lighting: it samples the light sources, and these materials scatter light
/// from one direction only, so they look dark.
void warn_of_dark_materials(Scene& scene) {
    std::string names;
    for (const Material& m : scene.materials)
        if (m.kind->is_delta)
            names += fmt::format("{}\"{}\" ({})", names.empty() ? "" : ", ", m.name, m.kind->name);
    if (names.empty()) return;
    const std::string warning =
        fmt::format("black in direct light: {}; method = \"path\" in [render] shows them", names);
    std::erase(scene.warnings, warning);
    if (scene.render.method == RenderSettings::Method::direct) scene.warnings.push_back(warning);
}

Result<Scene> read_files(const Result<TomlFile>& file, const std::string& path,
                         std::span<const std::string> overrides) {
    SceneReading reading{
        .scene = {}, .problems = Problems(path), .folder = std::filesystem::path(path).parent_path()};
    reading.scene.file = path;
    reading.scene.overrides.assign(overrides.begin(), overrides.end());
    if (!file) {
        Error error = file.error();
        if (error.line > 0 && error.file == path && !path.ends_with(".toml"))
            error.what += ", expected a scene file (TOML)";
        return error;
    }
    TableReader root = file->root("the scene", reading.problems, &kSceneFileKeys);
    read_root(root, reading);
    if (!reading.problems.none()) return at_option(reading.problems.first());
    warn_of_dark_materials(reading.scene);
    for (std::string& text : doubtful_units(reading.scene)) reading.scene.warnings.push_back(std::move(text));
    return std::move(reading.scene);
}

}  // namespace

constinit const TableKeys kSceneFileKeys{.rows = kSceneFileRows};

Status use_method(Scene& scene, RenderSettings::Method method) {
    for (const Material& m : scene.materials)
        if (m.kind->direct_only && method == RenderSettings::Method::path)
            return Error{.what = fmt::format("material \"{}\" is \"{}\", which keeps no energy, expected "
                                             "\"phong\" for method path",
                                             m.name, m.kind->name),
                         .file = scene.file};
    scene.render.method = method;
    warn_of_dark_materials(scene);
    return Ok{};
}

Result<Scene> read_scene(const std::string& path, std::span<const std::string> overrides) {
    try {
        return read_files(TomlFile::read(path, "scene", kSceneFileKeys, overrides), path, overrides);
    } catch (const std::exception& e) {
        return Error{.what = fmt::format("cannot be read: {}", e.what()), .file = path};
    }
}

Result<Scene> parse_scene(const std::string& text, const std::string& path,
                          std::span<const std::string> overrides) {
    try {
        return read_files(TomlFile::parse(text, path, "scene", kSceneFileKeys, overrides), path, overrides);
    } catch (const std::exception& e) {
        return Error{.what = fmt::format("cannot be read: {}", e.what()), .file = path};
    }
}

}  // namespace narpa
