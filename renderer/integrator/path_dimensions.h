/// renderer/integrator/path_dimensions.h - which dimensions of the sample sequence (sampler.h) a path takes for
/// what.
///
/// Groups of four. Group 0 belongs to the camera; then two for each vertex of the longest path, then the
/// roulette's, four vertices a group, then those that few scenes need.
#pragma once

#include <cstddef>
#include <cstdint>

namespace narpa {

inline constexpr std::uint32_t kMostVertices = 40;

/// 0, 1: direction; 2: lobe of the BSDF; 3: BSDF or small body.
constexpr std::uint32_t direction_group(int vertex) noexcept {
    return static_cast<std::uint32_t>(1 + 2 * vertex);
}
/// 0, 1: point of an emitter; 2: which emitter; 2, 3: point of the Sun.
constexpr std::uint32_t light_group(int vertex) noexcept {
    return static_cast<std::uint32_t>(2 + 2 * vertex);
}
inline constexpr std::uint32_t kFirstRoulette = 1 + 2 * kMostVertices;
constexpr std::uint32_t roulette_group(int vertex) noexcept {
    return kFirstRoulette + static_cast<std::uint32_t>(vertex) / 4;
}
constexpr std::size_t roulette_dimension(int vertex) noexcept {
    return static_cast<std::size_t>(vertex % 4);
}
/// 0: which second vertices are joined.
inline constexpr std::uint32_t kReuseDimensions = kFirstRoulette + kMostVertices / 4 + 1;
/// 0: the medium along the ray to the vertex.
constexpr std::uint32_t medium_group(int vertex) noexcept {
    return kReuseDimensions + 1 + 2 * static_cast<std::uint32_t>(vertex);
}
/// 0, 1: direction to the background.
constexpr std::uint32_t background_group(int vertex) noexcept {
    return medium_group(vertex) + 1;
}
/// 0: time of the camera's ray within the exposure of its row.
inline constexpr std::uint32_t kTimeGroup = medium_group(kMostVertices);

}  // namespace narpa
