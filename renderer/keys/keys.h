/// renderer/keys/keys.h - what the tables of scene, scenario and LiDAR-description files may hold: one row for each
/// key. Reading, its errors, the JSON schema and the tests of the documents follow from these rows.
///
///     constexpr TableKey kSunRows[] = {{"irradiance_w_m2", rows::number(kPositive)}, ...};
///     const TableKeys kSunKeys{.rows = kSunRows};
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace narpa {

/// The interval that a number has to lie in.
struct Range {
    double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();
    bool low_open = false, high_open = false;
    bool infinite = false;  ///< inf is allowed, too

    [[nodiscard]] bool holds(double x) const;
    [[nodiscard]] std::string words() const;  ///< "a number > 0"
};
inline constexpr Range kAnyNumber{};
inline constexpr Range kPositive{.low = 0, .low_open = true};
inline constexpr Range kNotNegative{.low = 0};
inline constexpr Range kUnit{.low = 0, .high = 1};

struct TableKeys;

/// What a key may hold: made by the functions in `rows`.
struct KeyValue {
    enum class Type : std::uint8_t {
        number,
        integer,
        boolean,
        text,
        texts,      ///< an array of texts
        numbers,    ///< an array of `counts` numbers
        direction,  ///< three numbers, not all 0
        attitude,   ///< a unit quaternion, [w, x, y, z]
        rgb,        ///< a number, or three
        size,       ///< two integers, [width, height]
        points,     ///< an array of `counts` arrays of three numbers
        choice,     ///< one of `words`
        kind,       ///< one of the kinds of the table's TableKeys
        date,       ///< a date or a date with its time, or a text with either
        table,
        tables,  ///< an array of tables
    };
    Type type = Type::text;
    bool or_file = false;            ///< a text that names a file will do, too
    Range range{};                   ///< of each number
    std::int64_t low = 0, high = 0;  ///< of each integer
    int count_min = 0, count_max = 0;
    std::array<int, 4> counts{};  ///< the allowed ones; none: all from count_min to count_max
    std::vector<std::string_view> (*words)() = nullptr;
    std::string_view otherwise{};     ///< the kind of a table that has no such key; empty: the key is required
    const TableKeys* keys = nullptr;  ///< of the table or tables

    /// Whether an array may have so many numbers or points.
    [[nodiscard]] bool allows(std::size_t count) const;
};

struct TableKey {
    std::string_view name;
    KeyValue value;
    std::string_view
        required{};  ///< completes "[sun] has no "direction", expected ..."; empty: the key may be absent
    std::string_view refusal{};  ///< by kinds of the table without this key; empty: names the kinds with it
};

/// The keys that a table has when its key of type `kind` holds this word, beside those of all kinds.
struct TableKind {
    std::string_view name;
    std::span<const TableKey> rows{};
};

/// The keys of one table.
struct TableKeys {
    std::span<const TableKey> rows{};
    std::array<const TableKeys*, 4> parts{};      ///< further keys of the same table; null: none
    std::vector<TableKind> (*kinds)() = nullptr;  ///< in the order of the concept's table
    std::vector<std::span<const TableKey>> (*listed)() =
        nullptr;  ///< further keys: of each row of a concept's table

    /// The row of a key of all kinds or of the kind with this index (-1: of any); null: it has none.
    [[nodiscard]] const TableKey* find(std::string_view name, int kind = -1) const;
    /// The rows of all kinds, with those of the parts and of the concept's table.
    [[nodiscard]] std::vector<const TableKey*> all_rows() const;
};

/// The first parts of pairs, or the elements: the words of a choice.
template <const auto& names>
std::vector<std::string_view> words_of() {
    std::vector<std::string_view> words;
    for (const auto& name : names)
        if constexpr (requires { name.first; })
            words.push_back(name.first);
        else
            words.push_back(name);
    return words;
}

/// The kinds of a concept's table, a function that returns pointers to rows with a name and keys.
template <auto table>
std::vector<TableKind> kinds_of() {
    std::vector<TableKind> kinds;
    for (const auto* row : table()) kinds.push_back({row->name, row->keys});
    return kinds;
}

/// The keys of all rows of a concept's table, for tables that may have those of several rows at once.
template <auto table>
std::vector<std::span<const TableKey>> keys_of() {
    std::vector<std::span<const TableKey>> keys;
    for (const auto* row : table()) keys.push_back(row->keys);
    return keys;
}

namespace rows {

using Type = KeyValue::Type;

constexpr KeyValue number(const Range& range = kAnyNumber) {
    return {.type = Type::number, .range = range};
}
constexpr KeyValue integer(std::int64_t low, std::int64_t high) {
    return {.type = Type::integer, .low = low, .high = high};
}
constexpr KeyValue boolean() {
    return {.type = Type::boolean};
}
constexpr KeyValue text() {
    return {};
}
/// A text that names a file.
constexpr KeyValue file() {
    return {.or_file = true};
}
constexpr KeyValue texts() {
    return {.type = Type::texts};
}
/// An array of one of these counts.
constexpr KeyValue numbers(const std::array<int, 4>& counts, const Range& range = kAnyNumber) {
    return {.type = Type::numbers, .range = range, .counts = counts};
}
/// An array of 1 to `most` numbers.
constexpr KeyValue numbers_up_to(int most, const Range& range = kAnyNumber) {
    return {.type = Type::numbers, .range = range, .count_min = 1, .count_max = most};
}
constexpr KeyValue pair(const Range& range = kAnyNumber) {
    return numbers({2}, range);
}
constexpr KeyValue vec3(const Range& range = kAnyNumber) {
    return numbers({3}, range);
}
constexpr KeyValue direction() {
    return {.type = Type::direction, .counts = {3}};
}
constexpr KeyValue attitude() {
    return {.type = Type::attitude, .range = {.low = -1.001, .high = 1.001}, .counts = {4}};
}
constexpr KeyValue rgb(const Range& range) {
    return {.type = Type::rgb, .range = range, .counts = {3}};
}
/// [width, height], each in [1, high].
constexpr KeyValue size(int high) {
    return {.type = Type::size, .low = 1, .high = high, .counts = {2}};
}
/// 1 to `most` points.
constexpr KeyValue points(int most) {
    return {.type = Type::points, .count_min = 1, .count_max = most};
}
/// One of the words of an array, of names or of pairs that begin with names.
template <const auto& names>
constexpr KeyValue choice() {
    return {.type = Type::choice, .words = words_of<names>};
}
constexpr KeyValue choice(std::vector<std::string_view> (*words)()) {
    return {.type = Type::choice, .words = words};
}
/// One of the kinds of the table's TableKeys; `otherwise` where the key is absent, unless it is required.
constexpr KeyValue kind(std::string_view otherwise = {}) {
    return {.type = Type::kind, .otherwise = otherwise};
}
constexpr KeyValue date() {
    return {.type = Type::date};
}
constexpr KeyValue table(const TableKeys& keys) {
    return {.type = Type::table, .keys = &keys};
}
constexpr KeyValue tables(const TableKeys& keys) {
    return {.type = Type::tables, .keys = &keys};
}
/// The value, or a text that names a file.
constexpr KeyValue or_file(KeyValue value) {
    value.or_file = true;
    return value;
}

}  // namespace rows
}  // namespace narpa
