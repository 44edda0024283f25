/// tests/renderer/material/texture_support.h - textures made from functions.
#pragma once

#include <cmath>
#include <cstdint>

#include "renderer/material/material.h"

namespace narpa::test {

template <class Value>  // (x, y) -> 0..1
Texture make(int width, int height, Value value, Texture::Wrap wrap = Texture::Wrap::repeat) {
    Texture t{.name = "made", .width = width, .height = height, .rgb = {}, .wrap = wrap};
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const auto code = static_cast<std::uint16_t>(std::lround(65535 * static_cast<double>(value(x, y))));
            t.rgb.insert(t.rgb.end(), 3, code);
        }
    build_coarser_levels(t);
    return t;
}

inline double mean_of(const Texture& t) {
    double sum = 0;
    for (const std::uint16_t c : t.rgb) sum += c;
    return sum / static_cast<double>(t.rgb.size()) / 65535;
}

}  // namespace narpa::test
