#include "renderer/scene_file/scene_inputs.h"

#include <filesystem>
#include <set>

#include "renderer/keys/based_on.h"

namespace narpa {
namespace {

namespace fs = std::filesystem;

/// Collects the files of TOML files: themselves, those they are based on, and those that their texts name.
class FileCollector {
public:
    /// `head`: the table that may have `based_on`.
    void add_toml(const fs::path& path, const std::string& head) {
        files_.insert(path.string());
        try {
            const auto table = parse_based_on(path.string(), head);
            if (table) add_node(*table, path.parent_path());
        } catch (const toml::parse_error&) {  // files that do not parse are left out
        }
    }
    void add_file(const fs::path& path) {
        std::error_code unknown;
        if (!fs::is_regular_file(path, unknown) || files_.contains(path.string())) return;
        if (path.extension() == ".toml") return add_toml(path, "lidar");
        files_.insert(path.string());
    }
    [[nodiscard]] std::vector<std::string> files() const { return {files_.begin(), files_.end()}; }

private:
    void add_node(const toml::node& node, const fs::path& folder) {
        if (const auto& path = node.source().path) files_.insert(*path);
        if (const toml::table* const table = node.as_table())
            for (const auto& [key, value] : *table) add_node(value, folder);
        if (const toml::array* const array = node.as_array())
            for (const toml::node& value : *array) add_node(value, folder);
        if (const auto* const text = node.as_string(); text && !text->get().empty()) add_file(folder / text->get());
    }

    std::set<std::string> files_;
};

}  // namespace

std::vector<std::string> files_of(const Scene& scene) {
    FileCollector collector;
    collector.add_toml(scene.file, "scene");
    for (const Texture& texture : scene.textures) collector.add_file(texture.name);
    return collector.files();
}

}  // namespace narpa
