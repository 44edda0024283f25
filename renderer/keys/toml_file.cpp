#include "renderer/keys/toml_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <filesystem>
#include <sstream>

#include "base/file_bytes.h"
#include "renderer/keys/shipped_file.h"
#include "renderer/keys/toml_depth.h"
#include "renderer/keys/toml_override.h"

namespace narpa {
namespace {

void merge(toml::table& over, toml::table&& base, const std::set<std::string>& whole_lists);

/// The name of a table in a list; null: it is no table, or has none.
const std::string* name_of(const toml::node& element) {
    const toml::table* const table = element.as_table();
    const toml::value<std::string>* const name = table ? table->get_as<std::string>("name") : nullptr;
    return name ? &name->get() : nullptr;
}

/// A list of tables, each with a name.
bool is_named_list(const toml::node& node) {
    const toml::array* const array = node.as_array();
    return array && !array->empty() && std::ranges::all_of(*array, [](const toml::node& n) { return name_of(n); });
}

/// The tables of `base`, each under that of `over` with its name, then the others of `over`.
void merge_by_name(toml::array& over, toml::array&& base) {
    toml::array merged;
    for (toml::node& element : base) {
        const auto own = std::ranges::find_if(
            over, [&](const toml::node& n) { return name_of(n) && *name_of(n) == *name_of(element); });
        if (own == over.end()) {
            merged.push_back(std::move(*element.as_table()));
            continue;
        }
        merge(*own->as_table(), std::move(*element.as_table()), {});
        merged.push_back(std::move(*own->as_table()));
        over.erase(own);
    }
    for (toml::node& element : over) merged.push_back(std::move(*element.as_table()));
    over.clear();
    for (toml::node& element : merged) over.push_back(std::move(*element.as_table()));
}

/// Nodes are moved, not copied: a copy would lose its source location.
void merge(toml::table& over, toml::table&& base, const std::set<std::string>& whole_lists) {
    for (auto&& [key, node] : base) {
        toml::node* const own = over.get(key.str());
        if (!own) {
            node.visit([&, name = key](auto& value) { over.insert(name, std::move(value)); });
        } else if (own->is_table() && node.is_table()) {
            merge(*own->as_table(), std::move(*node.as_table()), {});
        } else if (!whole_lists.contains(std::string(key.str())) && is_named_list(*own) && is_named_list(node)) {
            merge_by_name(*own->as_array(), std::move(*node.as_array()));
        }
    }
}

/// Puts a folder before the relative names of files in a table.
void move_file_names(toml::table& table, const TableKeys& keys, const std::filesystem::path& folder) {
    for (auto&& [key, node] : table) {
        const TableKey* const row = keys.find(key.str());
        if (!row || key.str() == "based_on") continue;
        if (toml::value<std::string>* const text = node.as_string(); text && row->value.or_file) {
            const auto words = row->value.words ? row->value.words() : std::vector<std::string_view>{};
            const bool is_word = std::ranges::find(words, text->get()) != words.end();
            if (!is_word && !text->get().empty()) *text = (folder / text->get()).lexically_normal().string();
        }
        if (!row->value.keys) continue;
        if (toml::table* const sub = node.as_table()) move_file_names(*sub, *row->value.keys, folder);
        if (toml::array* const list = node.as_array())
            for (toml::node& element : *list)
                if (toml::table* const sub = element.as_table()) move_file_names(*sub, *row->value.keys, folder);
    }
}

/// A `based_on` or `replaces` at the top of the file or in a table other than `head`; null: there is none.
const toml::key* find_misplaced(const toml::table& root, const std::string& head) {
    const auto key_of = [](const toml::table& table) -> const toml::key* {
        for (const char* key : {"based_on", "replaces"})
            if (const auto at = table.find(key); at != table.end()) return &at->first;
        return nullptr;
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

/// Lists whose tables are steps in an order: those of a file replace those below as a whole.
const std::set<std::string> kSequences{"leg"};

/// A file and those that it is based on.
class BasedOnChain {
public:
    BasedOnChain(std::string head, const TableKeys& keys) : head_(std::move(head)), keys_(keys) {}

    /// `text`: of the file `path`.
    Result<toml::table> parse(const Result<std::string>& text, const std::string& path, int depth = 0) const {
        constexpr int kDeepest = 8;
        if (!text) return text.error();
        if (const Status depth_is_good = check_toml_depth(*text, path); !depth_is_good)
            return depth_is_good.error();
        toml::table table = toml::parse(std::string_view(*text), std::string_view(path));
        if (const toml::key* key = find_misplaced(table, head_))
            return error_at(path, key->source(), *key, "belongs to [" + head_ + "], expected it there");
        const toml::node* const based_on = table.at_path(head_ + ".based_on").node();
        auto whole_lists = replaced_lists(path, table, based_on != nullptr);
        if (!whole_lists) return whole_lists.error();
        if (!based_on) return table;
        const auto wrong = [&](std::string what) {
            return error_at(path, based_on->source(), "based_on", std::move(what));
        };
        if (!based_on->is_string()) return wrong("expected the name of a file in quotes");
        if (depth == kDeepest) return wrong("more than eight files one on another");
        const auto file = file_below(path, based_on->as_string()->get());
        if (!file) return wrong(file.error().text());
        auto base = parse(read_file(file->string()), file->string(), depth + 1);
        if (!base) return base.error();
        if (const auto folder = folder_from(path, *file); !folder.empty()) move_file_names(*base, keys_, folder);
        for (toml::table* const with_head : {&table, &*base})
            if (toml::table* const its_head = with_head->get_as<toml::table>(head_)) {
                its_head->erase("based_on");
                its_head->erase("replaces");
            }
        merge(table, *std::move(base), *whole_lists);
        return table;
    }

private:
    static Error error_at(const std::string& path, const toml::source_region& at, std::string_view key,
                          std::string what) {
        return {std::string(key) + ": " + std::move(what), path, static_cast<int>(at.begin.line),
                static_cast<int>(at.begin.column)};
    }

    /// The lists of tables that `replaces` names.
    Result<std::set<std::string>> replaced_lists(const std::string& path, const toml::table& table,
                                                 bool has_base) const {
        std::set<std::string> lists = kSequences;
        const toml::node* const names = table.at_path(head_ + ".replaces").node();
        if (!names) return lists;
        const auto wrong = [&](const toml::node& at, std::string what) {
            return error_at(path, at.source(), "replaces", std::move(what));
        };
        if (!has_base) return wrong(*names, "belongs to based_on, which is not here");
        if (!names->is_array()) return wrong(*names, "expected an array of names of lists, as [\"camera\"]");
        for (const toml::node& name : *names->as_array()) {
            const toml::node* const list = name.is_string() ? table.get(name.as_string()->get()) : nullptr;
            if (!list || !list->is_array_of_tables())
                return wrong(name, "expected the name of a list of tables of this file, as \"camera\"");
            lists.insert(name.as_string()->get());
        }
        return lists;
    }

    /// The file that `based_on` names: beside the file or, by name, shipped.
    [[nodiscard]] Result<std::filesystem::path> file_below(const std::string& path,
                                                           const std::string& named) const {
        std::error_code unknown;
        std::string file = beside(path, named);
        const auto kind = std::ranges::find(kFileKindWords, head_);
        if (std::filesystem::is_regular_file(file, unknown)) return std::filesystem::path(std::move(file));
        if (kind == kFileKindWords.end() || named.find(".toml") != std::string::npos)
            return Error{"no such file", std::move(file)};
        const auto shipped = find_shipped(static_cast<FileKind>(kind - kFileKindWords.begin()), named);
        if (!shipped) return shipped.error();
        return std::filesystem::path(*shipped);
    }

    static std::filesystem::path folder_of(const std::filesystem::path& file) {
        const auto folder = file.parent_path().lexically_normal();
        return folder == "." ? std::filesystem::path() : folder;
    }

    /// The folder of the file below as seen from that of the file above; empty: the same.
    static std::filesystem::path folder_from(const std::string& path, const std::filesystem::path& below) {
        const auto above_folder = folder_of(path), folder = folder_of(below);
        if (folder == above_folder) return {};
        return folder.is_absolute() ? folder : folder.lexically_relative(above_folder);
    }

    std::string head_;
    const TableKeys& keys_;
};

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

Result<TomlFile> TomlFile::read(const std::string& path, const std::string& head, const TableKeys& keys,
                                std::span<const std::string> overrides) {
    return parse(read_file(path), path, head, keys, overrides);
}

Result<TomlFile> TomlFile::parse(const std::string& text, const std::string& path, const std::string& head,
                                 const TableKeys& keys, std::span<const std::string> overrides) {
    return parse(Result<std::string>(text), path, head, keys, overrides);
}

Result<TomlFile> TomlFile::parse(const Result<std::string>& text, const std::string& path, const std::string& head,
                                 const TableKeys& keys, std::span<const std::string> overrides) {
    try {
        auto table = BasedOnChain(head, keys).parse(text, path);
        if (!table) return table.error();
        for (const std::string& set : overrides)
            if (const Status good = apply_override(set, keys, *table); !good) return good.error();
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
        if (const auto& path = node.source().path; path && !path->starts_with(kSetOption)) files.insert(*path);
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
