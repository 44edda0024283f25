#include "dataset/recipe/recipe.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "base/constants.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/keys/toml_file.h"
#include "renderer/keys/toml_override.h"
#include "renderer/keys/toml_reader.h"
#include "renderer/scene/mounting.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::dataset {
namespace {

constexpr int kMaxKeypoints = 1000;
constexpr Range kFactor{.low = 1e-6, .high = 1e6}, kDegrees{.low = -360, .high = 360},
    kPhase{.low = 0, .high = 180}, kLength{.low = 0, .high = 1e15, .low_open = true};

constexpr TableKey kDatasetRows[]{
    {"name", rows::text(), "a text"},
    {"scene", rows::file(), "the scene file, or the name of a scene that comes with narpa"},
    {"based_on", rows::file()},
    {"set", rows::texts()},
    {"camera", rows::text()},
    {"target", rows::text()},
    {"attached", rows::texts()},
    {"seed", rows::integer(0, INT64_MAX)},
    {"outputs", rows::texts()},
};

/// In the order of `attitude`'s kinds.
constexpr std::array<std::string_view, 2> kAttitudeNames{"uniform", "cone"};
constexpr TableKey kConeRows[]{
    {"axis", rows::direction(), "[x, y, z] of the target, towards the camera"},
    {"half_angle_deg", rows::number(kPhase), "a number in [0, 180]"},
    {"up", rows::direction()},
    {"roll_deg", rows::table(kDistributionKeys)},
};
std::vector<TableKind> attitude_kinds() {
    return {{kAttitudeNames[0]}, {kAttitudeNames[1], kConeRows}};
}
constexpr TableKey kAttitudeRows[]{{"kind", rows::kind("uniform")}};
constexpr TableKeys kAttitudeKeys{.rows = kAttitudeRows, .kinds = attitude_kinds};

constexpr TableKey kPoseRows[]{
    {"point_m", rows::vec3()},
    {"range_m", rows::table(kDistributionKeys)},
    {"attitude", rows::table(kAttitudeKeys)},
    {"margin", rows::number({.low = -1, .high = 0.5})},
};
constexpr TableKey kIlluminationRows[]{{"phase_deg", rows::table(kDistributionKeys)}};
constexpr TableKey kExposureRows[]{
    {"time_factor", rows::table(kDistributionKeys)},
    {"gain_factor", rows::table(kDistributionKeys)},
};
constexpr TableKey kSurfaceRows[]{{"albedo_factor", rows::table(kDistributionKeys)}};
constexpr TableKey kVariantRows[]{
    {"name", rows::text(), "a text"},
    {"weight", rows::number(kPositive)},
    {"set", rows::texts()},
};
constexpr TableKey kBodyRows[]{{"body", rows::text(), "the body that is behind the target"}};
std::vector<TableKind> backdrop_kinds() {
    constexpr auto& names = Backdrop::kKindNames;
    return {{names[0]}, {names[1]}, {names[2], kBodyRows}, {names[3]}};
}
constexpr TableKey kBackdropRows[]{
    {"kind", rows::kind(), "one of \"none\", \"stars\", \"body\", \"scene\""},
    {"weight", rows::number(kPositive)},
};
constexpr TableKey kKeypointsRows[]{
    {"count", rows::integer(1, kMaxKeypoints)},
    {"points_m", rows::points(kMaxKeypoints)},
};

constexpr TableKeys kDatasetKeys{.rows = kDatasetRows}, kPoseKeys{.rows = kPoseRows},
    kIlluminationKeys{.rows = kIlluminationRows}, kExposureKeys{.rows = kExposureRows},
    kSurfaceKeys{.rows = kSurfaceRows}, kVariantKeys{.rows = kVariantRows},
    kBackdropKeys{.rows = kBackdropRows, .kinds = backdrop_kinds}, kKeypointsKeys{.rows = kKeypointsRows};
constexpr TableKey kRecipeFileRows[]{
    {"dataset", rows::table(kDatasetKeys), "a table [dataset]"},
    {"pose", rows::table(kPoseKeys)},
    {"illumination", rows::table(kIlluminationKeys)},
    {"exposure", rows::table(kExposureKeys)},
    {"surface", rows::table(kSurfaceKeys)},
    {"variant", rows::tables(kVariantKeys)},
    {"background", rows::tables(kBackdropKeys)},
    {"keypoints", rows::table(kKeypointsKeys)},
};

/// The path of the scene that a recipe names: beside it, or shipped.
Result<std::string> find_scene(const std::string& recipe, const std::string& named) {
    std::string file = beside(recipe, named);
    std::error_code unknown;
    if (std::filesystem::is_regular_file(file, unknown)) return file;
    if (named.ends_with(".toml")) return Error{"no such file", std::move(file)};
    return find_shipped(FileKind::scene, named);
}

void read_outputs(TableReader& table, Outputs& outputs) {
    const auto names = table.texts("outputs");
    if (!names) return;
    for (std::size_t k = 0; k < kOutputKinds.size(); ++k) outputs[k] = kOutputKinds[k].name.empty();
    for (const std::string& name : *names) {
        const auto kind = std::ranges::find(kOutputKinds, name, &OutputKind::name);
        if (kind == kOutputKinds.end() || name.empty())
            table.fail("outputs", fmt::format("got \"{}\", expected some of \"{}\"", name,
                                              fmt::join(optional_outputs(), "\", \"")));
        else
            outputs[static_cast<std::size_t>(kind - kOutputKinds.begin())] = true;
    }
}

void read_head(TableReader& root, Recipe& r) {
    auto table = root.table("dataset");
    if (!table) return;
    TakenNames names;
    r.name = read_name(*table, names);
    if (const auto scene = table->text("scene")) {
        auto path = find_scene(r.file, *scene);
        if (path)
            r.scene = *path;
        else
            table->fail("scene", path.error().text());
    }
    const auto sets = table->texts("set").value_or(std::vector<std::string>{});
    r.sets.insert(r.sets.begin(), sets.begin(), sets.end());
    table->read("camera", r.camera);
    table->read("target", r.target);
    r.attached = table->texts("attached").value_or(r.attached);
    table->read("seed", r.seed);
    read_outputs(*table, r.outputs);
    table->finish();
}

std::optional<AttitudeCone> read_cone(TableReader& pose) {
    auto table = pose.table("attitude");
    if (!table) return std::nullopt;
    const auto kind = table->kind();
    std::optional<AttitudeCone> cone;
    if (kind && kAttitudeNames[*kind] == "cone") {
        cone.emplace();
        cone->axis = table->direction("axis").value_or(cone->axis);
        cone->half_angle_rad = kRadPerDeg * table->number("half_angle_deg").value_or(0);
        cone->up = table->direction("up").value_or(cone->up);
        cone->roll_deg = read_distribution(*table, "roll_deg", kDegrees).value_or(cone->roll_deg);
    }
    table->finish();
    return cone;
}

void read_distributions(TableReader& root, Recipe& r) {
    if (auto pose = root.table("pose")) {
        r.point_m = pose->vec3("point_m");
        r.range_m = read_distribution(*pose, "range_m", kLength);
        r.cone = read_cone(*pose);
        pose->read("margin", r.margin);
        pose->finish();
    }
    if (auto illumination = root.table("illumination")) {
        r.phase_deg = read_distribution(*illumination, "phase_deg", kPhase);
        illumination->finish();
    }
    if (auto exposure = root.table("exposure")) {
        r.time_factor = read_distribution(*exposure, "time_factor", kFactor);
        r.gain_factor = read_distribution(*exposure, "gain_factor", kFactor);
        exposure->finish();
    }
    if (auto surface = root.table("surface")) {
        r.albedo_factor = read_distribution(*surface, "albedo_factor", kFactor);
        surface->finish();
    }
}

void read_lists(TableReader& root, Recipe& r) {
    TakenNames names;
    auto variants = root.tables("variant");
    if (!variants.empty()) r.variants.clear();
    for (TableReader& table : variants) {
        Variant& v = r.variants.emplace_back();
        v.name = read_name(table, names);
        table.read("weight", v.weight);
        v.sets = table.texts("set").value_or(v.sets);
        table.finish();
    }
    auto backdrops = root.tables("background");
    if (!backdrops.empty()) r.backdrops.clear();
    for (TableReader& table : backdrops) {
        Backdrop& b = r.backdrops.emplace_back();
        if (const auto kind = table.kind()) b.kind = static_cast<Backdrop::Kind>(*kind);
        table.read("weight", b.weight);
        if (b.kind == Backdrop::Kind::body) table.read("body", b.body);
        table.finish();
    }
    if (auto table = root.table("keypoints")) {
        if (table->has("points_m")) table->refuse("count", "belongs to chosen keypoints, without points_m");
        table->read("count", r.keypoints);
        r.keypoints_m = table->points("points_m").value_or(r.keypoints_m);
        table->finish();
    }
}

}  // namespace

