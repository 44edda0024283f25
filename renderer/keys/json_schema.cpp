#include "renderer/keys/json_schema.h"

#include <cmath>
#include <nlohmann/json.hpp>

namespace narpa {
namespace {

using Json = nlohmann::ordered_json;

Json table_schema(const TableKeys& keys);

Json number_schema(const Range& range) {
    Json out{{"type", "number"}};
    if (std::isfinite(range.low)) out[range.low_open ? "exclusiveMinimum" : "minimum"] = range.low;
    if (std::isfinite(range.high)) out[range.high_open ? "exclusiveMaximum" : "maximum"] = range.high;
    return out;
}

/// An array of the allowed counts.
Json array_schema(const Json& items, const KeyValue& value) {
    if (value.counts[0] == 0)
        return {{"type", "array"}, {"items", items}, {"minItems", value.count_min}, {"maxItems", value.count_max}};
    Json lengths = Json::array();
    for (const int count : value.counts)
        if (count > 0) lengths.push_back({{"minItems", count}, {"maxItems", count}});
    Json out{{"type", "array"}, {"items", items}};
    if (lengths.size() == 1)
        out.update(lengths[0]);
    else
        out["anyOf"] = lengths;
    return out;
}

Json value_schema(const KeyValue& value, const TableKeys& keys) {
    using enum KeyValue::Type;
    Json integers{{"type", "integer"}, {"minimum", value.low}, {"maximum", value.high}};
    switch (value.type) {
        case number: return number_schema(value.range);
        case integer: return integers;
        case boolean: return {{"type", "boolean"}};
        case text:
        case date: return {{"type", "string"}};
        case texts: return {{"type", "array"}, {"items", {{"type", "string"}}}};
        case numbers:
        case direction:
        case attitude: return array_schema(number_schema(value.range), value);
        case rgb: return {{"anyOf", {number_schema(value.range), array_schema(number_schema(value.range), value)}}};
        case size: return array_schema(integers, value);
        case points: return array_schema(array_schema({{"type", "number"}}, {.counts = {3}}), value);
        case choice: return {{"enum", value.words()}};
        case kind: {
            Json names = Json::array();
            for (const TableKind& k : keys.kinds()) names.push_back(k.name);
            return {{"enum", names}};
        }
        case table: return table_schema(*value.keys);
        case tables: return {{"type", "array"}, {"items", table_schema(*value.keys)}};
    }
    return Json::object();
}

Json key_schema(const TableKey& key, const TableKeys& keys) {
    Json schema = value_schema(key.value, keys);
    if (!key.value.or_file || key.value.type == KeyValue::Type::text) return schema;
    const Json file = key.value.type == KeyValue::Type::choice ? Json{{"type", "string"}, {"pattern", "\\.toml$"}}
                                                               : Json{{"type", "string"}};
    return {{"anyOf", {schema, file}}};
}

/// What holds for the tables of one kind: its keys, and none of the other kinds'.
Json kind_schema(const TableKind& kind, const std::vector<TableKind>& kinds, const TableKeys& keys,
                 const TableKey& kind_key) {
    Json own = Json::object(), required = Json::array();
    for (const TableKey& key : kind.rows) {
        own[std::string(key.name)] = key_schema(key, keys);
        if (!key.required.empty()) required.push_back(key.name);
    }
    for (const TableKind& other : kinds)
        for (const TableKey& key : other.rows)
            if (!own.contains(key.name)) own[std::string(key.name)] = false;
    Json is_kind{{"properties", {{kind_key.name, {{"const", kind.name}}}}}};
    if (kind.name != kind_key.value.otherwise) is_kind["required"] = Json::array({kind_key.name});
    return {{"if", is_kind}, {"then", {{"properties", own}, {"required", required}}}};
}

Json table_schema(const TableKeys& keys) {
    Json properties = Json::object(), required = Json::array(), kinds = Json::array();
    for (const TableKey* key : keys.all_rows()) {
        properties[std::string(key->name)] = key_schema(*key, keys);
        if (!key->required.empty()) required.push_back(key->name);
    }
    const std::vector<TableKind> all = keys.kinds ? keys.kinds() : std::vector<TableKind>{};
    for (const TableKind& kind : all) {
        for (const TableKey& key : kind.rows) properties.emplace(key.name, true);
        for (const TableKey* key : keys.all_rows())
            if (key->value.type == KeyValue::Type::kind) kinds.push_back(kind_schema(kind, all, keys, *key));
    }
    Json out{{"type", "object"}, {"properties", properties}, {"additionalProperties", false}};
    if (!required.empty()) out["required"] = required;
    if (!kinds.empty()) out["allOf"] = kinds;
    return out;
}

}  // namespace

std::string json_schema(const TableKeys& keys, std::string_view title) {
    Json schema{{"$schema", "https://json-schema.org/draft/2020-12/schema"}, {"title", title}};
    schema.update(table_schema(keys));
    return schema.dump(1, ' ') + "\n";
}

}  // namespace narpa
