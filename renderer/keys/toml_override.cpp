#include "renderer/keys/toml_override.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <charconv>
#include <optional>

#include "base/text/nearest_name.h"
#include "renderer/keys/other_names.h"
#include "renderer/keys/toml_depth.h"

namespace narpa {
namespace {

using ValueType = KeyValue::Type;

/// A table on the way to a key, and the keys that it may have.
struct TablePlace {
    toml::table* table;
    const TableKeys* keys;
    std::string name;  ///< "[[camera]] nav", for messages
};

Error override_error(const std::string& set, std::string what) {
    return {std::move(what), std::string(kSetOption) + set};
}

std::vector<std::string> key_names(const TableKeys& keys) {
    std::vector<std::string> names;
    for (const TableKey* key : keys.all_rows()) names.emplace_back(key->name);
    for (const TableKind& kind : keys.kinds ? keys.kinds() : std::vector<TableKind>{})
        for (const TableKey& key : kind.rows)
            if (std::ranges::find(names, key.name) == names.end()) names.emplace_back(key.name);
    return names;
}

/// The part of a path up to the next dot; the path then begins behind it.
std::string_view take_part(std::string_view& path) {
    const std::string_view part = path.substr(0, path.find('.'));
    path.remove_prefix(std::min(path.size(), part.size() + 1));
    return part;
}

std::optional<std::string> name_in(const toml::node& element) {
    const toml::table* const table = element.as_table();
    return table ? (*table)["name"].value<std::string>() : std::nullopt;
}

/// The table of a list that the path begins with, by its name, which may have dots, or by its number. The path then
/// begins behind it.
Result<toml::table*> take_element(const std::string& set, std::string_view list, toml::array* array,
                                  std::string_view& path) {
    std::vector<std::string> names;
    toml::table* found = nullptr;
    std::size_t longest = 0, count = 0;
    if (array) {
        for (toml::node& element : *array) {
            const std::string name = name_in(element).value_or(fmt::format("{}", count));
            ++count;
            names.push_back(name);
            const bool fits = path == name || (path.starts_with(name) && path[name.size()] == '.');
            if (!fits || name.size() < longest || !element.is_table()) continue;
            found = element.as_table();
            longest = name.size();
        }
    }
    if (found) {
        path.remove_prefix(std::min(path.size(), longest + 1));
        return found;
    }
    const std::string_view part = path.substr(0, path.find('.'));
    if (!array || names.empty()) return override_error(set, fmt::format("there is no [[{}]]", list));
    return override_error(set, fmt::format("there is no [[{}]] \"{}\", expected one of {}{}", list, part,
                                           fmt::join(names, ", "), did_you_mean(part, names)));
}

/// The table with this key within another; made where it is absent.
Result<toml::table*> subtable(const std::string& set, toml::table& table, std::string_view key) {
    toml::node* node = table.get(key);
    if (!node) node = &table.insert(key, toml::table{}).first->second;
    if (toml::table* const found = node->as_table()) return found;
    return override_error(set, fmt::format("\"{}\" is no table in the file, expected {}=VALUE", key, key));
}

/// Steps through the table or list of a row; the path then begins behind it.
Result<TablePlace> step_into(const std::string& set, const TablePlace& at, const TableKey& row,
                             std::string_view& path) {
    if (!row.value.keys)
        return override_error(set, fmt::format("\"{}\" in {} has no keys of its own", row.name, at.name));
    const Error no_key = override_error(set, fmt::format("\"{0}\" is a table, expected {0}.{1}KEY=VALUE", row.name,
                                                         row.value.type == ValueType::tables ? "NAME." : ""));
    if (path.empty()) return no_key;
    if (row.value.type != ValueType::tables) {
        auto table = subtable(set, *at.table, row.name);
        if (!table) return table.error();
        return TablePlace{*table, row.value.keys, fmt::format("[{}]", row.name)};
    }
    toml::node* const list = at.table->get(row.name);
    auto element = take_element(set, row.name, list ? list->as_array() : nullptr, path);
    if (!element) return element.error();
    if (path.empty()) return no_key;
    return TablePlace{*element, row.value.keys, fmt::format("[[{}]]", row.name)};
}

bool is_worded(const KeyValue& value) {
    switch (value.type) {
        case ValueType::text:
        case ValueType::choice:
        case ValueType::kind:
        case ValueType::date: return true;
        default: return value.or_file;
    }
}

/// A basic string of TOML.
std::string quoted(std::string_view text) {
    std::string out = "\"";
    for (const char c : text) {
        if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
            out += fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
            continue;
        }
        if (c == '"' || c == '\\') out += '\\';
        out += c;
    }
    return out + '"';
}

/// The value as a node whose place is the option. What is no value of TOML becomes a text, which the reader of the
/// key refuses.
Result<toml::table> value_node(const std::string& set, std::string_view value, const KeyValue& expected) {
    const std::string place = std::string(kSetOption) + set;
    const auto parse = [&](std::string_view text) {
        return toml::parse("v = " + std::string(text), std::string_view(place));
    };
    const bool is_typed = value.starts_with('"') || value.starts_with('\'') || value.starts_with('{') ||
                          (value.starts_with('[') && !expected.or_file);
    if (const Status good = check_toml_depth(value, place); !good) return at_option(good.error());
    try {
        if (is_typed || !is_worded(expected)) {
            toml::table table = parse(value);
            if (table.size() == 1) return table;
        }
    } catch (const toml::parse_error&) {  // a text
    }
    try {
        return parse(quoted(value));
    } catch (const toml::parse_error& e) {
        return override_error(set, std::string(e.description()));
    }
}

}  // namespace

