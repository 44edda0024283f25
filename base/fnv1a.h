/// base/fnv1a.h - the hash function FNV-1a, 64 bits (G. Fowler, L. Noll, K.-P. Vo): tells changes, not attacks.
#pragma once

#include <cstdint>
#include <string_view>

namespace narpa {

/// `hash`: that of the text before, to continue it.
[[nodiscard]] constexpr std::uint64_t fnv1a(std::string_view text,
                                            std::uint64_t hash = 0xcbf29ce484222325u) noexcept {
    for (const char c : text) hash = (hash ^ static_cast<std::uint8_t>(c)) * 0x100000001b3u;
    return hash;
}

}  // namespace narpa
