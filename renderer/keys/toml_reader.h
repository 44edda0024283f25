/// renderer/keys/toml_reader.h - reads TOML tables key by key, and records which keys were read.
///
/// A value that is absent or wrong is returned as nullopt, and the problem is recorded with its place. So a reader
/// is a flat list of `x = table.number("x").value_or(1)`, and the first problem in the file's order is reported at
/// the end.
#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "renderer/keys/keys.h"

namespace toml {
inline namespace v3 {
class node;
class table;
}  // namespace v3
}  // namespace toml

namespace narpa {

/// Where a key or value stands in a file.
struct FilePlace {
    std::string file{};
    int line = 0, column = 0;
};

/// Everything that is wrong with a file so far.
class Problems {
public:
    explicit Problems(std::string file) : file_(std::move(file)) {}
    void add(const FilePlace& at, std::string what);
    /// A missing key. Reported when nothing else is wrong: it may be present under a misspelt name.
    void add_missing(const FilePlace& at, std::string what);
    /// An error of another file (a mesh, a texture) that was named at this place.
    void add(const FilePlace& at, Error error);
    [[nodiscard]] bool none() const { return problems_.empty(); }
    /// The first in the file; missing keys come last.
    [[nodiscard]] Error first() const;
    [[nodiscard]] const std::string& file() const { return file_; }

private:
    struct Problem {
        bool is_missing_key;
        int line, column;
        Error error;
    };

    std::string file_;
    std::vector<Problem> problems_;
};

/// A finite vector times a power of two that brings its largest component into [1, 2), so that no square overflows
/// or vanishes, and no rounding changes. Zero stays zero.
Vec3 scaled_to_one(const Vec3& a);

/// One table of the file. Ranges, choices and counts are those of the keys' rows, unless a call narrows them.
class TableReader {
public:
    /// `name` as the file has it: "[sun]", "[[camera]]", "sphere". Notes a problem for each required key that is
    /// absent. The table outlives the reader.
    TableReader(const toml::table& table, std::string name, Problems& problems, const TableKeys* keys = nullptr);

    [[nodiscard]] const std::string& name() const { return name_; }
    [[nodiscard]] bool has(std::string_view key) { return find(key) != nullptr; }
    /// Notes a problem when the key is absent; `expected` completes "expected ...".
    void require(std::string_view key, std::string_view expected);

    /// The index of the table's kind in `TableKeys::kinds`. Refuses keys that only other kinds have.
    std::optional<std::size_t> kind();

    std::optional<double> number(std::string_view key);
    std::optional<double> number(std::string_view key, const Range& range);
    std::optional<std::int64_t> integer(std::string_view key);
    std::optional<std::int64_t> integer(std::string_view key, std::int64_t low, std::int64_t high);
    std::optional<bool> boolean(std::string_view key);
    std::optional<std::string> text(std::string_view key);
    /// An array of texts.
    std::optional<std::vector<std::string>> texts(std::string_view key);
    /// An array of one of these counts.
    std::optional<std::vector<double>> numbers(std::string_view key);
    /// The numbers of these keys, each of one number or an array, in order. An absent or wrong number is
    /// `otherwise`; such an array has the first of its row's counts.
    std::vector<double> values(std::span<const TableKey> keys, double otherwise);
    std::optional<Vec3> vec3(std::string_view key);
    std::optional<Vec3> vec3(std::string_view key, const Range& range);
    /// A unit vector from one of any length but 0.
    std::optional<Vec3> direction(std::string_view key);
    std::optional<std::array<double, 2>> pair(std::string_view key);
    std::optional<std::array<double, 2>> pair(std::string_view key, const Range& range);
    /// One number for the three bands, or [r, g, b].
    std::optional<Rgb> rgb(std::string_view key);
    /// [w, x, y, z]; made exactly unit when | |q| - 1 | < 1e-3, else a problem.
    std::optional<Quat> attitude(std::string_view key);
    /// [width, height], each in [1, high].
    std::optional<std::array<int, 2>> size(std::string_view key);
    /// [[x, y, z], ...]
    std::optional<std::vector<Vec3>> points(std::string_view key);
    /// UTC in ns since 1970, of the years 1900 to 2099; a time without an offset is UTC.
    std::optional<std::int64_t> date(std::string_view key);
    /// Sets `value` if the key is there and good.
    template <class T>
    void read(std::string_view key, T& value) {
        if constexpr (std::same_as<T, bool>) {
            value = boolean(key).value_or(value);
        } else if constexpr (std::floating_point<T>) {
            if (const auto x = number(key)) value = static_cast<T>(*x);
        } else if constexpr (std::integral<T>) {
            if (const auto i = integer(key)) value = static_cast<T>(*i);
        } else if constexpr (std::same_as<T, Vec3>) {
            value = vec3(key).value_or(value);
        } else if constexpr (std::same_as<T, Rgb>) {
            value = rgb(key).value_or(value);
        } else if constexpr (std::same_as<T, Quat>) {
            value = attitude(key).value_or(value);
        } else if constexpr (std::is_enum_v<T>) {  // enumerators in the order of the row's words
            if (const auto index = word(key)) value = static_cast<T>(*index);
        } else {
            static_assert(std::same_as<T, std::string>);
            value = text(key).value_or(std::move(value));
        }
    }
    /// One of a few words.
    template <class T>
    std::optional<T> choice(std::string_view key, std::span<const std::pair<std::string_view, T>> words) {
        std::vector<std::string_view> names;
        for (const auto& [name, value] : words) names.push_back(name);
        const auto index = word(key, names);
        return index ? std::optional<T>(words[*index].second) : std::nullopt;
    }
    template <class T, std::size_t N>
    std::optional<T> choice(std::string_view key, const std::array<std::pair<std::string_view, T>, N>& words) {
        return choice<T>(key, std::span<const std::pair<std::string_view, T>>(words));
    }
    /// The index of a choice among the words of its row.
    std::optional<std::size_t> word(std::string_view key);
    std::optional<TableReader> table(std::string_view key);
    /// The tables of `[[key]]`, in the file's order.
    std::vector<TableReader> tables(std::string_view key);

    /// Whether the key is there and holds a text.
    [[nodiscard]] bool is_text(std::string_view key);
    [[nodiscard]] bool is_table(std::string_view key);
    /// A known key that is not allowed here; `why` completes "KEY: ...". No effect where it is absent.
    void refuse(std::string_view key, const std::string& why);
    /// Notes a problem at the value of a key (at the table when absent).
    void fail(std::string_view key, const std::string& what);
    [[nodiscard]] FilePlace place(std::string_view key) const;
    /// Every unknown key is a problem. Call it last.
    void finish();

private:
    /// The node of a key, counted as read; null when absent.
    const toml::node* find(std::string_view key);
    /// What the key's row says. It has a row of this type.
    [[nodiscard]] const KeyValue& row(std::string_view key, KeyValue::Type type) const;
    std::optional<std::vector<double>> numbers(std::string_view key, const KeyValue& expected);
    std::optional<std::size_t> word(std::string_view key, const std::vector<std::string_view>& words);
    /// The result of `take` for the key's node; notes a problem if it is empty.
    template <class Take>
    auto value(std::string_view key, const Take& take, const std::string& expected)
        -> decltype(take(std::declval<const toml::node&>()));

    const toml::table* table_;
    std::string name_;
    Problems* problems_;
    const TableKeys* keys_;  ///< null: of a table without rows
    int kind_ = -1;          ///< index in TableKeys::kinds; -1: not known
    std::vector<std::string> asked_;
};

}  // namespace narpa
