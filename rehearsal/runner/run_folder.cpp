#include "rehearsal/runner/run_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>

#include "base/fnv1a.h"
#include "base/write_file.h"
#include "rehearsal/runner/child_process.h"
#include "renderer/keys/toml_file.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;

/// What a folder of each kind has, and those before it in FolderKind have not.
constexpr std::array<const char*, 3> kMarks{"rehearsal.json", "runs", "summary.json"};
constexpr std::array<const char*, 3> kKindNames{"a single run", "a campaign", "a summary of campaigns"};

/// The overrides of the scenario itself, not of its scene.
std::vector<std::string> own_overrides(const Scenario& scenario) {
    std::vector<std::string> own = scenario.overrides;
    std::erase_if(own, [&](const std::string& set) {
        return std::ranges::find(scenario.scene_overrides, set) != scenario.scene_overrides.end();
    });
    return own;
}

/// A table's text without the name of the map, which depends on the scenario's folder.
std::string without_map(const std::string& table) {
    std::istringstream lines(table);
    std::string out;
    for (std::string line; std::getline(lines, line);)
        if (!line.starts_with("map = ")) out += line + '\n';
    return out;
}

}  // namespace

Result<ScenarioTexts> scenario_texts(const Scenario& scenario) {
    ScenarioTexts texts;
    const auto read = [](const std::string& path, const char* head, const TableKeys& keys,
                         std::span<const std::string> overrides, std::string& out) -> Status {
        const auto file = TomlFile::read(path, head, keys, overrides);
        if (!file) return file.error();
        out = file->text() + '\n';
        return Ok{};
    };
    if (Status good = read(scenario.file, "scenario", kScenarioFileKeys, own_overrides(scenario), texts.scenario);
        !good)
        return good.error();
    if (Status good = read(scenario.scene, "scene", kSceneFileKeys, scenario.scene_overrides, texts.scene); !good)
        return good.error();
    if (const std::string& map = scenario.navigation.scene; !map.empty())
        if (Status good = read(map, "scene", kSceneFileKeys, scenario.map_overrides, texts.map); !good)
            return good.error();
    texts.hash = fmt::format("{:016x}", fnv1a(texts.map, fnv1a(texts.scene, fnv1a(texts.scenario))));
    return texts;
}

Result<std::string> difference_from_flown(const std::string& folder, const Scenario& scenario) {
    const auto flown = TomlFile::read(folder + "/scenario.toml", "scenario", kScenarioFileKeys);
    if (!flown) return flown.error();
    const auto now = TomlFile::read(scenario.file, "scenario", kScenarioFileKeys, own_overrides(scenario));
    if (!now) return now.error();
    const auto texts = scenario_texts(scenario);
    if (!texts) return texts.error();
    std::vector<std::string> differ;
    std::map<std::string, std::string> was = flown->tables(), is = now->tables();
    std::set<std::string> names;
    for (const auto* tables : {&was, &is})
        for (const auto& [name, text] : *tables) names.insert(name);
    names.erase("scenario");
    for (const std::string& name : names)
        if (without_map(was[name]) != without_map(is[name])) differ.push_back("[" + name + "]");
    if (read_text(folder + "/scene.toml") != texts->scene) differ.emplace_back("the scene");
    if (!texts->map.empty() && read_text(folder + "/map.toml") != texts->map) differ.emplace_back("the map");
    return fmt::format("{}", fmt::join(differ, ", "));
}

Result<Descriptor> lock_folder(const std::string& folder, Lock lock) {
    std::error_code failed;
    fs::create_directories(folder, failed);
    if (failed) return Error{"cannot be made: " + failed.message(), folder};
    Descriptor held(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!held) return Error{fmt::format("cannot be read: {}", std::strerror(errno)), folder};
    // Some network file systems have no locks: there the folder is used unlocked.
    const int mode = lock == Lock::shared ? LOCK_SH : LOCK_EX;
    if (::flock(held.get(), mode | LOCK_NB) != 0 && errno == EWOULDBLOCK)
        return Error{"is in use by another run that has not ended, expected a folder of its own for each", folder};
    return held;
}

Result<FolderKind> kind_of_folder(const std::string& folder) {
    std::error_code failed;
    for (std::size_t k = 0; k < kMarks.size(); ++k)
        if (fs::exists(folder + "/" + kMarks[k], failed)) return static_cast<FolderKind>(k);
    return Error{
        fmt::format("holds no {}, expected the folder of a rehearsal or of a campaign", fmt::join(kMarks, ", no ")),
        folder};
}

Result<Descriptor> claim_folder(const std::string& folder, FolderKind kind, Lock lock) {
    auto locked = lock_folder(folder, lock);
    if (!locked) return locked;
    std::error_code failed;
    const bool empty = fs::is_empty(folder, failed);
    if (failed) return Error{"cannot be read: " + failed.message(), folder};
    const auto held = kind_of_folder(folder);
    if (empty || (held && *held == kind)) return locked;
    return Error{fmt::format("holds {}, expected a new or empty folder, or that of {}",
                             held ? kKindNames[static_cast<std::size_t>(*held)] : "other files",
                             kKindNames[static_cast<std::size_t>(kind)]),
                 folder};
}

}  // namespace narpa::rehearsal
