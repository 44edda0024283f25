#include "renderer/keys/toml_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

std::string shown(const toml::node& node) {
    if (const auto* i = node.as_integer()) return fmt::format("{}", i->get());
    if (const auto* f = node.as_floating_point()) return fmt::format("{}", f->get());
    return std::string(type_words(node));
}

}  // namespace

Error Problems::located(const toml::source_region& at, std::string what) const {
    return {.what = std::move(what),
            .file = at.path ? *at.path : file_,
            .line = static_cast<int>(at.begin.line),
            .column = static_cast<int>(at.begin.column)};
}

void Problems::add(const toml::source_region& at, std::string what) {
    add(at, located(at, std::move(what)));
}

void Problems::add(const toml::source_region& at, Error error) {
    problems_.push_back({false, at.begin, std::move(error)});
}

void Problems::add_missing(const toml::source_region& at, std::string what) {
    problems_.push_back({true, at.begin, located(at, std::move(what))});
}

Error Problems::first() const {
    const auto earlier = [](const Problem& a, const Problem& b) {
        return a.is_missing_key != b.is_missing_key ? b.is_missing_key : a.at < b.at;
    };
    return std::min_element(problems_.begin(), problems_.end(), earlier)->error;
}

const toml::node* TableReader::find(std::string_view key) {
    if (std::find(asked_.begin(), asked_.end(), key) == asked_.end()) asked_.emplace_back(key);
    return table_->get(key);
}

const toml::source_region& TableReader::place(std::string_view key) const {
    const toml::node* node = table_->get(key);
    return node ? node->source() : table_->source();
}

void TableReader::fail(std::string_view key, const std::string& what) {
    problems_->add(place(key), fmt::format("{}: {}", key, what));
}

void TableReader::require(std::string_view key, std::string_view expected) {
    if (!has(key))
        problems_->add_missing(table_->source(),
                               fmt::format("{} has no \"{}\", expected {}", name_, key, expected));
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

std::optional<double> TableReader::number(std::string_view key, const Range& range) {
    const auto take = [&](const toml::node& node) {
        const std::optional<double> x = as_number(node);
        return x && range.holds(*x) ? x : std::nullopt;
    };
    return value(key, take, range.words());
}

std::optional<std::int64_t> TableReader::integer(std::string_view key, std::int64_t low, std::int64_t high) {
    const auto take = [&](const toml::node& node) {
        const auto* i = node.as_integer();
        return i && i->get() >= low && i->get() <= high ? std::optional(i->get()) : std::nullopt;
    };
    return value(key, take, fmt::format("an integer in [{}, {}]", low, high));
}

std::optional<bool> TableReader::boolean(std::string_view key) {
    return value(
        key, [](const toml::node& node) { return node.value_exact<bool>(); }, "true or false");
}

std::optional<std::string> TableReader::text(std::string_view key) {
    return value(
        key, [](const toml::node& node) { return node.value_exact<std::string>(); }, "a text in quotes");
}

std::optional<std::vector<std::string>> TableReader::texts(std::string_view key) {
    const auto take = [](const toml::node& node) -> std::optional<std::vector<std::string>> {
        const toml::array* array = node.as_array();
        if (!array || !(array->empty() || array->is_homogeneous(toml::node_type::string))) return std::nullopt;
        std::vector<std::string> out;
        for (const toml::node& element : *array) out.push_back(element.as_string()->get());
        return out;
    };
    return value(key, take, "an array of texts in quotes");
}

std::optional<std::vector<double>> TableReader::numbers(std::string_view key,
                                                        std::initializer_list<std::size_t> counts,
                                                        const Range& range) {
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    const toml::array* array = node->as_array();
    if (!array || std::ranges::find(counts, array->size()) == counts.end()) {
        const std::string got = array ? fmt::format("an array of {}", array->size()) : shown(*node);
        fail(key, fmt::format("got {}, expected an array of {} numbers", got, fmt::join(counts, ", ")));
        return std::nullopt;
    }
    std::vector<double> out;
    for (const toml::node& element : *array) {
        const std::optional<double> x = as_number(element);
        if (!x || !range.holds(*x)) {
            problems_->add(element.source(), fmt::format("{}[{}]: got {}, expected {}", key, out.size(),
                                                         shown(element), range.words()));
            return std::nullopt;
        }
        out.push_back(*x);
    }
    return out;
}

std::optional<Vec3> TableReader::vec3(std::string_view key, const Range& range) {
    const auto v = numbers(key, {3}, range);
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
    const auto v = vec3(key);
    if (!v) return std::nullopt;
    if (*v == Vec3{}) return fail(key, "expected a direction, of any length but 0"), std::nullopt;
    return normalized(scaled_to_one(*v));
}

std::optional<std::array<double, 2>> TableReader::pair(std::string_view key, const Range& range) {
    const auto v = numbers(key, {2}, range);
    if (!v) return std::nullopt;
    return std::array{(*v)[0], (*v)[1]};
}

std::optional<Rgb> TableReader::rgb(std::string_view key, const Range& range) {
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
    const auto v = numbers(key, {4});
    if (!v) return std::nullopt;
    const Quat q{(*v)[0], (*v)[1], (*v)[2], (*v)[3]};
    if (const double n = norm(q); !(std::abs(n - 1.0) < 1e-3)) {
        fail(key,
             fmt::format("the quaternion's norm is {:.6g}, expected 1 (within 0.001), in the order w, x, y, z", n));
        return std::nullopt;
    }
    return normalized(q);
}

std::optional<std::array<int, 2>> TableReader::size(std::string_view key, int high) {
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

std::optional<TableReader> TableReader::table(std::string_view key) {
    const toml::node* node = find(key);
    if (!node) return std::nullopt;
    if (const toml::table* t = node->as_table())
        return TableReader(*t, t->is_inline() ? std::string(key) : fmt::format("[{}]", key), *problems_);
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
    for (const toml::node& element : *array)
        out.emplace_back(*element.as_table(), fmt::format("[[{}]]", key), *problems_);
    return out;
}

void TableReader::refuse(std::string_view key, const std::string& why) {
    if (table_->get(key) == nullptr) return;  // it is not suggested for misspelt keys
    find(key);
    fail(key, why);
}

void TableReader::refuse_keys_of_other_kinds(std::string_view kind, std::span<const KindKeys> kinds) {
    const auto has_key = [](const KindKeys& k, std::string_view key) {
        return std::find(k.keys.begin(), k.keys.end(), key) != k.keys.end();
    };
    for (const auto& [node_key, value] : *table_) {
        const std::string_view key = node_key.str();
        std::string owners;
        bool is_own = false;
        for (const KindKeys& k : kinds)
            if (has_key(k, key)) {
                owners += fmt::format("{}\"{}\"", owners.empty() ? "" : " or ", k.kind);
                is_own |= k.kind == kind;
            }
        if (!owners.empty() && !is_own)
            refuse(key, fmt::format("belongs to kind = {}, and this is \"{}\"", owners, kind));
    }
}

void TableReader::finish() {
    for (const auto& [key, value] : *table_)
        if (std::find(asked_.begin(), asked_.end(), key.str()) == asked_.end())
            problems_->add(key.source(), fmt::format("unknown key \"{}\" in {}{}", key.str(), name_,
                                                     key_meant(key.str(), asked_)));
}

}  // namespace narpa
