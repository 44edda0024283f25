#include <filesystem>

#include "rehearsal/scenario/scenario_tables.h"
#include "renderer/keys/toml_file.h"
#include "renderer/keys/toml_override.h"
#include "renderer/scene/mounting.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::rehearsal {
namespace {

constexpr TableKey kScenarioRows[]{
    {"name", rows::text(), "a text"},
    {"scene", rows::file(), "the scene file"},
    {"based_on", rows::file()},
    {"title", rows::text()},
    {"duration_s", rows::number({.low = 0, .high = kLongest_s, .low_open = true})},
    {"pose_rate_hz", rows::number({.low = 0.1, .high = 1000})},
    {"seed", rows::integer(0, INT64_MAX)},
};
constexpr TableKeys kScenarioKeys{.rows = kScenarioRows};
constexpr TableKey kScenarioFileRows[]{
    {"scenario", rows::table(kScenarioKeys), "a table [scenario]"},
    {"orbit", rows::table(kOrbitKeys)},
    {"target", rows::table(kTargetKeys), "a table [target]"},
    {"chaser", rows::table(kChaserKeys), "a table [chaser]"},
    {"attractor", rows::table(kAttractorKeys)},
    {"start", rows::table(kStartKeys)},
    {"thrusters", rows::table(kThrustersKeys)},
    {"engine", rows::table(kEngineKeys)},
    {"landing_gear", rows::table(kLandingGearKeys)},
    {"attitude_sensor", rows::table(kAttitudeSensorKeys)},
    {"leg", rows::tables(kLegKeys), "[[leg]], one at least"},
    {"navigation", rows::table(kNavigationKeys), "a table [navigation]"},
    {"model_error", rows::table(kModelErrorKeys)},
    {"control", rows::table(kControlKeys)},
    {"fault", rows::tables(kFaultKeys)},
    {"gates", rows::table(kGatesKeys)},
};

/// Reads the scenario's scene; null if it cannot be read.
std::optional<Scene> read_head(TableReader& root, Scenario& s, Problems& problems) {
    auto table = root.table("scenario");
    if (!table) return std::nullopt;
    TakenNames names;
    s.name = read_name(*table, names);
    if (s.name.starts_with('.')) table->fail("name", "is that of the results' folder, expected no '.' in front");
    s.title = table->text("title").value_or(s.name);
    table->read("duration_s", s.duration_s);
    table->read("pose_rate_hz", s.pose_rate_hz);
    table->read("seed", s.seed);
    const auto scene = table->text("scene");
    const FilePlace place = table->place("scene");
    table->finish();
    if (!scene) return std::nullopt;
    if (s.scene.empty()) s.scene = beside(s.file, *scene);
    if (std::error_code error; !std::filesystem::exists(s.scene, error)) {
        problems.add(place, "scene: " + s.scene + ": no such file");
        return std::nullopt;
    }
    auto read = read_scene(s.scene, s.scene_overrides);
    if (read) return *std::move(read);
    problems.add(place, read.error());
    return std::nullopt;
}

void read_root(TableReader& root, Scenario& s, Problems& problems) {
    const std::optional<Scene> scene = read_head(root, s, problems);
    if (!scene) return;
    read_bodies(root, s, *scene);
    read_equipment(root, s);
    read_flight(root, s, *scene);
    read_faults(root, s);
    if (!s.legs.empty()) read_gates(root, s);
    root.finish();
}

}  // namespace

constinit const TableKeys kScenarioFileKeys{.rows = kScenarioFileRows};

Result<Scenario> read_scenario(const std::string& path, std::span<const std::string> overrides,
                               const ScenarioFiles& files) {
    Scenario s;
    s.file = path;
    s.scene = files.scene;
    s.navigation.scene = files.map;
    s.overrides.assign(overrides.begin(), overrides.end());
    std::vector<std::string> own_overrides;
    for (const std::string& set : overrides) {
        const std::string_view table = table_of_override(set);
        const bool is_of_scene = !kScenarioFileKeys.find(table) && kSceneFileKeys.find(table);
        (is_of_scene ? s.scene_overrides : own_overrides).push_back(set);
        if (is_of_scene && table != "body") s.map_overrides.push_back(set);
    }
    Problems problems(path);
    const auto file = TomlFile::read(path, "scenario", kScenarioFileKeys, own_overrides);
    if (!file) return file.error();
    TableReader root = file->root("the scenario", problems, &kScenarioFileKeys);
    read_root(root, s, problems);
    if (!problems.none()) return at_option(problems.first());
    return s;
}

}  // namespace narpa::rehearsal
