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

bool Value::allows(std::size_t count) const {
    if (counts[0] == 0)
        return count >= static_cast<std::size_t>(count_min) && count <= static_cast<std::size_t>(count_max);
    return count > 0 && std::ranges::find(counts, static_cast<int>(count)) != counts.end();
}

const Key* Keys::find(std::string_view name, int kind) const {
    if (const auto row = std::ranges::find(rows, name, &Key::name); row != rows.end()) return &*row;
    for (const Keys* part : parts)
        if (const Key* row = part ? part->find(name) : nullptr) return row;
    const std::vector<Kind> all = kinds ? kinds() : std::vector<Kind>{};
    for (std::size_t k = 0; k < all.size(); ++k)
        if (kind < 0 || kind == static_cast<int>(k))
            if (const auto row = std::ranges::find(all[k].rows, name, &Key::name); row != all[k].rows.end())
                return &*row;
    return nullptr;
}

std::vector<const Key*> Keys::all_rows() const {
    std::vector<const Key*> all;
    for (const Key& row : rows) all.push_back(&row);
    for (const Keys* part : parts)
        if (part) std::ranges::copy(part->all_rows(), std::back_inserter(all));
    return all;
}

}  // namespace narpa
