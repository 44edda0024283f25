/// renderer/material/ggx_table.h - the tables of ggx_albedo.h: written by make_ggx_table when narpa is built.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

namespace narpa::ggx_table {

/// A place between two nodes of an even axis.
struct Place {
    int node;
    double beyond;
};
inline Place place(double where, int nodes) {
    const double x = std::clamp(where, 0.0, 1.0) * (nodes - 1);
    const int node = std::min(static_cast<int>(x), nodes - 2);
    return {node, x - node};
}
inline double between(const float* values, const Place& at) {
    return static_cast<double>(values[at.node]) * (1 - at.beyond) +
           static_cast<double>(values[at.node + 1]) * at.beyond;
}

/// Values over roughness and the cosine mu. A roughness r in 0..1 lies on even steps; mu on even steps of
/// sqrt(mu (1 + a) / (mu + a)) with a = r^2, dense where masking sets in.
template <int kRows, int kColumns>
struct Table {
    std::array<float, kRows * kColumns> values;

    [[nodiscard]] double at(double roughness, double mu) const {
        const double alpha = roughness * roughness;
        const Place row = place(roughness, kRows),
                    column = place(std::sqrt(mu * (1 + alpha) / (mu + alpha)), kColumns);
        const float* const first = &values[static_cast<std::size_t>(row.node * kColumns)];
        return between(first, column) * (1 - row.beyond) + between(first + kColumns, column) * row.beyond;
    }
    [[nodiscard]] float& node(int row, int column) {
        return values[static_cast<std::size_t>(row * kColumns + column)];
    }
    /// Calls set(row, column, alpha, mu) for each node.
    template <class Set>
    static void for_each_node(Set&& set) {
        for (int i = 0; i < kRows; ++i)
            for (int j = 0; j < kColumns; ++j) {
                const double roughness = std::max(0.02, static_cast<double>(i) / (kRows - 1));
                const double alpha = roughness * roughness, root = static_cast<double>(j) / (kColumns - 1);
                const double mu = alpha * root * root / (1 + alpha - root * root);
                set(i, j, alpha, std::clamp(mu, 1e-6, 1.0));
            }
    }
};

/// An index n lies on even steps of sqrt((n - 1) / (n + 1)), n = 1..3; Schlick's form stands after the last.
inline constexpr int kIndices = 6, kRoughnessNodes = 32, kCosineRoughnessNodes = 16;

struct Tables {
    /// E, the albedo of the first bounce where every facet reflects all.
    Table<kRoughnessNodes, 32> albedo;
    std::array<float, kRoughnessNodes> mean_albedo;
    /// Cosine at which Fresnel's reflectance is the first bounce's mean, over (mu + alpha).
    std::array<Table<kCosineRoughnessNodes, 24>, kIndices + 1> cosine;
    /// The first bounce's hemispherical mean: over `mean_fresnel` for an index, of (1 - cosine)^5 for Schlick.
    std::array<std::array<float, kCosineRoughnessNodes>, kIndices + 1> mean_reflected;
};
extern const Tables kTables;

}  // namespace narpa::ggx_table
