/// renderer/assets/meshes/smooth_normals.h - normals for meshes that have none.
#pragma once

#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

/// Gives each corner the mean of the normals of those triangles about its position that are turned by less than
/// `crease_rad` against its own, weighted by their angles there (G. Thuermer, C. Wuethrich, Computing vertex
/// normals from polygonal facets, Journal of Graphics Tools 3(1), 1998). Positions are the same if their
/// coordinates are equal. Corners where more than kMaxSmoothed triangles meet stay flat, as do those of triangles
/// without area. For soups without normals.
void add_smooth_normals(TriangleSoup& soup, double crease_rad);
inline constexpr std::size_t kMaxSmoothed = 1024;

}  // namespace narpa
