/// renderer/assets/meshes/mesh_builder.h - from triangles as a file gives them to a Mesh.
#pragma once

#include "renderer/assets/meshes/mesh_file.h"
#include "renderer/assets/meshes/mesh_readers.h"

namespace narpa {

/// Their corners are numbered with 32 bits.
inline constexpr std::size_t kMostTriangles = 0xffff'ffffu / 3;

/// Drops bad triangles of a soup, as read_mesh says, and welds its vertices: those that are equal in position,
/// normal, texture coordinates and colour become one, numbered in the order in which the triangles first name them.
/// `reach_m` gets the largest coordinate of a triangle, either way, in metres. Runs on all cores; the result does
/// not depend on their number. The soup has at most kMostTriangles.
[[nodiscard]] MeshFile build_mesh(TriangleSoup&& soup, double scale, float& reach_m);

}  // namespace narpa
