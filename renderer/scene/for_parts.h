/// renderer/scene/for_parts.h - loops over the large arrays of meshes, on all cores.
#pragma once

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>

namespace narpa {

/// Calls f(begin, end) for parts of [0, n), several at a time.
template <class F>
void for_parts(std::size_t n, const F& f) {
    constexpr std::size_t kPart = std::size_t{1} << 15;
    const std::size_t parts = (n + kPart - 1) / kPart;
    if (parts <= 1) return f(std::size_t{0}, n);
    tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t i) { f(i * kPart, std::min(n, (i + 1) * kPart)); });
}

}  // namespace narpa
