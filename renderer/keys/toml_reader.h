/// renderer/keys/toml_reader.h - reads TOML tables key by key, and records which keys were read.
///
/// A value that is absent or wrong is returned as nullopt, and the problem is recorded with its place. So a reader
/// is a flat list of `x = table.number("x").value_or(1)`, and the first problem in the file's order is reported at
/// the end.
#pragma once

#include <toml++/toml.h>

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/pose.h"
#include "base/result.h"
#include "renderer/keys/keys.h"

namespace narpa {

/// Everything that is wrong with a file so far.
class Problems {
public:
    explicit Problems(std::string file) : file_(std::move(file)) {}
    void add(const toml::source_region& at, std::string what);
    /// A missing key. Reported when nothing else is wrong: it may be present under a misspelt name.
    void add_missing(const toml::source_region& at, std::string what);
    /// An error of another file (a mesh, a texture) that was named at this place.
    void add(const toml::source_region& at, Error error);
    [[nodiscard]] bool none() const { return problems_.empty(); }
    /// The first in the file; missing keys come last.
    [[nodiscard]] Error first() const;
    [[nodiscard]] const std::string& file() const { return file_; }

private:
    struct Problem {
        bool is_missing_key;
        toml::source_position at;
        Error error;
    };
    [[nodiscard]] Error located(const toml::source_region& at, std::string what) const;

    std::string file_;
    std::vector<Problem> problems_;
};

/// A finite vector times a power of two that brings its largest component into [1, 2), so that no square overflows
/// or vanishes, and no rounding changes. Zero stays zero.
Vec3 scaled_to_one(const Vec3& a);

/// The keys that a table has when its `kind` is this word, beside those that every kind has.
struct KindKeys {
    std::string_view kind;
    std::vector<std::string_view> keys;
};

/// One table of the file.
class TableReader {
public:
    /// `name` as the file has it: "[sun]", "[[camera]]", "sphere".
    TableReader(const toml::table& table, std::string name, Problems& problems)
        : table_(&table), name_(std::move(name)), problems_(&problems) {}

    [[nodiscard]] const std::string& name() const { return name_; }
    [[nodiscard]] bool has(std::string_view key) { return find(key) != nullptr; }
    /// Notes a problem when the key is absent; `expected` completes "expected ...".
    void require(std::string_view key, std::string_view expected);

    std::optional<double> number(std::string_view key, const Range& range = kAnyNumber);
    std::optional<std::int64_t> integer(std::string_view key, std::int64_t low, std::int64_t high);
    std::optional<bool> boolean(std::string_view key);
    std::optional<std::string> text(std::string_view key);
    /// An array of texts.
    std::optional<std::vector<std::string>> texts(std::string_view key);
    /// An array of one of these counts.
    std::optional<std::vector<double>> numbers(std::string_view key, std::initializer_list<std::size_t> counts,
                                               const Range& range = kAnyNumber);
    std::optional<Vec3> vec3(std::string_view key, const Range& range = kAnyNumber);
    /// A unit vector from one of any length but 0.
    std::optional<Vec3> direction(std::string_view key);
    std::optional<std::array<double, 2>> pair(std::string_view key, const Range& range = kAnyNumber);
    /// One number for the three bands, or [r, g, b].
    std::optional<Rgb> rgb(std::string_view key, const Range& range);
    /// [w, x, y, z]; made exactly unit when | |q| - 1 | < 1e-3, else a problem.
    std::optional<Quat> attitude(std::string_view key);
    /// [width, height], each in [1, high].
    std::optional<std::array<int, 2>> size(std::string_view key, int high);
    /// One of a few words.
    template <class T>
    std::optional<T> choice(std::string_view key, std::span<const std::pair<std::string_view, T>> words) {
        const std::optional<std::string> word = text(key);
        if (!word) return std::nullopt;
        std::string all;
        for (const auto& [name, value] : words) {
            if (name == *word) return value;
            all += (all.empty() ? "\"" : ", \"") + std::string(name) + "\"";
        }
        fail(key, "\"" + *word + "\" is not known here, expected one of " + all);
        return std::nullopt;
    }
    std::optional<TableReader> table(std::string_view key);
    /// The tables of `[[key]]`, in the file's order.
    std::vector<TableReader> tables(std::string_view key);

    /// The node of a key, counted as read; null when absent.
    const toml::node* find(std::string_view key);
    /// A known key that is not allowed here; `why` completes "KEY: ...". No effect where it is absent.
    void refuse(std::string_view key, const std::string& why);
    /// Refuses the keys that belong to other kinds only: each kind of table has its own.
    void refuse_keys_of_other_kinds(std::string_view kind, std::span<const KindKeys> kinds);
    /// Notes a problem at the value of a key (at the table when absent).
    void fail(std::string_view key, const std::string& what);
    [[nodiscard]] const toml::source_region& place(std::string_view key) const;
    /// Every key that was not read is a problem. Call it last.
    void finish();

private:
    /// The result of `take` for the key's node; notes a problem if it is empty.
    template <class Take>
    auto value(std::string_view key, const Take& take, const std::string& expected)
        -> decltype(take(std::declval<const toml::node&>()));

    const toml::table* table_;
    std::string name_;
    Problems* problems_;
    std::vector<std::string> asked_;
};

}  // namespace narpa
