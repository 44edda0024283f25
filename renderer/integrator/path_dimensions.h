/// renderer/integrator/path_dimensions.h - dimensions of the sample sequence (sampler.h) that a path uses.
///
/// In groups of four. Group 0 belongs to the camera; then come two groups for each vertex of the longest path, the
/// roulette's (four vertices per group), and those that few scenes need.
#pragma once

#include <cstddef>
#include <cstdint>

namespace narpa {

inline constexpr std::uint32_t kMaxVertices = 40;

/// 0, 1: direction; 2: lobe of the BSDF; 3: BSDF or small body.
constexpr std::uint32_t direction_group(int vertex) noexcept {
    return static_cast<std::uint32_t>(1 + 2 * vertex);
}
/// 0, 1: point of an emitter; 2: which emitter; 2, 3: point of the Sun.
constexpr std::uint32_t light_group(int vertex) noexcept {
    return static_cast<std::uint32_t>(2 + 2 * vertex);
}
inline constexpr std::uint32_t kFirstRoulette = 1 + 2 * kMaxVertices;
constexpr std::uint32_t roulette_group(int vertex) noexcept {
    return kFirstRoulette + static_cast<std::uint32_t>(vertex) / 4;
}
constexpr std::size_t roulette_dimension(int vertex) noexcept {
    return static_cast<std::size_t>(vertex % 4);
}
/// 0: choice of the second vertices that are connected.
inline constexpr std::uint32_t kReuseDimensions = kFirstRoulette + kMaxVertices / 4 + 1;
/// 0: the medium along the ray to the vertex.
constexpr std::uint32_t medium_group(int vertex) noexcept {
    return kReuseDimensions + 1 + 2 * static_cast<std::uint32_t>(vertex);
}
/// 0, 1: direction to the background.
constexpr std::uint32_t background_group(int vertex) noexcept {
    return medium_group(vertex) + 1;
}
/// 0: time of the camera's ray within the exposure of its row.
inline constexpr std::uint32_t kTimeGroup = medium_group(kMaxVertices);

}  // namespace narpa
