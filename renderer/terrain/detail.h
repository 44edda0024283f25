/// renderer/terrain/detail.h - craters and rocks between the posts of a DEM, of published sizes and numbers.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/terrain/height_source.h"

namespace narpa {

/// Craters: the cumulative number above diameter D is `craters` * D^-2 per square metre (D in metres); 0.079 is the
/// equilibrium of small lunar craters (N. Trask, JPL TR 32-800, 1966). Depth 0.196 D and rim 0.036 D (R. Pike, in
/// Impact and Explosion Cratering, 1977) when fresh, and down to nothing when old, evenly.
/// Rocks: the cumulative share of the area below rocks above diameter D is k exp(-q D), q = 1.79 + 0.152 / k, k the
/// share of all (M. Golombek, D. Rapp, JGR 102, 1997). Half spheroids, half as high as wide.
struct TerrainDetail {
    int posts_per_post = 1;  ///< of the finer grid, along each axis; 1: none
    double craters = 0;      ///< per square metre at 1 m
    double rocks = 0;        ///< k, share of the area
    std::uint64_t seed = 0;
};

/// Metres between posts, along the rows and along the columns.
struct PostSpacing {
    double x_m = 0, y_m = 0;
};

/// A DEM on a grid that is finer by a whole number: smooth between its posts, with the features of TerrainDetail
/// whose diameters are between two posts of the finer grid and two of the coarser, along the wider spacing.
class DetailedSource final : public HeightSource {
public:
    /// `spacing`: of `coarse`, which must outlive this and, where there are features, not go around a planet.
    DetailedSource(HeightSource& coarse, const PostSpacing& spacing, const TerrainDetail& detail);

    [[nodiscard]] int columns() const override;
    [[nodiscard]] int rows() const override;
    [[nodiscard]] bool goes_around() const override { return coarse_.goes_around(); }
    [[nodiscard]] bool read_rows(int row, int count, double* heights) override;

private:
    struct Sizes {
        double low_m, high_m;  ///< diameters
        double per_m2;
        bool rocks;
    };
    void add_features(const Sizes& sizes, std::uint64_t stream, int row, int count, double* heights) const;

    HeightSource& coarse_;
    PostSpacing spacing_;  ///< of the finer grid
    TerrainDetail detail_;
    std::vector<Sizes> sizes_;
    std::vector<double> coarse_rows_;
};

}  // namespace narpa
