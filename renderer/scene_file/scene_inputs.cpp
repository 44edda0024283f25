#include "renderer/scene_file/scene_inputs.h"

#include <filesystem>
#include <set>

#include "renderer/keys/toml_file.h"
#include "renderer/scene_file/lidar_description.h"
#include "renderer/scene_file/scene_file.h"

namespace narpa {
namespace {

namespace fs = std::filesystem;

/// Collects the files of TOML files: themselves, those they are based on, and those that their texts name.
class FileCollector {
public:
    /// `head`: the table that may have `based_on`.
    void add_toml(const fs::path& path, const std::string& head, const TableKeys& keys,
                  std::span<const std::string> overrides = {}) {
        files_.insert(path.string());
        const auto file = TomlFile::read(path.string(), head, keys, overrides);
        if (!file) return;  // files that do not parse are left out
        files_.merge(file->files());
        for (const std::string& text : file->texts())
            if (!text.empty()) add_file(path.parent_path() / text);
    }
    void add_file(const fs::path& path) {
        std::error_code unknown;
        if (!fs::is_regular_file(path, unknown) || files_.contains(path.string())) return;
        if (path.extension() == ".toml") return add_toml(path, "lidar", kLidarDescriptionKeys);
        files_.insert(path.string());
    }
    [[nodiscard]] std::vector<std::string> files() const { return {files_.begin(), files_.end()}; }

private:
    std::set<std::string> files_;
};

}  // namespace

std::vector<std::string> files_of(const Scene& scene) {
    FileCollector collector;
    collector.add_toml(scene.file, "scene", kSceneFileKeys, scene.overrides);
    for (const Texture& texture : scene.textures) collector.add_file(texture.name);
    return collector.files();
}

}  // namespace narpa
