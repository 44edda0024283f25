#include "rehearsal/runner/run_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>

#include "base/write_file.h"
#include "renderer/keys/toml_file.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa::rehearsal {
namespace {

namespace fs = std::filesystem;

/// G. Fowler, L. Noll, K.-P. Vo: FNV-1a, 64 bits.
std::uint64_t fnv1a(std::string_view text, std::uint64_t hash = 0xcbf29ce484222325ULL) {
    for (const char c : text) hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x100000001b3ULL;
    return hash;
}

}  // namespace

Result<ScenarioTexts> scenario_texts(const Scenario& scenario) {
    ScenarioTexts texts;
    std::vector<std::string> own_overrides = scenario.overrides;
    std::erase_if(own_overrides, [&](const std::string& set) {
        return std::ranges::find(scenario.scene_overrides, set) != scenario.scene_overrides.end();
    });
    const auto read = [](const std::string& path, const char* head, const TableKeys& keys,
                         std::span<const std::string> overrides, std::string& out) -> Status {
        const auto file = TomlFile::read(path, head, keys, overrides);
        if (!file) return file.error();
        out = file->text() + '\n';
        return Ok{};
    };
    if (Status good = read(scenario.file, "scenario", kScenarioFileKeys, own_overrides, texts.scenario); !good)
        return good.error();
    if (Status good = read(scenario.scene, "scene", kSceneFileKeys, scenario.scene_overrides, texts.scene); !good)
        return good.error();
    if (const std::string& map = scenario.navigation.scene; !map.empty())
        if (Status good = read(map, "scene", kSceneFileKeys, scenario.map_overrides, texts.map); !good)
            return good.error();
    texts.hash = fmt::format("{:016x}", fnv1a(texts.map, fnv1a(texts.scene, fnv1a(texts.scenario))));
    return texts;
}

Result<Descriptor> lock_folder(const std::string& folder) {
    std::error_code failed;
    fs::create_directories(folder, failed);
    if (failed) return Error{"cannot be made: " + failed.message(), folder};
    Descriptor lock(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!lock) return Error{fmt::format("cannot be read: {}", std::strerror(errno)), folder};
    // Some network file systems have no locks: there the folder is used unlocked.
    if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK)
        return Error{"is in use by another run that has not ended, expected a folder of its own for each", folder};
    return lock;
}

Result<Descriptor> claim_folder(const std::string& folder, const char* mark) {
    auto lock = lock_folder(folder);
    if (!lock) return lock;
    std::error_code failed;
    const bool empty = fs::is_empty(folder, failed);
    if (failed) return Error{"cannot be read: " + failed.message(), folder};
    if (!empty && !fs::exists(folder + "/" + mark, failed))
        return Error{
            fmt::format("holds other files and no {}, expected a new or empty folder, or a rehearsal's", mark),
            folder};
    return lock;
}

}  // namespace narpa::rehearsal
