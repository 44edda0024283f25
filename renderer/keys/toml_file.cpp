#include "renderer/keys/toml_file.h"

#include <toml++/toml.h>

#include <filesystem>
#include <sstream>

#include "base/file_bytes.h"
#include "renderer/keys/toml_depth.h"

namespace narpa {
namespace {

/// Nodes are moved, not copied: a copy would lose its source location.
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

/// A `based_on` at the top of the file or in a table other than `head`; null: there is none.
const toml::key* find_misplaced(const toml::table& root, const std::string& head) {
    const auto key_of = [](const toml::table& table) -> const toml::key* {
        const auto at = table.find("based_on");
        return at == table.end() ? nullptr : &at->first;
    };
    if (const toml::key* key = key_of(root)) return key;
    for (const auto& [name, node] : root) {
        if (const toml::table* table = node.as_table(); table && name != head)
            if (const toml::key* key = key_of(*table)) return key;
        if (const toml::array* array = node.as_array())
            for (const toml::node& element : *array)
                if (const toml::table* table = element.as_table())
                    if (const toml::key* key = key_of(*table)) return key;
    }
    return nullptr;
}

Result<toml::table> parse(const std::string& path, const std::string& head, int depth) {
    constexpr int kDeepest = 8;
    const auto text = read_file(path);
    if (!text) return text.error();
    if (const Status depth_is_good = check_toml_depth(*text, path); !depth_is_good) return depth_is_good.error();
    toml::table table = toml::parse(std::string_view(*text), std::string_view(path));
    const auto wrong = [&](const toml::source_region& at, std::string what) {
        return Error{"based_on: " + std::move(what), path, static_cast<int>(at.begin.line),
                     static_cast<int>(at.begin.column)};
    };
    if (const toml::key* key = find_misplaced(table, head))
        return wrong(key->source(), "belongs to [" + head + "], expected it there");
    const toml::node* const based_on = table.at_path(head + ".based_on").node();
    if (!based_on) return table;
    if (!based_on->is_string()) return wrong(based_on->source(), "expected the name of a file in quotes");
    if (depth == kDeepest) return wrong(based_on->source(), "more than eight files one on another");
    auto base = parse(beside(path, based_on->as_string()->get()), head, depth + 1);
    if (!base) return base.error();
    table.at(head).as_table()->erase("based_on");
    merge(table, *std::move(base));
    return table;
}

template <class Visit>
void visit_values(const toml::node& node, const Visit& visit) {
    visit(node);
    if (const toml::table* const table = node.as_table())
        for (const auto& [key, value] : *table) visit_values(value, visit);
    if (const toml::array* const array = node.as_array())
        for (const toml::node& value : *array) visit_values(value, visit);
}

}  // namespace

std::string beside(const std::string& file, const std::string& named) {
    return (std::filesystem::path(file).parent_path() / named).lexically_normal().string();
}

Result<TomlFile> TomlFile::read(const std::string& path, const std::string& head) {
    try {
        auto table = parse(path, head, 0);
        if (!table) return table.error();
        return TomlFile(std::make_shared<const toml::table>(*std::move(table)));
    } catch (const toml::parse_error& e) {
        const toml::source_region& at = e.source();
        return Error{std::string(e.description()), at.path ? *at.path : path, static_cast<int>(at.begin.line),
                     static_cast<int>(at.begin.column)};
    }
}

std::string TomlFile::text() const {
    std::ostringstream text;
    text << toml::toml_formatter(*table_);
    return text.str();
}

std::map<std::string, std::string> TomlFile::tables() const {
    std::map<std::string, std::string> tables;
    for (const auto& [name, node] : *table_) {
        std::ostringstream text;
        node.visit([&](const auto& value) { text << value; });
        tables.emplace(name.str(), text.str());
    }
    return tables;
}

std::set<std::string> TomlFile::files() const {
    std::set<std::string> files;
    visit_values(*table_, [&](const toml::node& node) {
        if (const auto& path = node.source().path) files.insert(*path);
    });
    return files;
}

std::vector<std::string> TomlFile::texts() const {
    std::vector<std::string> texts;
    visit_values(*table_, [&](const toml::node& node) {
        if (const auto* const text = node.as_string()) texts.push_back(text->get());
    });
    return texts;
}

}  // namespace narpa
