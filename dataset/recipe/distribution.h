/// dataset/recipe/distribution.h - random numbers that a recipe describes, as {kind = "uniform", between = [2, 8]}.
///
/// A new kind is a row in distribution.cpp.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "renderer/keys/keys.h"

namespace narpa {
class TableReader;
}

namespace narpa::dataset {

struct Distribution;

struct DistributionKind {
    std::string_view name;
    std::span<const TableKey> keys;                 ///< one key, an array of numbers: Distribution::values
    double (*at)(const Distribution& d, double u);  ///< quantile function, 0 <= u < 1
};

/// All kinds, in the order of the documents.
[[nodiscard]] std::span<const DistributionKind* const> distribution_kinds();

struct Distribution {
    const DistributionKind* kind = nullptr;  ///< never null
    std::vector<double> values{};            ///< lowest and highest number; of a choice: all numbers

    /// The number at the quantile u, 0 <= u < 1: of the distribution if u is uniform.
    [[nodiscard]] double at(double u) const { return kind->at(*this, u); }
};
[[nodiscard]] Distribution uniform_between(double low, double high);
/// 0 < low <= high.
[[nodiscard]] Distribution log_uniform_between(double low, double high);

extern const TableKeys kDistributionKeys;
/// The distribution in the table `key`; nullopt if it is absent or wrong. Its numbers must lie in `allowed`.
[[nodiscard]] std::optional<Distribution> read_distribution(TableReader& table, std::string_view key,
                                                            const Range& allowed);

}  // namespace narpa::dataset
