#include "renderer/keys/toml_reader.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <tuple>

#include "renderer/keys/other_names.h"

namespace narpa {

namespace {

std::string_view type_words(const toml::node& node) {
    switch (node.type()) {
        case toml::node_type::table: return "a table";
        case toml::node_type::array: return "an array";
        case toml::node_type::string: return "a text";
        case toml::node_type::integer: return "an integer";
        case toml::node_type::floating_point: return "a number";
        case toml::node_type::boolean: return "a boolean";
        case toml::node_type::date:
        case toml::node_type::time:
        case toml::node_type::date_time: return "a date or time";
        case toml::node_type::none: break;
    }
    return "nothing";
}

std::optional<double> as_number(const toml::node& node) {
    if (const auto* f = node.as_floating_point()) return f->get();
    if (const auto* i = node.as_integer()) return static_cast<double>(i->get());
    return std::nullopt;
}

/// An integer in the base of the one in the file.
std::string in_base_of(const toml::value<std::int64_t>& typed, std::int64_t i) {
    using Flags = toml::value_flags;
    const auto has = [&](Flags base) { return (typed.flags() & base) == base; };
    if (i < 0) return fmt::format("{}", i);
    if (has(Flags::format_as_hexadecimal)) return fmt::format("0x{:x}", i);
    if (has(Flags::format_as_octal)) return fmt::format("0o{:o}", i);
    if (has(Flags::format_as_binary)) return fmt::format("0b{:b}", i);
    return fmt::format("{}", i);
}

std::string shown(const toml::node& node) {
    if (const auto* i = node.as_integer()) return in_base_of(*i, i->get());
    if (const auto* f = node.as_floating_point()) return fmt::format("{}", f->get());
    return std::string(type_words(node));
}

FilePlace place_of(const toml::source_region& at) {
    return {at.path ? *at.path : std::string(), static_cast<int>(at.begin.line), static_cast<int>(at.begin.column)};
}

/// A date and time, a date, or an ISO 8601 text with either, by the rules of TOML's own dates.
std::optional<toml::date_time> date_of(const toml::node& node) {
    if (const auto* t = node.as_date_time()) return t->get();
    if (const auto* d = node.as_date()) return toml::date_time(d->get(), toml::time{});
    const auto* s = node.as_string();
    if (!s || s->get().size() > 40 || s->get().find_first_not_of("0123456789-+:.TtZz ") != std::string::npos)
        return std::nullopt;
    try {
        const toml::table table = toml::parse(std::string_view("t = " + s->get()), std::string_view());
        const toml::node* const t = table.get("t");
        return t->is_string() ? std::nullopt : date_of(*t);
    } catch (const toml::parse_error&) {
        return std::nullopt;
    }
}

std::int64_t unix_ns_from(const toml::date_time& t) {
    using namespace std::chrono;
    const sys_days day = year(t.date.year) / month(t.date.month) / std::chrono::day(t.date.day);
    const std::int64_t seconds = duration_cast<std::chrono::seconds>(day.time_since_epoch()).count() +
                                 3600 * t.time.hour + 60 * t.time.minute + t.time.second -
                                 (t.offset ? 60 * t.offset->minutes : 0);
    return seconds * 1'000'000'000 + t.time.nanosecond;
}

}  // namespace

void Problems::add(const FilePlace& at, std::string what) {
    add(at, Error{std::move(what), at.file.empty() ? file_ : at.file, at.line, at.column});
}

void Problems::add(const FilePlace& at, Error error) {
    problems_.push_back({false, at.line, at.column, std::move(error)});
}

void Problems::add_missing(const FilePlace& at, std::string what) {
    add(at, std::move(what));
    problems_.back().is_missing_key = true;
}

Error Problems::first() const {
    const auto order = [](const Problem& p) { return std::tuple(p.is_missing_key, p.line, p.column); };
    return std::ranges::min_element(problems_, {}, order)->error;
}

TableReader::TableReader(const toml::table& table, std::string name, Problems& problems, const TableKeys* keys)
    : table_(&table), name_(std::move(name)), problems_(&problems), keys_(keys) {
    if (keys_)
        for (const TableKey* key : keys_->all_rows())
            if (!key->required.empty()) require(key->name, key->required);
}

const toml::node* TableReader::find(std::string_view key) {
    if (std::find(asked_.begin(), asked_.end(), key) == asked_.end()) asked_.emplace_back(key);
    return table_->get(key);
}

const KeyValue& TableReader::row(std::string_view key, [[maybe_unused]] KeyValue::Type type) const {
    static constexpr KeyValue kNone{};
    const TableKey* found = keys_ ? keys_->find(key, kind_) : nullptr;
    if (keys_ && !found) found = keys_->find(key);  // refused, as it belongs to other kinds
    if (!found) {
        assert(!keys_ && "a key that is read has a row");
        return kNone;
    }
    using enum KeyValue::Type;
    assert(found->value.type == type || (type == text && (found->value.or_file || found->value.type == choice)));
    return found->value;
}

FilePlace TableReader::place(std::string_view key) const {
    const toml::node* node = table_->get(key);
    return place_of(node ? node->source() : table_->source());
}

void TableReader::fail(std::string_view key, const std::string& what) {
    problems_->add(place(key), fmt::format("{}: {}", key, what));
}

void TableReader::require(std::string_view key, std::string_view expected) {
    if (!has(key))
        problems_->add_missing(place_of(table_->source()),
                               fmt::format("{} has no \"{}\", expected {}", name_, key, expected));
}

std::optional<std::size_t> TableReader::kind() {
    assert(keys_ && keys_->kinds);
    const std::vector<TableKind> kinds = keys_->kinds();
    const auto rows = keys_->all_rows();
    const auto at = std::ranges::find(rows, KeyValue::Type::kind, [](const TableKey* k) { return k->value.type; });
    assert(at != rows.end());
    const TableKey& key = **at;
    const auto index = [&](std::string_view name) {
        return static_cast<std::size_t>(std::ranges::find(kinds, name, &TableKind::name) - kinds.begin());
    };
    if (!has(key.name)) {
        if (key.value.otherwise.empty()) return std::nullopt;
        kind_ = static_cast<int>(index(key.value.otherwise));
    } else {
        std::vector<std::string_view> names;
        for (const TableKind& k : kinds) names.push_back(k.name);
        const auto given = word(key.name, names);
        if (!given) return std::nullopt;
        kind_ = static_cast<int>(*given);
    }
    const TableKind& own = kinds[static_cast<std::size_t>(kind_)];
    for (const auto& [node_key, value] : *table_) {
        if (keys_->find(node_key.str(), kind_)) continue;
        const TableKey* const others = keys_->find(node_key.str());
        if (!others) continue;
        std::string why(others->refusal), owners;
        for (const TableKind& k : kinds)
            if (std::ranges::find(k.rows, node_key.str(), &TableKey::name) != k.rows.end())
                owners += fmt::format("{}\"{}\"", owners.empty() ? "" : " or ", k.name);
        if (why.empty()) why = fmt::format("belongs to {} = {}, and this is \"{}\"", key.name, owners, own.name);
        refuse(node_key.str(), why);
    }
    for (const TableKey& k : own.rows)
        if (!k.required.empty()) require(k.name, k.required);
    return kind_;
}

template <class Take>
auto TableReader::value(std::string_view key, const Take& take, const std::string& expected)
    -> decltype(take(std::declval<const toml::node&>())) {
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    auto taken = take(*node);
    if (!taken) fail(key, fmt::format("got {}, expected {}", shown(*node), expected));
    return taken;
}

std::optional<double> TableReader::number(std::string_view key) {
    return number(key, row(key, KeyValue::Type::number).range);
}

std::optional<double> TableReader::number(std::string_view key, const Range& range) {
    const auto take = [&](const toml::node& node) {
        const std::optional<double> x = as_number(node);
        return x && range.holds(*x) ? x : std::nullopt;
    };
    return value(key, take, range.words());
}

std::optional<std::int64_t> TableReader::integer(std::string_view key) {
    const KeyValue& own = row(key, KeyValue::Type::integer);
    return integer(key, own.low, own.high);
}

std::optional<std::int64_t> TableReader::integer(std::string_view key, std::int64_t low, std::int64_t high) {
    const auto take = [&](const toml::node& node) {
        const auto* i = node.as_integer();
        return i && i->get() >= low && i->get() <= high ? std::optional(i->get()) : std::nullopt;
    };
    const toml::node* const node = find(key);
    const auto* const typed = node ? node->as_integer() : nullptr;
    const auto words = [&](std::int64_t i) { return typed ? in_base_of(*typed, i) : fmt::format("{}", i); };
    return value(key, take, fmt::format("an integer in [{}, {}]", words(low), words(high)));
}

std::optional<bool> TableReader::boolean(std::string_view key) {
    (void)row(key, KeyValue::Type::boolean);
    return value(
        key, [](const toml::node& node) { return node.value_exact<bool>(); }, "true or false");
}

std::optional<std::string> TableReader::text(std::string_view key) {
    (void)row(key, KeyValue::Type::text);
    return value(
        key, [](const toml::node& node) { return node.value_exact<std::string>(); }, "a text in quotes");
}

std::optional<std::vector<std::string>> TableReader::texts(std::string_view key) {
    (void)row(key, KeyValue::Type::texts);
    const auto take = [](const toml::node& node) -> std::optional<std::vector<std::string>> {
        const toml::array* array = node.as_array();
        if (!array || !(array->empty() || array->is_homogeneous(toml::node_type::string))) return std::nullopt;
        std::vector<std::string> out;
        for (const toml::node& element : *array) out.push_back(element.as_string()->get());
        return out;
    };
    return value(key, take, "an array of texts in quotes");
}

std::optional<std::vector<double>> TableReader::numbers(std::string_view key, const KeyValue& expected) {
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    const toml::array* array = node->as_array();
    if (!array || !expected.allows(array->size())) {
        const std::string got = array ? fmt::format("an array of {}", array->size()) : shown(*node);
        const auto end = std::ranges::find(expected.counts, 0);
        const std::string counts = end == expected.counts.begin()
                                       ? fmt::format("{} to {}", expected.count_min, expected.count_max)
                                       : fmt::format("{}", fmt::join(expected.counts.begin(), end, ", "));
        fail(key, fmt::format("got {}, expected an array of {} numbers", got, counts));
        return std::nullopt;
    }
    std::vector<double> out;
    for (const toml::node& element : *array) {
        const std::optional<double> x = as_number(element);
        if (!x || !expected.range.holds(*x)) {
            problems_->add(place_of(element.source()), fmt::format("{}[{}]: got {}, expected {}", key, out.size(),
                                                                   shown(element), expected.range.words()));
            return std::nullopt;
        }
        out.push_back(*x);
    }
    return out;
}

std::optional<std::vector<double>> TableReader::numbers(std::string_view key) {
    return numbers(key, row(key, KeyValue::Type::numbers));
}

std::vector<double> TableReader::values(std::span<const TableKey> keys, double otherwise) {
    std::vector<double> all;
    for (const TableKey& key : keys) {
        if (key.value.type == KeyValue::Type::numbers) {
            const auto count = static_cast<std::size_t>(key.value.counts[0]);
            const auto array = numbers(key.name).value_or(std::vector<double>(count, otherwise));
            all.insert(all.end(), array.begin(), array.end());
        } else {
            all.push_back(number(key.name).value_or(otherwise));
        }
    }
    return all;
}

std::optional<Vec3> TableReader::vec3(std::string_view key) {
    return vec3(key, row(key, KeyValue::Type::numbers).range);
}

std::optional<Vec3> TableReader::vec3(std::string_view key, const Range& range) {
    const auto v = numbers(key, rows::vec3(range));
    if (!v) return std::nullopt;
    return Vec3{(*v)[0], (*v)[1], (*v)[2]};
}

Vec3 scaled_to_one(const Vec3& a) {
    const double largest = std::fmax(std::fmax(std::abs(a.x), std::abs(a.y)), std::abs(a.z));
    if (!(largest > 0)) return a;
    const int e = -std::ilogb(largest);
    return {std::scalbn(a.x, e), std::scalbn(a.y, e), std::scalbn(a.z, e)};
}

std::optional<Vec3> TableReader::direction(std::string_view key) {
    const auto v = vec3(key, row(key, KeyValue::Type::direction).range);
    if (!v) return std::nullopt;
    if (*v == Vec3{}) return fail(key, "expected a direction, of any length but 0"), std::nullopt;
    return normalized(scaled_to_one(*v));
}

std::optional<std::array<double, 2>> TableReader::pair(std::string_view key) {
    return pair(key, row(key, KeyValue::Type::numbers).range);
}

std::optional<std::array<double, 2>> TableReader::pair(std::string_view key, const Range& range) {
    const auto v = numbers(key, rows::pair(range));
    if (!v) return std::nullopt;
    return std::array{(*v)[0], (*v)[1]};
}

std::optional<Rgb> TableReader::rgb(std::string_view key) {
    const Range& range = row(key, KeyValue::Type::rgb).range;
    const toml::node* node = find(key);
    if (node && node->is_array()) {
        const auto v = vec3(key, range);
        return v ? std::optional(vec_cast<float>(*v)) : std::nullopt;
    }
    if (const auto x = number(key, range)) {
        const auto grey = static_cast<float>(*x);
        return Rgb{grey, grey, grey};
    }
    return std::nullopt;
}

std::optional<Quat> TableReader::attitude(std::string_view key) {
    (void)row(key, KeyValue::Type::attitude);
    const auto v = numbers(key, rows::numbers({4}));
    if (!v) return std::nullopt;
    const Quat q{(*v)[0], (*v)[1], (*v)[2], (*v)[3]};
    if (const double n = norm(q); !(std::abs(n - 1.0) < 1e-3)) {
        fail(key,
             fmt::format("the quaternion's norm is {:.6g}, expected 1 (within 0.001), in the order w, x, y, z", n));
        return std::nullopt;
    }
    return normalized(q);
}

std::optional<std::array<int, 2>> TableReader::size(std::string_view key) {
    const std::int64_t high = row(key, KeyValue::Type::size).high;
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    const toml::array* array = node->as_array();
    if (array && array->size() == 2) {
        const auto* w = array->get(0)->as_integer();
        const auto* h = array->get(1)->as_integer();
        const auto good = [high](const auto* i) { return i && i->get() >= 1 && i->get() <= high; };
        if (good(w) && good(h)) return std::array{static_cast<int>(w->get()), static_cast<int>(h->get())};
    }
    fail(key, fmt::format("expected [width, height] in pixels, two integers in [1, {}]", high));
    return std::nullopt;
}

std::optional<std::vector<Vec3>> TableReader::points(std::string_view key) {
    const int count_max = row(key, KeyValue::Type::points).count_max;
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    std::vector<Vec3> all;
    const toml::array* points = node->as_array();
    bool good = points && !points->empty() && points->size() <= static_cast<std::size_t>(count_max);
    for (std::size_t i = 0; good && i < points->size(); ++i) {
        const toml::array* p = points->get(i)->as_array();
        good = p && p->size() == 3;
        Vec3 point;
        for (std::size_t k = 0; good && k < 3; ++k)
            point[static_cast<int>(k)] = as_number(*p->get(k)).value_or(std::numeric_limits<double>::quiet_NaN());
        good = good && norm(point) < 1e15;
        all.push_back(point);
    }
    if (good) return all;
    fail(key, fmt::format("expected [[x, y, z], ...], 1 to {} points in metres in the body's frame", count_max));
    return std::nullopt;
}

std::optional<std::int64_t> TableReader::date(std::string_view key) {
    constexpr int kFirstYear = 1900, kLastYear = 2099;  // of ERFA's Earth ephemeris and of int64 nanoseconds
    (void)row(key, KeyValue::Type::date);
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    const std::optional<toml::date_time> t = date_of(*node);
    if (t && t->date.year >= kFirstYear && t->date.year <= kLastYear) return unix_ns_from(*t);
    fail(key, fmt::format("expected a UTC date and time of the years {} to {}, as 2026-03-01T12:00:00Z", kFirstYear,
                          kLastYear));
    return std::nullopt;
}

std::optional<std::size_t> TableReader::word(std::string_view key) {
    return word(key, row(key, KeyValue::Type::choice).words());
}

std::optional<std::size_t> TableReader::word(std::string_view key, const std::vector<std::string_view>& words) {
    const auto take = [](const toml::node& node) { return node.value_exact<std::string>(); };
    const std::optional<std::string> given = value(key, take, "a text in quotes");
    if (!given) return std::nullopt;
    if (const auto at = std::ranges::find(words, *given); at != words.end())
        return static_cast<std::size_t>(at - words.begin());
    fail(key, fmt::format("\"{}\" is not known here, expected one of \"{}\"{}", *given, fmt::join(words, "\", \""),
                          word_meant(*given, words)));
    return std::nullopt;
}

bool TableReader::is_text(std::string_view key) {
    const toml::node* node = find(key);
    return node && node->is_string();
}

bool TableReader::is_table(std::string_view key) {
    const toml::node* node = find(key);
    return node && node->is_table();
}

std::optional<TableReader> TableReader::table(std::string_view key) {
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    if (const toml::table* t = node->as_table())
        return TableReader(*t, t->is_inline() ? std::string(key) : fmt::format("[{}]", key), *problems_,
                           row(key, KeyValue::Type::table).keys);
    fail(key, fmt::format("got {}, expected a table", shown(*node)));
    return std::nullopt;
}

std::vector<TableReader> TableReader::tables(std::string_view key) {
    const toml::node* node = find(key);
    if (!node) return {};
    const toml::array* array = node->as_array();
    if (!array || !array->is_homogeneous(toml::node_type::table)) {
        fail(key, fmt::format("expected an array of tables, each headed [[{}]]", key));
        return {};
    }
    std::vector<TableReader> out;
    const TableKeys* const keys = row(key, KeyValue::Type::tables).keys;
    for (const toml::node& element : *array)
        out.emplace_back(*element.as_table(), fmt::format("[[{}]]", key), *problems_, keys);
    return out;
}

void TableReader::refuse(std::string_view key, const std::string& why) {
    if (table_->get(key) == nullptr) return;  // it is not suggested for misspelt keys
    find(key);
    fail(key, why);
}

void TableReader::finish() {
    std::vector<std::string> known = asked_;
    if (keys_) {
        for (const TableKey* key : keys_->all_rows()) known.emplace_back(key->name);
        for (const TableKind& kind : keys_->kinds ? keys_->kinds() : std::vector<TableKind>{})
            for (const TableKey& key : kind.rows) known.emplace_back(key.name);
    }
    for (const auto& [key, value] : *table_)
        if (std::ranges::find(known, key.str()) == known.end())
            problems_->add(place_of(key.source()), fmt::format("unknown key \"{}\" in {}{}", key.str(), name_,
                                                               key_meant(key.str(), known)));
}

}  // namespace narpa
