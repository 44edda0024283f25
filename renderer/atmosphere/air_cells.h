/// renderer/atmosphere/air_cells.h - cache of transmittance and in-scattering along the rays from one point, by
/// cell of ray directions.
///
/// A lock-free hash table: an entry's check word is a hash of its key and of all its other words, so an entry that
/// another thread is writing fails the check (R. Hyatt, T. Mann, ICGA Journal 25, 2002). A cell's contents are a
/// function of its key, so the image does not depend on which entries are found.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "base/uninitialized_array.h"
#include "base/vec3.h"

namespace narpa {

/// Effect of the air along a ray.
struct AirLight {
    Rgb transmittance{1, 1, 1};  ///< of light from the ray's end
    Rgb in_scattering{};         ///< in the bands, for an irradiance of 1
};
static_assert(sizeof(AirLight) == 6 * sizeof(float));

/// Not initialised: written before it is read.
struct AirCell {
    static constexpr std::size_t kLayer = 9;  ///< nodes of a layer: 3 x 3, u varies fastest
    static constexpr std::size_t kMaxNodes = 2 * kLayer;
    /// Axes along which interpolation between the nodes is not accurate enough.
    static constexpr std::uint32_t kAlongU = 1, kAlongV = 2, kAlongHeight = 4;
    using Nodes = UninitializedArray<AirLight, kMaxNodes>;
    std::uint32_t layers;
    std::uint32_t differs;  ///< axes to subdivide; where not 0, the nodes are not set
    Nodes nodes;
};

class AirCache {
public:
    static constexpr std::size_t kEntries = 2048;  ///< 440 bytes each
    AirCache() : entries_(std::make_unique<Entry[]>(kEntries)) {}

    /// False if there is no entry for the key.
    [[nodiscard]] bool find(std::uint64_t key, AirCell& cell) const noexcept;
    void store(std::uint64_t key, const AirCell& cell) noexcept;

private:
    static constexpr std::size_t kWords = sizeof(AirLight) / sizeof(std::uint64_t);
    struct Entry {
        std::atomic<std::uint64_t> check{0}, head{0};  ///< head: layers and differs
        std::array<std::atomic<std::uint64_t>, AirCell::kMaxNodes * kWords> words{};
    };
    std::unique_ptr<Entry[]> entries_;
};

/// Spreads a word over all bits of a hash (the finalizer of S. Vigna's splitmix64).
[[nodiscard]] constexpr std::uint64_t mixed(std::uint64_t hash, std::uint64_t word) noexcept {
    std::uint64_t z = (hash ^ word) + 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

}  // namespace narpa
