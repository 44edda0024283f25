#include "renderer/scene/based_on.h"

#include <filesystem>

#include "renderer/scene/file_bytes.h"
#include "renderer/scene/toml_depth.h"

namespace narpa {
namespace {

/// Nodes are moved, not copied: a copy would lose its place in the file.
void merge(toml::table& over, toml::table&& base) {
    for (auto&& [key, node] : base) {
        toml::node* const own = over.get(key.str());
        if (!own) {
            node.visit([&, name = key](auto& value) { over.insert(name, std::move(value)); });
        } else if (own->is_table() && node.is_table()) {
            merge(*own->as_table(), std::move(*node.as_table()));
        }
    }
}

Result<toml::table> parse(const std::string& path, const std::string& head, int depth) {
    constexpr int kDeepest = 8;
    const auto text = read_file(path);
    if (!text) return text.error();
    if (const Status depth_is_good = check_toml_depth(*text, path); !depth_is_good) return depth_is_good.error();
    toml::table table = toml::parse(std::string_view(*text), std::string_view(path));
    const toml::node* const based_on = table.at_path(head + ".based_on").node();
    if (!based_on) return table;
    const auto wrong = [&](const char* what) {
        const toml::source_position& at = based_on->source().begin;
        return Error{what, path, static_cast<int>(at.line), static_cast<int>(at.column)};
    };
    if (!based_on->is_string()) return wrong("based_on: expected the name of a file in quotes");
    if (depth == kDeepest) return wrong("based_on: more than eight files one on another");
    auto base = parse(beside(path, based_on->as_string()->get()), head, depth + 1);
    if (!base) return base.error();
    merge(table, *std::move(base));
    return table;
}

}  // namespace

std::string beside(const std::string& file, const std::string& named) {
    return (std::filesystem::path(file).parent_path() / named).lexically_normal().string();
}

Result<toml::table> parse_based_on(const std::string& path, const std::string& head) {
    return parse(path, head, 0);
}

}  // namespace narpa
