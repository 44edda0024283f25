#include "renderer/keys/keys.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace narpa {

bool Range::holds(double x) const {
    if (infinite && x == std::numeric_limits<double>::infinity()) return true;
    return std::isfinite(x) && (low_open ? x > low : x >= low) && (high_open ? x < high : x <= high);
}

std::string Range::words() const {
    const bool has_low = std::isfinite(low), has_high = std::isfinite(high);
    if (has_low && has_high)
        return fmt::format("a number in {}{}, {}{}", low_open ? '(' : '[', low, high, high_open ? ')' : ']');
    if (has_low) return fmt::format("a number {} {}{}", low_open ? ">" : ">=", low, infinite ? ", or inf" : "");
    if (has_high) return fmt::format("a number {} {}", high_open ? "<" : "<=", high);
    return "a finite number";
}

bool KeyValue::allows(std::size_t count) const {
    if (counts[0] == 0)
        return count >= static_cast<std::size_t>(count_min) && count <= static_cast<std::size_t>(count_max);
    return count > 0 && std::ranges::find(counts, static_cast<int>(count)) != counts.end();
}

const TableKey* TableKeys::find(std::string_view name, int kind) const {
    if (const auto row = std::ranges::find(rows, name, &TableKey::name); row != rows.end()) return &*row;
    for (const TableKeys* part : parts)
        if (const TableKey* row = part ? part->find(name) : nullptr) return row;
    if (listed)
        for (const std::span<const TableKey> keys : listed())
            if (const auto row = std::ranges::find(keys, name, &TableKey::name); row != keys.end()) return &*row;
    const std::vector<TableKind> all = kinds ? kinds() : std::vector<TableKind>{};
    for (std::size_t k = 0; k < all.size(); ++k)
        if (kind < 0 || kind == static_cast<int>(k))
            if (const auto row = std::ranges::find(all[k].rows, name, &TableKey::name); row != all[k].rows.end())
                return &*row;
    return nullptr;
}

std::vector<const TableKey*> TableKeys::all_rows() const {
    std::vector<const TableKey*> all;
    for (const TableKey& row : rows) all.push_back(&row);
    for (const TableKeys* part : parts)
        if (part) std::ranges::copy(part->all_rows(), std::back_inserter(all));
    if (listed)
        for (const std::span<const TableKey> keys : listed())
            for (const TableKey& row : keys) all.push_back(&row);
    return all;
}

}  // namespace narpa