constinit const TableKeys kRecipeFileKeys{.rows = kRecipeFileRows};

std::vector<std::string_view> optional_outputs() {
    std::vector<std::string_view> names;
    for (const OutputKind& kind : kOutputKinds)
        if (!kind.name.empty()) names.push_back(kind.name);
    return names;
}

Result<Recipe> read_recipe(const std::string& path, std::span<const std::string> overrides) {
    Recipe r;
    r.file = path;
    std::vector<std::string> own;
    for (const std::string& set : overrides) {
        const std::string_view table = table_of_override(set);
        (!kRecipeFileKeys.find(table) && kSceneFileKeys.find(table) ? r.sets : own).push_back(set);
    }
    Problems problems(path);
    const auto file = TomlFile::read(path, "dataset", kRecipeFileKeys, own);
    if (!file) return file.error();
    r.text = file->text();
    for (const std::string& set : r.sets) r.text += "# --set " + set + "\n";
    TableReader root = file->root("the recipe", problems, &kRecipeFileKeys);
    read_head(root, r);
    read_distributions(root, r);
    read_lists(root, r);
    root.finish();
    if (!problems.none()) return at_option(problems.first());
    return r;
}

Recipe recipe_of_scene(const std::string& scene_path, std::span<const std::string> overrides) {
    Recipe r;
    r.name = std::filesystem::path(scene_path).stem().string();
    r.file = r.scene = scene_path;
    r.sets.assign(overrides.begin(), overrides.end());
    r.text = fmt::format("[dataset]\nname = \"{0}\"\nscene = \"{0}.toml\"\n", r.name);
    for (const std::string& set : r.sets) r.text += "# --set " + set + "\n";
    return r;
}

}  // namespace narpa::dataset
