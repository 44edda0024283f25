#include "renderer/scene_file/scene_file.h"

#include <fmt/format.h>

#include <algorithm>

#include "renderer/keys/based_on.h"
#include "renderer/material/bsdf_kind.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

bool allowed_in_name(char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
}

void read_root(TableReader& root, SceneReading& reading) {
    read_surroundings(root, reading);
    read_bodies(root, reading);
    read_observer(root, reading);
    read_lights(root, reading);
    read_sensors(root, reading);
    read_atmosphere(root, reading);
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

Result<Scene> read_files(const std::string& path) {
    SceneReading reading{
        .scene = {}, .problems = Problems(path), .folder = std::filesystem::path(path).parent_path()};
    reading.scene.file = path;
    try {
        const auto table = parse_based_on(path, "scene");
        if (!table) return table.error();
        TableReader root(*table, "the scene", reading.problems);
        read_root(root, reading);
    } catch (const toml::parse_error& e) {
        const bool toml = path.ends_with(".toml");
        reading.problems.add(e.source(),
                             std::string(e.description()) + (toml ? "" : ", expected a scene file (TOML)"));
    }
    if (!reading.problems.none()) return reading.problems.first();
    warn_of_dark_materials(reading.scene);
    return std::move(reading.scene);
}

}  // namespace

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

std::string read_name(TableReader& table, std::vector<std::string>& taken) {
    constexpr std::size_t kLongest = 64;
    table.require("name", "a text");
    std::string name = table.text("name").value_or("");
    const bool good =
        !name.empty() && name.size() <= kLongest && std::all_of(name.begin(), name.end(), allowed_in_name);
    if (table.has("name") && !good)
        table.fail("name", fmt::format("expected 1 to {} letters, digits, '_', '-' or '.'", kLongest));
    if (good && std::find(taken.begin(), taken.end(), name) != taken.end())
        table.fail("name",
                   fmt::format("\"{}\" is the name of another {}, expected a name of its own", name, table.name()));
    taken.push_back(name);
    return name;
}

Result<Scene> read_scene(const std::string& path) {
    try {
        return read_files(path);
    } catch (const std::exception& e) {
        return Error{.what = fmt::format("cannot be read: {}", e.what()), .file = path};
    }
}

}  // namespace narpa
