/// renderer/scene/triangulate.h - a plane polygon -> triangles.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/vec3.h"

namespace narpa {

/// Polygons of more corners are refused by the readers: the work is cubic in the worst case.
inline constexpr std::size_t kMostCorners = 1024;

/// Cuts a simple polygon, convex or not, into corners.size() - 2 triangles of the same winding, as indices into
/// `corners`. A convex one becomes a fan about its first corner; others lose one ear after the
/// other. One that
/// crosses itself, or has no area, still gives triangles. At most cubic in the number of corners.
std::vector<std::array<std::uint32_t, 3>> triangulate(std::span<const Vec3> corners);

}  // namespace narpa
