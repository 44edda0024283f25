/// renderer/terrain/detail.h - craters and rocks between the posts of a DEM, of published sizes and numbers.
#pragma once

#include <cstdint>
#include <vector>

#include "renderer/terrain/height_source.h"

namespace narpa {

/// Craters: the cumulative number above diameter D is `craters` * D^-2 per square metre (D in metres); 0.079 is the
/// equilibrium of small lunar craters (N. Trask, JPL TR 32-800, 1966). Depth 0.196 D and rim 0.036 D (R. Pike, in
/// Impact and Explosion Cratering, 1977) when fresh; scaled by a freshness that is uniform from 0 to 1. Rocks: the
/// cumulative share of the area below rocks above diameter D is k exp(-q D), q = 1.79 + 0.152 / k, k the share of
/// all (M. Golombek, D. Rapp, JGR 102, 1997). Half spheroids, half as high as wide.
struct TerrainDetail {
    int refinement_factor = 1;  ///< refinement of the grid along each axis; 1: none
    double craters = 0;         ///< per square metre, above 1 m of diameter
    double rocks = 0;           ///< k, share of the area
    std::uint64_t seed = 0;
};

/// Metres between posts, along the rows and along the columns.
struct PostSpacing {
    double x_m = 0, y_m = 0;
};

/// A DEM interpolated smoothly to a grid that is finer by an integer factor, with those features of TerrainDetail
/// whose diameters are from two post spacings of the finer grid to two of the coarser one (the wider axis counts).
class DetailedSource final : public HeightSource {
public:
    /// `spacing`: that of `coarse`, which must outlive this. With features, `coarse` must not go around a planet.
    DetailedSource(HeightSource& coarse, const PostSpacing& spacing, const TerrainDetail& detail);

    [[nodiscard]] int columns() const override;
    [[nodiscard]] int rows() const override;
    [[nodiscard]] bool is_global() const override { return coarse_.is_global(); }
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