Result<std::vector<std::string>> values_of_override(const std::string& set) {
    const std::size_t equals = set.find('=');
    if (equals == 0 || equals == std::string::npos || equals + 1 == set.size())
        return override_error(set, "expected KEY=VALUE, as camera.nav.detector.exposure_s=0.002");
    const std::string key = set.substr(0, equals + 1);
    std::vector<std::string> values;
    std::string value;
    int depth = 0;
    char quote = 0;
    for (const char c : set.substr(equals + 1)) {
        if (quote == 0 && (c == '"' || c == '\''))
            quote = c;
        else if (c == quote)
            quote = 0;
        if (quote == 0) depth += (c == '[' || c == '{') - (c == ']' || c == '}');
        if (c == ',' && depth == 0 && quote == 0)
            values.push_back(key + std::exchange(value, {}));
        else
            value += c;
    }
    values.push_back(key + value);
    if (std::ranges::find(values, key) != values.end())
        return override_error(set, "a value between the commas is empty, expected KEY=A,B");
    return values;
}

std::string_view table_of_override(std::string_view set) {
    return set.substr(0, set.find_first_of(".="));
}

Status apply_override(const std::string& set, const TableKeys& keys, toml::table& root) {
    const auto values = values_of_override(set);
    if (!values) return values.error();
    if (values->size() > 1)
        return override_error(
            set, fmt::format("{} values, expected one: only `narpa render` takes each in turn", values->size()));
    const std::size_t equals = set.find('=');
    std::string_view path = std::string_view(set).substr(0, equals);
    TablePlace at{&root, &keys, "the file"};
    for (;;) {
        const std::string_view part = take_part(path);
        const TableKey* const row = at.keys->find(part);
        if (!row)
            return override_error(set, fmt::format("unknown key \"{}\" in {}{}", part, at.name,
                                                   key_meant(part, key_names(*at.keys))));
        if (part == "based_on" || part == "replaces")
            return override_error(set,
                                  fmt::format("\"{}\" belongs in the file, expected a key of its tables", part));
        if (path.empty() && row->value.type != ValueType::tables && at.table != &root) {
            auto holder = value_node(set, std::string_view(set).substr(equals + 1), row->value);
            if (!holder) return holder.error();
            holder->get("v")->visit([&](auto& node) { at.table->insert_or_assign(part, std::move(node)); });
            return Ok{};
        }
        auto next = step_into(set, at, *row, path);
        if (!next) return next.error();
        at = *std::move(next);
    }
}

Error at_option(Error error) {
    if (error.file.starts_with(kSetOption)) error.line = error.column = 0;
    return error;
}

}  // namespace narpa
