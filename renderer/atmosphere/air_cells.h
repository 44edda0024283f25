/// renderer/atmosphere/air_cells.h - what air does to light along the rays from one point, in cells of directions,
/// kept for all that look through the same cell.
///
/// A hash table without locks: an entry's first word is its key mixed with all of its other words, so that one that
/// another thread is writing is not found (R. Hyatt, T. Mann, ICGA Journal 25, 2002). A cell's contents follow from
/// its key, so what is rendered does not depend on what is found.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "base/uninitialized_array.h"
#include "base/vec3.h"

namespace narpa {

/// What air does to light along a ray.
struct AirLight {
    Rgb transmittance{1, 1, 1};  ///< of the light that comes from its end
    Rgb in_scattering{};         ///< in the bands, for an irradiance of 1
};
static_assert(sizeof(AirLight) == 6 * sizeof(float));

/// Written before it is read.
struct AirCell {
    static constexpr std::size_t kLayer = 9;  ///< nodes of a layer: three by three, u running first
    static constexpr std::size_t kMostNodes = 2 * kLayer;
    /// Sides along which values differ from interpolated ones.
    static constexpr std::uint32_t kAlongU = 1, kAlongV = 2, kAlongHeight = 4;
    using Nodes = UninitializedArray<AirLight, kMostNodes>;
    std::uint32_t layers;
    std::uint32_t differs;  ///< not 0: the cell is to be halved, and has no nodes
    Nodes nodes;
};

class AirCells {
public:
    static constexpr std::size_t kEntries = 2048;  ///< 440 bytes each
    AirCells() : entries_(std::make_unique<Entry[]>(kEntries)) {}

    /// False: it is not there.
    [[nodiscard]] bool find(std::uint64_t key, AirCell& cell) const noexcept;
    void store(std::uint64_t key, const AirCell& cell) noexcept;

private:
    static constexpr std::size_t kWords = sizeof(AirLight) / sizeof(std::uint64_t);
    struct Entry {
        std::atomic<std::uint64_t> check{0}, head{0};  ///< head: layers and sides
        std::array<std::atomic<std::uint64_t>, AirCell::kMostNodes * kWords> words{};
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
