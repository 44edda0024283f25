// Tests whether a mesh is a closed surface.
#include <array>
#include <atomic>
#include <bit>
#include <cstdint>

#include "renderer/geometry/mesh_shape.h"
#include "renderer/scene/for_parts.h"

namespace narpa {
namespace {

/// A bijection whose output bits each depend on all input bits: the finaliser of SplitMix64 (G. Steele, D. Lea,
/// C. Flood, "Fast splittable pseudorandom number generators", OOPSLA 2014).
std::uint64_t scrambled(std::uint64_t x) {
    x = (x ^ x >> 30) * 0xbf58'476d'1ce4'e5b9ull;
    x = (x ^ x >> 27) * 0x94d0'49bb'1331'11ebull;
    return x ^ x >> 31;
}

/// The same for vertices at the same position: readers split a vertex where its normal or texture coordinates are
/// discontinuous.
std::uint64_t place_of(const Vec3f& p) {
    const auto word = [](float x) { return std::uint64_t{std::bit_cast<std::uint32_t>(x + 0.0f)}; };  // -0 is 0
    return scrambled((word(p.x) << 32 | word(p.y)) ^ 0x9e37'79b9'7f4a'7c15ull * (word(p.z) + 1));
}

/// Of opposite sign for the two directions of an edge.
std::uint64_t signed_hash(std::uint64_t from, std::uint64_t to) {
    const std::uint64_t hash = scrambled(std::min(from, to) + 3 * std::max(from, to));
    return from < to ? hash : -hash;
}

}  // namespace

/// Edges cancel against those of opposite direction if the sum of their signed hashes, modulo 2^64, is zero.
/// Surfaces that are not closed have another sum, but for one in about 2^64 (D. Clarke et al., "Incremental
/// multiset hash functions and their application to memory integrity checking", ASIACRYPT 2003).
bool is_closed(const Mesh& mesh) {
    std::atomic<std::uint64_t> sum = 0;
    for_parts(mesh.faces.size(), [&](std::size_t begin, std::size_t end) {
        std::uint64_t of_part = 0;
        for (std::size_t i = begin; i < end; ++i) {
            const auto& f = mesh.faces[i];
            const std::uint64_t a = place_of(mesh.positions[f[0]]), b = place_of(mesh.positions[f[1]]),
                                c = place_of(mesh.positions[f[2]]);
            of_part += signed_hash(a, b) + signed_hash(b, c) + signed_hash(c, a);
        }
        sum += of_part;
    });
    return !mesh.faces.empty() && sum == 0;
}

}  // namespace narpa
