/// base/text/nearest_name.h - suggests the known name nearest to a misspelt one.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace narpa {

/// Levenshtein distance.
[[nodiscard]] inline std::size_t edit_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0});
    for (std::size_t i = 0; i < a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i + 1;
        for (std::size_t j = 0; j < b.size(); ++j) {
            const std::size_t replace = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = std::min({replace, row[j] + 1, diagonal + 1});
        }
    }
    return row.back();
}

/// The nearest of `known`, at an edit distance of at most 2; else one of which `name` is a prefix, as
/// "fov_horizontal" of "fov_horizontal_deg", or that is a prefix of `name`. A plural in "ies" matches its singular.
/// Empty: none is near.
[[nodiscard]] inline std::optional<std::string> nearest_name(std::string_view name,
                                                             const std::vector<std::string>& known) {
    constexpr std::size_t kFarthest = 2;
    if (name.ends_with("ies"))
        for (const std::string& k : known)
            if (k == std::string(name.substr(0, name.size() - 3)) + "y") return k;
    constexpr std::size_t kBeginning = 4;  ///< fewer letters in common match by chance
    std::optional<std::string> nearest;
    if (name.size() >= kBeginning)
        for (const std::string& k : known)
            if (k.starts_with(name) || (k.size() >= kBeginning && name.starts_with(k))) nearest = k;
    std::size_t best = std::min(kFarthest + 1, name.size());
    for (const std::string& k : known)
        if (const std::size_t d = edit_distance(name, k); d < best) best = d, nearest = k;
    return nearest;
}

/// "; did you mean "sun"?", or nothing.
[[nodiscard]] inline std::string did_you_mean(std::string_view name, const std::vector<std::string>& known) {
    const auto nearest = nearest_name(name, known);
    return nearest ? "; did you mean \"" + *nearest + "\"?" : std::string();
}

}  // namespace narpa
